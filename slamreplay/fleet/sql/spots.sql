with passed as (
  select
    site, places.map_version, floor(col / $SPOT)::int as x, floor("row" / $SPOT)::int as y, key,
    any_value(robot) as robot, sum(here_s) as here_s, sum(places.lost_s) as lost_s,
    sum(entered_lost) as entered
  from places join counted using (key)
  where (here_s > 0 or entered_lost > 0) and places.map_version is not null
  group by all
), spots as (
  select
    site, map_version,
    x * $SPOT_M::double as x_min_m, y * $SPOT_M::double as y_min_m,
    (x + 1) * $SPOT_M::double as x_max_m, (y + 1) * $SPOT_M::double as y_max_m,
    sum(here_s) as here_s,
    sum(lost_s) as lost_s,
    sum(entered) as entered,
    count(*) as passed,
    count(*) filter (entered > 0) as lost_logs,
    count(distinct robot) filter (entered > 0) as robots,
    first(key order by lost_s desc, key) filter (entered > 0) as example
  from passed
  group by site, map_version, x, y
)
select
  *, wilson_low(lost_logs / passed, passed) as low, wilson_high(lost_logs / passed, passed) as high
from spots
where lost_logs > 0 and passed >= $SPOT_LOGS and here_s >= $SPOT_S
order by low desc, lost_s desc, site nulls first, map_version, x_min_m, y_min_m;
