create or replace temp view $TABLE as
select found.* exclude (filename), part
from read_parquet('tables/*/$TABLE.parquet', union_by_name = true, filename = true) as found
join newest on newest.key = found.key and newest.part = parse_path(filename)[-2];
