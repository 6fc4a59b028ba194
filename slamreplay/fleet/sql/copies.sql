select content, list(distinct log order by log) as logs, count(*) as rows_of_it
from logs
where content is not null
group by content
having count(*) > 1
order by content;
