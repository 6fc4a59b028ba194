with spots as (
  select
    key, places.map_version as of_map, floor(col / $SPOT)::int as x, floor("row" / $SPOT)::int as y
  from places join counted using (key)
  where (here_s > 0 or entered_lost > 0) and places.map_version is not null and is_lost
  group by key, places.map_version, floor(col / $SPOT), floor("row" / $SPOT)
  having sum(places.lost_s) > 0 or sum(entered_lost) > 0
  qualify row_number() over (partition by key order by sum(places.lost_s) desc, of_map, x, y) = 1
), odd as (
  select
    counted.*, of_map, x, y,
    case
      when status <> 'done' then 'unreadable'
      when is_lost or is_changed then coalesce(cause, state)
      when gate = 'failed' then 'gate'
      when confidence < $SURE or state = 'unobservable' then 'doubtful'
      when stops > 0 then 'stopped'
    end as kind,
    coalesce(lost_s, 0) + $CHANGED_SHARE * coalesce(changed_s, 0) + $STOP_S * coalesce(stops, 0)
      + if(status <> 'done', $UNREADABLE_S, 0) + if(coalesce(gate = 'failed', false), $GATE_S, 0)
      + if(coalesce(confidence < $SURE, false), $DOUBTFUL_S, 0) as cost
  from counted left join spots using (key)
), ranked as (
  select
    *,
    count(*) over alike as alike,
    row_number() over (alike order by cost desc, key) as place
  from odd
  where kind is not null
  window alike as (partition by kind, site, of_map, x, y, if(x is null, null, map_version))
)
select key, log, report, site, robot, day, state, kind, alike, cost, summary, error
from ranked
order by place, cost desc, key
limit $MOST_PICKS;
