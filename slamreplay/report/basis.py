"""What the page rests on: files, bundle, maps, roles and configuration, with their hashes."""

from __future__ import annotations

from dataclasses import fields
from datetime import UTC, datetime

from slamreplay.bundle.manifest import Manifest
from slamreplay.evidence.result import Postmortem
from slamreplay.geometry.times import NS_PER_S
from slamreplay.report.cells import Cell, Table, table
from slamreplay.report.phrases import NOT_KNOWN, seconds
from slamreplay.version import __version__

#: Where the rows of the log's own description are.
_MANIFEST = "the bundle's manifest.json"


def title(manifest: Manifest) -> str:
    """The log's files; of many the first three."""
    names = [source.name for source in manifest.sources]
    shown = " + ".join(names[:3]) or manifest.bundle_id
    return shown if len(names) <= 3 else f"{shown} + {len(names) - 3} more"


def when(manifest: Manifest) -> str:
    """How long the log is and when it began."""
    length = f"{(manifest.end_ns - manifest.start_ns) / NS_PER_S:.1f} s"
    start_s = manifest.start_ns // NS_PER_S
    if not 1e9 < start_s < 4e9:  # simulated time, or a clock that was never set
        return f"{length} from t = {start_s} s on the {manifest.clock.name} clock"
    start = datetime.fromtimestamp(start_s, tz=UTC)
    return f"{length} from {start:%Y-%m-%d %H:%M:%S} UTC on the {manifest.clock.name} clock"


def made_of(post: Postmortem) -> tuple[tuple[str, str], ...]:
    """Name and value of what the whole page was made from and with."""
    manifest, frames = post.manifest, post.manifest.frames
    contract = (("map", frames.map), ("odom", frames.odom), ("base", frames.base))
    return (
        ("made by", f"slamreplay {__version__}"),
        ("bundle", f"{manifest.bundle_id}, format {manifest.format_version}"),
        ("time", f"{manifest.start_ns} to {manifest.end_ns} ns; the page's seconds begin there"),
        ("clock", f"{manifest.clock.name}: {manifest.clock.reason}"),
        ("frames", ", ".join(f"{name}: {frame or 'none'}" for name, frame in contract)),
        ("options", ", ".join(f"{k} = {v}" for k, v in manifest.options.items()) or "defaults"),
    )  # fmt: skip


def limits(post: Postmortem) -> Table:
    """Every threshold of the verdict, as it was set."""
    rows = [
        (one.name, f"{getattr(post.limits, one.name):.4g}",
         "default" if getattr(post.limits, one.name) == one.default else "set")
        for one in fields(post.limits)
    ]  # fmt: skip
    return table(("limit", "value", "from"), rows, "")


def roles(manifest: Manifest) -> Table:
    """Which topic plays which role, and why."""
    rows = [(r.role, r.topic, r.type, f"{r.messages:,}", r.reason) for r in manifest.roles]
    return table(("role", "topic", "type", "messages", "why this one"), rows, _MANIFEST)


def losses(manifest: Manifest) -> Table:
    """What was skipped, lost or mended while reading."""
    rows = [(x.kind, x.what, f"{x.count:,}", x.reason) for x in manifest.losses]
    return table(("kind", "what", "count", "why"), rows, _MANIFEST)


def maps(manifest: Manifest) -> Table:
    """Every version of the map, and when it held."""
    start_ns = manifest.start_ns
    rows = [
        (
            m.version,
            m.source,
            f"{m.width} x {m.height} cells of {m.resolution_m:g} m",
            ", ".join(
                f"{(a - start_ns) / NS_PER_S:.1f} to {seconds(b - start_ns)}" for a, b in m.held_ns
            )
            or NOT_KNOWN,
        )
        for m in manifest.maps
    ]
    return table(("version", "from", "size", "held"), rows, _MANIFEST)


def sources(manifest: Manifest) -> Table:
    """The files that were read."""
    rows = [(s.name, s.format, f"{s.bytes:,}", Cell(s.sha256)) for s in manifest.sources]
    return table(("file", "format", "bytes", "sha256"), rows, _MANIFEST)


def tables(manifest: Manifest) -> Table:
    """The bundle's own files."""
    rows = [(name, f"{t.rows:,}", Cell(t.sha256)) for name, t in manifest.tables.items()]
    return table(("table", "rows", "sha256"), rows, "")


def files_beside(post: Postmortem) -> str:
    """What lies beside the page because there is a map."""
    names = [] if post.hindsight is None else ["hindsight.tum"]
    names += [] if post.grid is None else ["changed.pgm", "changed.yaml"]
    return ", ".join(names)
