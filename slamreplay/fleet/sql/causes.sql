select
  cause as kind,
  count(*) as logs,
  count(distinct robot) as robots,
  count(distinct site) as sites,
  coalesce(sum(lost_s), 0) / 3600 as lost_h,
  coalesce(sum(changed_s), 0) / 3600 as changed_h,
  coalesce(sum(stops), 0) as stops,
  count(root_cause) as replayed,
  first(key order by coalesce(lost_s, 0) desc, coalesce(changed_s, 0) desc, key) as example
from counted
where cause is not null
group by cause
order by lost_h desc, changed_h desc, robots desc, kind;
