"""Labels of a log of a batch: what the table or manifest says, then what the log says itself."""

from __future__ import annotations

from pathlib import Path

from slamreplay.batch.task import LogSource
from slamreplay.ingest.labels import log_labels, with_meanings


def labels_of(source: LogSource, log: Path | None) -> dict[str, str]:
    """All labels by name; `site`, `robot` and `software` are what the fleet's columns show.

    The table holds against the log. The namespace by which one robot was chosen of several names it
    where nothing else does.

    Args:
        source: the log.
        log: where it lies now, as of `fetch.fetched`; None where it cannot be asked.
    """
    said = with_meanings(source.labels)
    own = {} if log is None else log_labels(log)
    found = {**own, **said}
    if source.robot and not found.get("robot"):
        found["robot"] = source.robot.strip("/")
    return found
