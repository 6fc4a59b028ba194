"""What the page says, as plain text and numbers; how it looks is the template's business."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime

from slamreplay import __version__
from slamreplay.bundle.manifest import Manifest, MapVersion
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.words import FAILURE_MODES, STATES, StateWords
from slamreplay.geometry.times import NS_PER_S
from slamreplay.report import consistency_tables, designs, phrases, tables, trace_tables
from slamreplay.report.assess import not_assessable, title_of
from slamreplay.report.cause_table import cause_note, causes
from slamreplay.report.facts import Fact, deciding_facts
from slamreplay.report.finding_rows import FindingRow, finding_rows
from slamreplay.report.innovations import innovations
from slamreplay.report.latency import latency_note, usage_table
from slamreplay.report.phrases import percent, seconds
from slamreplay.report.tables import Table, table
from slamreplay.report.timeline import Band, bands, marks

#: Where the rows of the log's own description are.
_MANIFEST = "the bundle's manifest.json"


@dataclass(frozen=True)
class Page:
    """Everything the template prints."""

    version: str
    title: str
    bundle_id: str
    when: str
    state: str
    words: StateWords
    confidence: str
    summary: str
    facts: tuple[Fact, ...]
    failure_mode: str
    evidence: tuple[str, ...]
    causes: Table
    cause_note: str
    lacking: tuple[str, ...]
    bands: tuple[Band, ...]
    marks: tuple[Band, ...]
    end: str
    legend: tuple[tuple[str, str], ...]
    intervals: Table
    stops: Table
    actions: Table
    regions: Table
    trials: Table
    design: Table
    design_question: str
    ranking: Table
    controls: Table
    design_notes: tuple[str, ...]
    design_alt: str
    graph_alt: str
    innovations: Table
    jumps: Table
    usages: Table
    latency_note: str
    traces: tuple[tuple[str, Table], ...]
    trace_note: str
    findings: tuple[FindingRow, ...]
    unasked: tuple[tuple[str, str, str], ...]
    missing: tuple[tuple[str, str, str], ...]
    audit: tuple[tuple[str, str], ...]
    roles: Table
    frames: Table
    losses: Table
    sources: Table
    map_files: str
    map_alt: str
    map_note: str
    course_alt: str
    covariance_alt: str
    reference_note: str
    means: Table
    coverage: Table
    consistency_note: str
    coverage_note: str
    consistency_alt: str
    trials_note: str
    confidence_note: str
    reliability_alt: str


def page(post: Postmortem) -> Page:
    """The page of a post-mortem."""
    judgement, manifest, design = post.judgement, post.manifest, designs.design_of(post)
    seen = dict.fromkeys(i.state for i in judgement.intervals)
    return Page(
        version=__version__,
        title=_title(manifest),
        bundle_id=manifest.bundle_id,
        when=_when(manifest),
        state=judgement.state,
        words=STATES[judgement.state],
        confidence=percent(judgement.confidence),
        summary=judgement.summary,
        facts=deciding_facts(post),
        failure_mode=_failure_mode(post),
        evidence=judgement.failure_mode.evidence,
        causes=causes(post),
        cause_note=cause_note(post),
        lacking=judgement.lacking,
        bands=bands(post),
        marks=marks(post),
        end=seconds(manifest.end_ns - manifest.start_ns),
        legend=tuple((state, STATES[state].name) for state in seen),
        intervals=tables.intervals(post),
        stops=tables.stops(post),
        actions=tables.actions(post),
        regions=tables.regions(post),
        trials=tables.trials(post),
        design=designs.design_table(design),
        design_question="" if design is None else design.question,
        ranking=designs.ranking_table(design),
        controls=designs.control_table(design),
        design_notes=designs.design_notes(design),
        design_alt=designs.design_alt(design),
        graph_alt=phrases.graph_alt(post),
        innovations=innovations(post),
        jumps=trace_tables.jumps(post),
        usages=usage_table(post),
        latency_note=latency_note(post),
        traces=trace_tables.traces(post),
        trace_note=trace_tables.trace_note(post),
        findings=finding_rows(post),
        unasked=tuple((i, title_of(i), why) for i, why in not_assessable(post).items()),
        missing=tuple((m.part, m.reason, m.consequence) for m in manifest.missing),
        audit=_audit(manifest),
        roles=table(
            ("role", "topic", "type", "messages", "why this one"),
            [(r.role, r.topic, r.type, f"{r.messages}", r.reason) for r in manifest.roles],
            _MANIFEST,
        ),
        frames=table(
            ("parent", "child", "kind", "samples"),
            [
                (e.parent, e.child, "static" if e.is_static else "moving", f"{e.samples}")
                for e in manifest.frames.tree
            ],
            _MANIFEST,
        ),
        losses=table(
            ("kind", "what", "count", "why"),
            [(x.kind, x.what, f"{x.count}", x.reason) for x in manifest.losses],
            _MANIFEST,
        ),
        sources=table(
            ("file", "format", "bytes", "sha256"),
            [(s.name, s.format, f"{s.bytes:,}", s.sha256) for s in manifest.sources],
        ),
        map_files=_map_files(post),
        map_alt=phrases.map_alt(post),
        map_note=phrases.map_note(post),
        course_alt=phrases.course_alt(post),
        covariance_alt=phrases.covariance_alt(post),
        reference_note=phrases.reference_note(post),
        means=consistency_tables.means(post.consistency),
        coverage=consistency_tables.coverage(post.consistency),
        consistency_note=consistency_tables.note(post.consistency),
        coverage_note=consistency_tables.coverage_note(post.consistency),
        consistency_alt=consistency_tables.alt(post.consistency),
        trials_note=phrases.trials_note(post),
        confidence_note=phrases.confidence_note(judgement.confidence, post.reliability),
        reliability_alt=phrases.reliability_alt(post.reliability),
    )


def _title(manifest: Manifest) -> str:
    names = [source.name for source in manifest.sources]
    shown = " + ".join(names[:3]) or manifest.bundle_id
    return shown if len(names) <= 3 else f"{shown} + {len(names) - 3} more"


def _when(manifest: Manifest) -> str:
    length = f"{(manifest.end_ns - manifest.start_ns) / NS_PER_S:.1f} s"
    start_s = manifest.start_ns // NS_PER_S
    if not 1e9 < start_s < 4e9:  # simulated time, or a clock that was never set
        return f"{length} from t = {start_s} s on the {manifest.clock.name} clock"
    start = datetime.fromtimestamp(start_s, tz=UTC)
    return f"{length} from {start:%Y-%m-%d %H:%M:%S} UTC on the {manifest.clock.name} clock"


def _failure_mode(post: Postmortem) -> str:
    mode = post.judgement.failure_mode
    if mode.kind == "none":
        return ""
    sure = "" if mode.confidence is None else f" ({percent(mode.confidence)})"
    return f"{FAILURE_MODES[mode.kind]}{sure}"


def _audit(manifest: Manifest) -> tuple[tuple[str, str], ...]:
    frames = manifest.frames
    contract = (("map", frames.map), ("odom", frames.odom), ("base", frames.base))
    return (
        ("clock", f"{manifest.clock.name}: {manifest.clock.reason}"),
        ("frames", ", ".join(f"{name}: {frame or 'none'}" for name, frame in contract)),
        (
            "map",
            "; ".join(
                f"{m.source}: {m.width} x {m.height} cells of {m.resolution_m:g} m, {m.version}"
                f"{_held(m, manifest.start_ns) if len(manifest.maps) > 1 else ''}"
                for m in manifest.maps
            )
            or "none",
        ),
        ("options", ", ".join(f"{k} = {v}" for k, v in manifest.options.items()) or "defaults"),
    )


def _held(version: MapVersion, start_ns: int) -> str:
    spans = (
        f"{(a - start_ns) / NS_PER_S:.1f} to {seconds(b - start_ns)}" for a, b in version.held_ns
    )
    return f", held {', '.join(spans)}"


def _map_files(post: Postmortem) -> str:
    names = [] if post.hindsight is None else ["hindsight.tum"]
    names += [] if post.grid is None else ["changed.pgm", "changed.yaml"]
    return ", ".join(names)
