with robots as (
  select $COLUMN as name, measure, whose, count(*)::double as n, sum(yes) as x
  from outcomes where measure in ('lost', 'changed', 'gate') group by all
), shares as (
  select
    name, measure, sum(x) as x, sum(n) as n, sum(x) / sum(n) as p,
    worth(sum(n), sum(n * n), $CORRELATION) as worth
  from robots join alike using (measure) group by name, measure, correlation
), groups as (
  select
    $COLUMN as name,
    count(*) as logs,
    count(*) filter (status <> 'done') as failed,
    count(*) filter (state = 'healthy') as healthy,
    count(*) filter (state = 'lost') as lost,
    count(*) filter (state = 'map_changed') as map_changed,
    count(*) filter (state = 'lost_and_map_changed') as lost_and_map_changed,
    count(*) filter (state = 'unobservable') as unobservable,
    count(*) filter (state = 'insufficient_data') as insufficient_data,
    count(distinct robot) as robots,
    count(distinct site) as sites,
    coalesce(sum(judged_s), 0) / 3600 as judged_h,
    coalesce(sum(driven_m), 0) / 1000 as driven_km,
    coalesce(sum(lost_s), 0) / 3600 as lost_h,
    coalesce(sum(changed_s), 0) / 3600 as changed_h,
    coalesce(sum(lost_times), 0) as lost_times,
    coalesce(sum(stops), 0) as stops,
    min(day) as first_day,
    max(day) as last_day
  from counted group by all
)
select
  groups.*,
  lost_times / nullif(driven_km, 0) as lost_per_km,
  lost_times / nullif(judged_h, 0) as lost_per_h,
  coalesce(l.x, 0) as lost_logs,
  coalesce(l.n, 0) as judged_logs,
  wilson_low(l.p, l.worth) as lost_low,
  wilson_high(l.p, l.worth) as lost_high,
  coalesce(c.x, 0) as changed_logs,
  wilson_low(c.p, c.worth) as changed_low,
  wilson_high(c.p, c.worth) as changed_high,
  coalesce(g.x, 0) as gate_failed,
  coalesce(g.n, 0) as gated_logs,
  wilson_low(g.p, g.worth) as gate_low,
  wilson_high(g.p, g.worth) as gate_high
from groups
left join shares as l on l.name is not distinct from groups.name and l.measure = 'lost'
left join shares as c on c.name is not distinct from groups.name and c.measure = 'changed'
left join shares as g on g.name is not distinct from groups.name and g.measure = 'gate'
order by groups.name nulls last;
