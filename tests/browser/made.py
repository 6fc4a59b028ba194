"""The reports that are opened: a lost robot, a changed aisle, a log without its map, a hostile one;
and the page of a fleet.

The first comes from the command that users type, the others from the functions behind it.
"""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from fleet_tables import fleet

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.manifest import Loss, Manifest, Source
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle
from slamreplay.fleet.page.writer import write_fleet_page
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.postmortem import postmortem
from slamreplay.report.writer import write_report
from slamreplay.testing.edits import without
from slamreplay.testing.synthetic import START_NS, synthetic_bundle

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "sample_logs"
#: The three that every test of the page opens.
NAMES = ("lost", "changed", "bare")

#: Breaks out of HTML text and attributes, of a script, of JSON in one, of a string, of a template.
HOSTILE = (
    "</script></style></title><script>window.__pwned=1</script>"
    "<img src=x onerror=window.__pwned=2><svg onload=window.__pwned=3>"
    "\"'` onmouseover=window.__pwned=4 x=\"';window.__pwned=5;//${window.__pwned=6}"
    "{{7*191}} \u2028\u2029\x00\x1b[31m\u202e javascript:window.__pwned=7 <!-- "
)


def report(name: str, folder: Path) -> Path:
    """report.html of one of them, made in a folder of its own."""
    target = folder / name
    if name == "lost":
        program = [sys.executable, "-m", "slamreplay.cli.main", "report"]
        log = SAMPLES / "lost_robot.mcap"
        subprocess.run(
            [*program, str(log), "-o", str(target)], check=True, capture_output=True, cwd=ROOT
        )
        return target / "report.html"
    if name == "fleet":
        return write_fleet_page(fleet().write(target))
    if name == "hostile":
        post = postmortem(hostile_bundle())
        said = Finding("SR-DAT-002", "error", f"{HOSTILE}\ud800", START_NS, START_NS + 10**9)
        return write_report(replace(post, findings=(*post.findings, said)), target)
    log = {"changed": "changed_aisle.mcap", "bare": "healthy_short.db3"}[name]
    bundle = ingest([SAMPLES / log], folder / f"{name}.bundle", IngestOptions())
    return write_report(postmortem(without(bundle, "map") if name == "bare" else bundle), target)


def hostile_bundle() -> Bundle:
    """A lost robot in a room; its topics, frames, files, recoveries and losses are hostile."""
    bundle = synthetic_bundle(seconds=12.0, belief_offset_xyyaw=(1.5, 0.5, 0.1))
    names = {
        text: f"{text}{HOSTILE}"
        for text in ("/scan", "/odom", "/amcl_pose", "base_link", "laser", "/tf", "/map")
    }
    tables = {name: _renamed(bundle.table(name), names) for name in TABLES}
    tables["recoveries"] = Table(
        TABLES["recoveries"],
        {
            **dict.fromkeys(
                ("t_ns", "t_sensor_ns", "t_log_ns"), START_NS + 4 * 10**9 + np.arange(2)
            ),
            "topic": [HOSTILE] * 2,
            "name": [f"Spin{HOSTILE}"] * 2,
            "status": ["running", "success"],
            "goal": [HOSTILE] * 2,
            "source": ["action"] * 2,
        },
    )
    described = _replaced(bundle.manifest.model_dump(mode="json"), names)
    manifest = Manifest.model_validate(described).model_copy(
        update={
            "sources": [Source(name=f"{HOSTILE}.mcap", format="mcap", bytes=7, sha256="ab" * 32)],
            "losses": [Loss(kind="skipped", what=HOSTILE, count=3, reason=HOSTILE)],
        }
    )
    return Bundle(manifest, tables, bundle.grids())


def _renamed(table, names):
    columns = {}
    for column in table.schema.columns:
        values = table[column.name]
        if column.kind == "str":
            values = [names.get(text, text) for text in values]
        columns[column.name] = values
    return Table(table.schema, columns)


def _replaced(value, names):
    if isinstance(value, dict):
        return {names.get(k, k): _replaced(v, names) for k, v in value.items()}
    if isinstance(value, list):
        return [_replaced(v, names) for v in value]
    return names.get(value, value) if isinstance(value, str) else value
