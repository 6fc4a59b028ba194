"""What the page says, as plain text and numbers; how it looks is the template's business."""

from __future__ import annotations

from dataclasses import dataclass

from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.words import FAILURE_MODES, STATES, StateWords, confidence_text
from slamreplay.report import (
    audit_tables,
    basis,
    consistency_tables,
    designs,
    phrases,
    tables,
    trace_tables,
)
from slamreplay.report.assess import not_assessable, title_of
from slamreplay.report.cause_table import cause_note, causes
from slamreplay.report.cells import Table
from slamreplay.report.facts import Fact, deciding_facts
from slamreplay.report.finding_rows import FindingGroup, anchors, finding_groups
from slamreplay.report.innovations import innovations
from slamreplay.report.latency import latency_note, usage_table
from slamreplay.report.phrases import seconds
from slamreplay.report.summary import summary_text
from slamreplay.report.timeline import HATCHES, Band, bands, marks, timeline_alt
from slamreplay.version import __version__


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
    hatches: tuple[tuple[str, str], ...]
    timeline_alt: str
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
    findings: tuple[FindingGroup, ...]
    ticket: str
    unasked: tuple[tuple[str, str, str], ...]
    missing: tuple[tuple[str, str, str], ...]
    clock_notes: tuple[str, ...]
    streams: Table
    edges: Table
    covers: Table
    steps: Table
    made_of: tuple[tuple[str, str], ...]
    limits: Table
    roles: Table
    losses: Table
    maps: Table
    sources: Table
    tables: Table
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
    findings = finding_groups(post)
    seen = dict.fromkeys(i.state for i in judgement.intervals)
    return Page(
        version=__version__,
        title=basis.title(manifest),
        bundle_id=manifest.bundle_id,
        when=basis.when(manifest),
        state=judgement.state,
        words=STATES[judgement.state],
        confidence=confidence_text(judgement.confidence),
        summary=judgement.summary,
        facts=deciding_facts(post),
        failure_mode=_failure_mode(post),
        evidence=judgement.failure_mode.evidence,
        causes=causes(post),
        cause_note=cause_note(post),
        lacking=judgement.lacking,
        bands=bands(post),
        marks=marks(post),
        hatches=tuple(HATCHES.items()),
        timeline_alt=timeline_alt(post),
        end=seconds(manifest.end_ns - manifest.start_ns),
        legend=tuple((state, STATES[state].name) for state in seen),
        intervals=tables.intervals(post, anchors(findings)),
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
        findings=findings,
        ticket=summary_text(post),
        unasked=tuple((i, title_of(i), why) for i, why in not_assessable(post).items()),
        missing=tuple((m.part, m.reason, m.consequence) for m in manifest.missing),
        clock_notes=audit_tables.clock_notes(post),
        streams=audit_tables.streams(post),
        edges=audit_tables.edges(post),
        covers=audit_tables.covers(post),
        steps=audit_tables.steps(post),
        made_of=basis.made_of(post),
        limits=basis.limits(post),
        roles=basis.roles(manifest),
        losses=basis.losses(manifest),
        maps=basis.maps(manifest),
        sources=basis.sources(manifest),
        tables=basis.tables(manifest),
        map_files=basis.files_beside(post),
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


def _failure_mode(post: Postmortem) -> str:
    mode = post.judgement.failure_mode
    if mode.kind == "none":
        return ""
    sure = "" if mode.confidence is None else f" ({confidence_text(mode.confidence)})"
    return f"{FAILURE_MODES[mode.kind]}{sure}"
