with recursive looks as (
  select
    site, places.map_version, col, "row", key, robot, start_ns, day, seen_m2, contradicted_m2,
    contradicted_m2 >= $AGAINST_M2 as against
  from places join counted using (key)
  where judged and ordered and places.map_version is not null
    and (seen_m2 >= $LOOK_M2 or contradicted_m2 >= $AGAINST_M2)
), changed as (
  -- Places that a log contradicts, and whether the latest looks do.
  select
    row_number() over (order by site nulls first, map_version, col, "row") as id,
    site, map_version, col, "row",
    list_bool_or(list(against order by start_ns desc, key desc)[1:$LATEST_LOOKS]) as wrong
  from looks
  group by site, map_version, col, "row"
  having bool_or(against)
), near as (
  select a.id as a, b.id as b
  from changed as a join changed as b
    on a.site is not distinct from b.site and a.map_version = b.map_version and a.wrong = b.wrong
    and abs(a.col - b.col) <= $GAP and abs(a."row" - b."row") <= $GAP
), reach as (
  select a, b from near
  union
  select reach.a, near.b from reach join near on near.a = reach.b
), parts as (
  select changed.*, area
  from changed join (select a as id, min(b) as area from reach group by a) using (id)
), boxes as (
  select
    area, any_value(site) as site, any_value(map_version) as map_version,
    min(col) as x0, max(col) as x1, min("row") as y0, max("row") as y1
  from parts group by area
), seen as (
  select
    area, key, any_value(robot) as robot, any_value(start_ns) as start_ns, any_value(day) as day,
    sum(seen_m2) as seen, sum(contradicted_m2) as contradicted
  from looks join parts
    on looks.site is not distinct from parts.site and looks.map_version = parts.map_version
    and looks.col = parts.col and looks."row" = parts."row"
  group by area, key
), judged as (
  select
    *,
    seen >= $LOOK_SHARE * max(seen) over (partition by area) as saw,
    contradicted >= greatest(
      $AGAINST_M2, $AGAINST_SHARE * max(contradicted) over (partition by area)
    ) as against
  from seen
), numbered as (
  select
    *,
    row_number() over (partition by area order by start_ns, key) as n,
    row_number() over (partition by area order by start_ns desc, key desc) as back
  from judged where saw or against
), course as (
  select
    *,
    min(n) filter (against) over (partition by area) as first_n,
    max(n) over (partition by area) as last_n,
    max(n) filter (against) over (partition by area) = max(n) over (partition by area) as last_against
  from numbered
), told as (
  select
    area,
    median(contradicted) filter (against) as m2,
    count(*) filter (against) as logs,
    count(distinct robot) filter (against) as robots,
    count(distinct robot) as looked,
    min(day) filter (against) as first_day,
    max(day) filter (against) as last_day,
    count(*) filter (n > first_n) as visits,
    count(*) filter (n > first_n and against) as still,
    any_value(last_against) as last_against,
    max(last_n) - coalesce(
      max(n) filter (n >= first_n and against <> last_against), min(first_n) - 1
    ) as run,
    avg(against::int) filter (n >= first_n and back <= $RECENT) as recent,
    first(key order by n) filter (against) as first_key,
    first(start_ns order by n) filter (against) as first_ns,
    last(key order by n) filter (against) as example
  from course group by area having bool_or(against)
), sums as (
  select site, places.map_version, col, "row", sum(here_s) as here_s
  from places join counted using (key) group by all
), beside as (
  select area, sum(here_s) / 3600 as near_h
  from boxes join sums
    on boxes.site is not distinct from sums.site and boxes.map_version = sums.map_version
    and col between x0 - $NEAR and x1 + $NEAR and "row" between y0 - $NEAR and y1 + $NEAR
  group by area
), lost as (
  -- Who was lost there before the map was wrong was not lost because of it.
  select area, sum(l.lost_s) as lost_near_s, count(distinct key) filter (is_lost) as lost_near
  from boxes join told using (area) join (
    select site, places.map_version, col, "row", key, start_ns, is_lost, places.lost_s
    from places join counted using (key) where places.lost_s > 0 and ordered
  ) as l
    on boxes.site is not distinct from l.site and boxes.map_version = l.map_version
    and col between x0 - $NEAR and x1 + $NEAR and "row" between y0 - $NEAR and y1 + $NEAR
    and (start_ns > first_ns or start_ns = first_ns and key >= first_key)
  group by area
), kinds as (
  select area, kind, count(*) as n
  from boxes join (
    select regions.*, site from regions join counted using (key) where judged
  ) as r
    on boxes.site is not distinct from r.site and boxes.map_version = r.map_version
    and x_min_m < (x1 + 1) * $PLACE_M::double and x_max_m > x0 * $PLACE_M::double
    and y_min_m < (y1 + 1) * $PLACE_M::double and y_max_m > y0 * $PLACE_M::double
  group by area, kind
), kind as (
  select
    area,
    case when max(n) >= $ONE_KIND * sum(n) then first(kind order by n desc, kind)
    else 'mixed' end as kind
  from kinds group by area
), in_use as (
  select
    site, map_version,
    coalesce(max(max(day)) over (partition by site) - max(day) <= $IN_USE_DAYS, true) as in_use
  from counted group by site, map_version
), advised as (
  select
    boxes.site, boxes.map_version,
    x0 * $PLACE_M::double as x_min_m, y0 * $PLACE_M::double as y_min_m,
    (x1 + 1) * $PLACE_M::double as x_max_m, (y1 + 1) * $PLACE_M::double as y_max_m,
    m2, kind, logs, robots, first_day, last_day, visits, still,
    case when last_against then run else -run end as latest,
    still / nullif(visits, 0) as persistence,
    coalesce(near_h, 0) as near_h, coalesce(lost_near_s, 0) as lost_near_s,
    coalesce(lost_near, 0) as lost_near,
    coalesce(in_use, true) as in_use,
    case
      when not last_against and run >= $CLEARED then 'temporary'
      when logs < $AREA_LOGS or robots < least($AREA_ROBOTS, looked) then 'watch'
      when recent < $RECENT_SHARE then 'watch'
      else 're-map'
    end as advice,
    example
  from told join boxes using (area)
  left join beside using (area)
  left join lost using (area)
  left join kind using (area)
  left join in_use
    on in_use.site is not distinct from boxes.site and in_use.map_version = boxes.map_version
  where m2 >= $LEAST_M2
)
select *, m2 * (still + 1) / (visits + 2) * near_h as worth
from advised
order by
  not in_use, list_position(['re-map', 'watch', 'temporary'], advice), worth desc,
  site nulls first, map_version, x_min_m, y_min_m, x_max_m, y_max_m;
