-- Of each log the rows of the last part by name: one that was tried again has an older row, too, and
-- while parts are laid together all of theirs are there twice.
create or replace temp table newest as
select key, max(parse_path(filename)[-2]) as part
from read_parquet('tables/*/logs.parquet', union_by_name = true, filename = true)
group by key;

$TABLES
-- The logs that count: a log under two names (one content) is one, judged rather than failed, the
-- first by name, and under one name the newest. Logs of one robot are no independent draws; where
-- nobody tells the robot each log is taken as one of its own.
create or replace temp table counted as
select
  *,
  status = 'done' and coalesce(state not in ('unobservable', 'insufficient_data'), false) as judged,
  coalesce(state in ('lost', 'lost_and_map_changed'), false) as is_lost,
  coalesce(state in ('map_changed', 'lost_and_map_changed'), false) as is_changed,
  coalesce(root_cause, nullif(failure_mode, 'none')) as cause,
  coalesce('robot ' || robot, 'log ' || key) as whose,
  day is not null or not bool_or(day is not null) over () as ordered
from (
  select *
  from logs
  qualify row_number() over (
    partition by coalesce(content, key) order by status = 'done' desc, log, part desc, key
  ) = 1
);

-- One row per log and yes-or-no question that it answers.
create or replace temp table outcomes as
with asked as (
  select *, 'lost' as measure, is_lost as yes from counted where judged
  union all by name
  select *, 'changed' as measure, is_changed as yes from counted where judged
  union all by name
  select *, 'stopped' as measure, coalesce(stops > 0, false) as yes from counted where status = 'done'
  union all by name
  select *, 'gate' as measure, gate = 'failed' as yes from counted where gate in ('passed', 'failed')
  union all by name
  select counted.*, kind as measure, coalesce(cause = kind, false) as yes
  from counted, (select distinct cause as kind from counted where judged and cause is not null)
  where judged
)
select key, site, robot, software, map_version, day, whose, measure, yes::int as yes from asked;

-- How much alike logs of one robot are: intraclass correlation by analysis of variance.
create or replace temp table alike as
with robots as (
  select measure, whose, count(*)::double as n, avg(yes) as share from outcomes group by all
), fleet as (
  select measure, count(*) as k, sum(n) as n, sum(n * n) as squares, sum(n * share) / sum(n) as share
  from robots group by measure
), squares as (
  select
    measure, any_value(k) as k, any_value(fleet.n) as n,
    sum(robots.n * (robots.share - fleet.share) ** 2) / nullif(any_value(k) - 1, 0) as b,
    sum(robots.n * robots.share * (1 - robots.share)) / nullif(any_value(fleet.n - k), 0) as w,
    any_value((fleet.n - squares / fleet.n) / nullif(k - 1, 0)) as m
  from robots join fleet using (measure) group by measure
)
select
  measure,
  case when k < 2 or n <= k or b + (m - 1) * w <= 0 then 0.0
  else greatest(0.0, least(1.0, (b - w) / (b + (m - 1) * w))) end as correlation
from squares;

-- How many independent logs n are worth, squares being the sum over robots of their logs squared.
create or replace temp macro worth(n, squares, correlation) as
  nullif(n, 0) / (1 + correlation * (squares / nullif(n, 0) - 1));

-- Wilson's interval of a share, 95 % unless another quantile is given.
create or replace temp macro wilson_half(p, n, z) as
  z * sqrt(greatest(0, p * (1 - p) / n + z ** 2 / (4 * n * n)));
create or replace temp macro wilson_low(p, n, z := $Z) as
  if(p is null, null, greatest(0.0, (p + z ** 2 / (2 * n) - wilson_half(p, n, z)) / (1 + z ** 2 / n)));
create or replace temp macro wilson_high(p, n, z := $Z) as
  if(p is null, null, least(1.0, (p + z ** 2 / (2 * n) + wilson_half(p, n, z)) / (1 + z ** 2 / n)));
