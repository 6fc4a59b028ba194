select key, log, site, robot, coalesce(error, '') as error
from counted
where status <> 'done'
order by site nulls last, log, key;
