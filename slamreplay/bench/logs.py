"""From an incident to the bundle that everything is judged by, and to the truth beside it."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from slamreplay.bench.incidents import Incident
from slamreplay.bench.truth import Truth, truth_of
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.view import Bundle
from slamreplay.ingest.pipeline import ingest
from slamreplay.simulate.topics import records
from slamreplay.simulate.writer import write_log


def bundle_of(incident: Incident) -> tuple[Bundle, Truth]:
    """The log of an incident as a bundle that lives in memory, and its labels.

    The log is really written and really ingested, in a folder that is gone afterwards: roles,
    frames and clock are found as in any other log.
    """
    with TemporaryDirectory(prefix="slamreplay-bench-") as folder:
        log = Path(folder) / f"{incident.kind}.mcap"
        write_log(log, lambda messages: records(incident.recording, messages))
        on_disk = ingest([log], Path(folder) / "bundle")
        tables = {name: on_disk.table(name) for name in TABLES}
        bundle = Bundle(on_disk.manifest, tables, on_disk.grids())
    return bundle, truth_of(incident, bundle)
