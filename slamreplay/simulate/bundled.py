"""A recording as a bundle that lives in memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.view import Bundle
from slamreplay.ingest.pipeline import ingest
from slamreplay.simulate.messages import Messages
from slamreplay.simulate.recording import Recording
from slamreplay.simulate.topics import Record, records
from slamreplay.simulate.writer import write_log


def bundle_of(
    recording: Recording,
    name: str = "simulated",
    suffix: str = ".mcap",
    edit: Callable[[Sequence[Record]], Sequence[Record]] | None = None,
) -> Bundle:
    """The log of a recording, read as any other log.

    The log is really written and really ingested, in a folder that is gone afterwards: roles,
    frames and clock are found as in any other log.

    Args:
        recording: what was simulated.
        name: of the log's file; the manifest tells it as the source.
        suffix: the kind of log, one of those that the simulator writes.
        edit: what a recorder made of the messages; None writes them all as they are.
    """

    def written(messages: Messages) -> Sequence[Record]:
        every = records(recording, messages)
        return every if edit is None else edit(every)

    with TemporaryDirectory(prefix="slamreplay-") as folder:
        log = Path(folder) / f"{name}{suffix}"
        write_log(log, written)
        on_disk = ingest([log], Path(folder) / "bundle")
        tables = {name: on_disk.table(name) for name in TABLES}
        return Bundle(on_disk.manifest, tables, on_disk.grids())
