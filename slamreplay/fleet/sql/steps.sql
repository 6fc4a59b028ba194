with versions as (
  select software, row_number() over (order by min(start_ns), software) as n
  from counted where ordered and software is not null group by software
), pairs as (
  select a.n, a.software as before, b.software as after
  from versions as a join versions as b on b.n = a.n + 1
), shared as (
  select pairs.n, site
  from pairs join counted on software in (before, after)
  group by pairs.n, site having count(distinct software) = 2
), about as (
  select pairs.n, count(distinct shared.site) + bool_or(shared.site is null)::int as sites,
    count(distinct robot) as robots
  from pairs join shared using (n)
  join counted on software in (before, after) and counted.site is not distinct from shared.site
  group by pairs.n
), robots as (
  select pairs.n, measure, software = after as is_after, whose, count(*)::double as logs, sum(yes) as x
  from pairs join shared using (n)
  join outcomes on software in (before, after) and outcomes.site is not distinct from shared.site
  group by all
), parts as (
  select *, logs / sum(logs) over (partition by n, measure, is_after) as part from robots
), apart as (
  -- What is peculiar to a robot cancels as far as it has the same part in both versions.
  select n, measure, sum(off * off) / sum(squares) as apart
  from (
    select n, measure, whose, sum(if(is_after, part, -part)) as off, sum(part * part) as squares
    from parts group by n, measure, whose
  )
  group by n, measure
), shares as (
  select
    n, measure, is_after, sum(x) as x, sum(logs) as logs, sum(x) / sum(logs) as p,
    1 / greatest(
      1 / sum(logs), (1 - correlation) / sum(logs) + correlation * sum(part * part) * apart
    ) as worth
  from parts join alike using (measure) join apart using (n, measure)
  group by n, measure, is_after, correlation, apart
), measures as (
  select * from (values (1, 'lost'), (2, 'changed'), (3, 'stopped'), (4, 'gate')) as m(place, measure)
  union all
  select distinct 5, cause from counted where judged and cause is not null
), paired as (
  select
    pairs.n, place, before, after, measures.measure,
    coalesce(was.x, 0) as was_count, coalesce(was.logs, 0) as was_logs, was.p as was,
    coalesce(now.x, 0) as now_count, coalesce(now.logs, 0) as now_logs, now.p as now,
    was.worth as was_worth, now.worth as now_worth,
    least(was_logs, now_logs) >= $STEP_LOGS as enough
  from pairs cross join measures
  left join shares as was
    on was.n = pairs.n and was.measure = measures.measure and not was.is_after
  left join shares as now
    on now.n = pairs.n and now.measure = measures.measure and now.is_after
  where place < 5 or was_count + now_count > 0
), together as (
  -- Of so many intervals at once each is missed less often: the list has the quantile of 1, 2, ...
  select *, ($Z_OF)[greatest(1, count(*) filter (enough) over (partition by n))] as z
  from paired
), compared as (
  select
    *,
    now - was - sqrt(
      (now - wilson_low(now, now_worth, z)) ** 2 + (wilson_high(was, was_worth, z) - was) ** 2
    ) as low,
    now - was + sqrt(
      (wilson_high(now, now_worth, z) - now) ** 2 + (was - wilson_low(was, was_worth, z)) ** 2
    ) as high
  from together
)
select
  before, after, measure, was_count, was_logs, was, now_count, now_logs, now, low, high,
  coalesce(sites, 0) as sites, coalesce(robots, 0) as robots,
  case
    when not enough then 'not told apart'
    when low > 0 then 'worse' when high < 0 then 'better' else 'not told apart'
  end as verdict
from compared left join about using (n)
order by n, place, measure;
