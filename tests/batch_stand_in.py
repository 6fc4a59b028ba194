"""A preload of dask workers in tests: logs are looked back on in no time, and some are poison.

What is tested is who does what when somebody dies; a post-mortem would only take long. A log with
`poison` in its name takes its process down as a fault in compiled code does.
"""

import os
import time

import pyarrow as pa

from slamreplay.batch import worker
from slamreplay.batch.folder import report_folder
from slamreplay.batch.task import LogResult
from slamreplay.fleet.schema import arrow_schema


def stand_in(task, folder, spent):
    if "poison" in task.source.log:
        os.abort()
    time.sleep(0.3)
    row = dict.fromkeys(arrow_schema("logs").names) | {
        "key": task.key, "log": task.source.log, "status": "done", "state": "healthy",
        "report": report_folder(task),
    }  # fmt: skip
    tables = {"logs": pa.Table.from_pylist([row], arrow_schema("logs"))}
    files = {"report.json": b'{"schema_version": 1}', "report.html": b"<html></html>"}
    return LogResult(task.key, None, files, {}, tables)


def dask_setup(_worker):
    worker._judged = stand_in
