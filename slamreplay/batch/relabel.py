"""Labels that changed since a log was judged, put into its row without judging it again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slamreplay.batch.labels import labels_of
from slamreplay.batch.task import LogTask
from slamreplay.evidence.clean import clean
from slamreplay.fleet.schema import TABLES
from slamreplay.fleet.store import commit, read
from slamreplay.ingest.labels import MEANINGS

if TYPE_CHECKING:
    import pyarrow as pa


def relabel(target: Path, tasks: Sequence[LogTask]) -> int:
    """Give rows that are there the site, robot and software that tasks with their keys now bear.

    What the table of maps or a manifest says is written; where neither says anything, what stands
    there stays, for it may be the log's own word.

    Args:
        target: the batch's folder, which nobody else writes to.
        tasks: the logs that were asked for.

    Returns:
        How many logs have other labels than before.

    Raises:
        OutputError: the folder cannot be written.
    """
    said = {task.key: _columns(labels_of(task.source, None)) for task in tasks}
    if not any(said.values()):
        return 0
    rows = {row["key"]: row for row in _labels_there(target)}
    changed = {
        key: labels
        for key, labels in said.items()
        if key in rows and any(rows[key][name] != text for name, text in labels.items())
    }
    if changed:
        tables = {name: _of_keys(read(target, name), list(changed)) for name in TABLES}
        tables["logs"] = _with(tables["logs"], changed)
        commit(target, tables)
    return len(changed)


def _columns(labels: Mapping[str, str]) -> dict[str, str]:
    return {name: clean(labels[name]) for name in MEANINGS if labels.get(name)}


def _labels_there(target: Path) -> list[dict[str, Any]]:
    return read(target, "logs").select(["key", *MEANINGS]).to_pylist()


def _of_keys(rows: pa.Table, keys: list[str]) -> pa.Table:
    import pyarrow as pa
    import pyarrow.compute as pc

    return rows.filter(pc.is_in(rows["key"], value_set=pa.array(keys)))


def _with(logs: pa.Table, labels: Mapping[str, Mapping[str, str]]) -> pa.Table:
    import pyarrow as pa

    rows = [row | dict(labels[row["key"]]) for row in logs.to_pylist()]
    return pa.Table.from_pylist(rows, schema=logs.schema)
