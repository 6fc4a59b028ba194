select
  site, places.map_version, col, "row",
  sum(here_s) as here_s,
  sum(places.lost_s) as lost_s,
  sum(entered_lost) as entered,
  count(*) filter (here_s > 0 or entered_lost > 0) as passed,
  count(*) filter (places.lost_s > 0) as lost_logs,
  max(seen_m2) as seen_m2,
  count(*) filter (
    judged and ordered and (seen_m2 >= $LOOK_M2 or contradicted_m2 >= $AGAINST_M2)
  ) as looks,
  count(*) filter (judged and ordered and contradicted_m2 >= $AGAINST_M2) as against
from places join counted using (key)
where places.map_version is not null
group by site, places.map_version, col, "row"
order by site nulls first, places.map_version, col, "row";
