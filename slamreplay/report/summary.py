"""The answer in ten lines, for the terminal and tickets: what the page's first screen says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from slamreplay.bundle.findings import SEVERITIES
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.words import FAILURE_MODES, STATES, confidence_text, meaning_of
from slamreplay.geometry.times import NS_PER_S
from slamreplay.report.assess import title_of
from slamreplay.report.facts import Fact, deciding_facts
from slamreplay.report.phrases import seconds, span
from slamreplay.verdict.judgement import State
from slamreplay.verdict.words import square_metres

Tone = Literal["good", "bad", "doubt", "plain", "quiet"]

#: Stretches, stops and findings that one line names; the others are counted.
_NAMED = 3
_STATE_TONES: dict[State, Tone] = {
    "healthy": "good",
    "lost": "bad",
    "lost_and_map_changed": "bad",
    "map_changed": "doubt",
    "unobservable": "doubt",
    "insufficient_data": "doubt",
}


@dataclass(frozen=True)
class SummaryLine:
    """One line: what it is about, what it says, and how that is to be taken.

    The text has no line breaks of its own, and may hold names from the log, as they are there.
    """

    label: str
    text: str
    tone: Tone = "plain"


def summary_lines(post: Postmortem) -> tuple[SummaryLine, ...]:
    """Verdict, sentence, the three facts, cause, times, changes, findings, and what is missing.

    The first line's label is the verdict's state, as in report.json. Always these ten lines, in
    this order, whatever the log.
    """
    judgement = post.judgement
    meaning, sure = meaning_of(judgement.state, has_belief=post.belief is not None), ""
    if judgement.confidence is not None:
        sure = f", confidence {confidence_text(judgement.confidence)}"
    tone = _STATE_TONES[judgement.state]
    belief, beams, hindsight = deciding_facts(post)
    return (
        SummaryLine(judgement.state, f"{meaning}{sure}", tone),
        SummaryLine("in short", judgement.summary),
        _fact("belief", belief),
        _fact("beams", beams),
        _fact("hindsight", hindsight),
        SummaryLine("cause", _cause(post)),
        SummaryLine("when", _when(post)),
        SummaryLine("map", _map(post)),
        _findings(post),
        _missing(post),
    )


def summary_text(post: Postmortem) -> str:
    """The same as plain text of one line each, to paste into a ticket."""
    return "\n".join(f"{line.label}: {line.text}" for line in summary_lines(post))


def _fact(label: str, fact: Fact) -> SummaryLine:
    """The number, and of its explanation the first sentence; that alone where there is none."""
    first = fact.detail.partition(". ")[0].rstrip(".")
    if not fact.is_known:
        return SummaryLine(label, f"{fact.number}: {first[:1].lower()}{first[1:]}", "doubt")
    text = f"{fact.number} {fact.label}; {first[:1].lower()}{first[1:]}"
    return SummaryLine(label, text, "bad" if fact.alarming else "plain")


def _cause(post: Postmortem) -> str:
    """How it began, and which single thing put back into healed evidence makes it happen again."""
    mode, cause = post.judgement.failure_mode, post.root_cause
    if cause is not None and cause.trials:
        mostly = FAILURE_MODES[cause.began_as] if cause.began_as != "none" else "no single thing"
        likely = f"{mostly}, {confidence_text(cause.probability)}, by {cause.trials} replays"
        best = cause.candidates[0].text if cause.candidates else cause.reason
        if mode.kind not in (cause.began_as, "none"):
            likely = f"began as {FAILURE_MODES[mode.kind]}; root cause {likely}"
        return f"{likely}: {best}" if best else likely
    if mode.kind == "none":
        return "nothing failed" if post.judgement.state == "healthy" else "not known"
    sure = "" if mode.confidence is None else f", {confidence_text(mode.confidence)}"
    why = f": {mode.evidence[0]}" if mode.evidence else ""
    return f"{FAILURE_MODES[mode.kind]}{sure}{why}"


def _when(post: Postmortem) -> str:
    """Every stretch that was not healthy, by state, then stops and grave jumps of the log's own."""
    origin, parts = post.manifest.start_ns, []
    for state in dict.fromkeys(i.state for i in post.judgement.intervals):
        spans = [i for i in post.judgement.intervals if i.state == state]
        if state != "healthy":
            times = [span(post, i.start_ns, i.end_ns) for i in spans]
            parts.append(f"{STATES[state].name[:1].lower()}{STATES[state].name[1:]} {_few(times)}")
    stops = [seconds(stop.t_ns - origin) for stop in post.judgement.stops]
    parts += [f"stopped at {_few(stops)}"] if stops else []
    jumps = sorted(set(_jump_times(post)))
    parts += [f"jumped at {_few([seconds(t - origin) for t in jumps])}"] if jumps else []
    whole = seconds(post.manifest.end_ns - origin)
    return f"{'; '.join(parts) or 'healthy throughout'} (of {whole})"


def _jump_times(post: Postmortem) -> Iterator[int]:
    recorded = {run.trial for run in post.recorded}
    for trial, found in post.jumps:
        if trial in recorded:
            yield from (jump.step.t_ns for jump in found if jump.step.is_grave)


def _map(post: Postmortem) -> str:
    if post.grid is None:
        return "none to hold it against"
    changes = None if post.hindsight is None else post.hindsight.changes
    if changes is None:
        return "not compared: without hindsight beams cannot be cast again"
    if not changes.regions:
        return "nothing of it changed that this log saw"
    largest = max(changes.regions, key=lambda region: region.area_m2)
    x = (largest.bbox_m[0] + largest.bbox_m[2]) / 2
    y = (largest.bbox_m[1] + largest.bbox_m[3]) / 2
    since = (largest.first_seen_ns - post.manifest.start_ns) / NS_PER_S
    one = f"{largest.kind} at x {x:.1f} m, y {y:.1f} m, first seen at {since:.1f} s"
    if len(changes.regions) == 1:
        return f"1 region of {square_metres(largest.area_m2)} {one}"
    area = square_metres(sum(region.area_m2 for region in changes.regions))
    return (
        f"{len(changes.regions)} regions, {area} in all; the largest, "
        f"{square_metres(largest.area_m2)}, {one}"
    )


def _findings(post: Postmortem) -> SummaryLine:
    """How many of each severity; by id and title those that are worse than information."""
    counts = {s: sum(f.severity == s for f in post.findings) for s in reversed(SEVERITIES)}
    told = ", ".join(f"{n} {s}{'s' * (s != 'info' and n != 1)}" for s, n in counts.items())
    worst = sorted(
        (f for f in post.findings if f.severity != "info"),
        key=lambda f: -SEVERITIES.index(f.severity),
    )
    names = list(dict.fromkeys(f"{f.id} {title_of(f.id)}" for f in worst))
    tone: Tone = "bad" if counts["error"] else "doubt" if counts["warning"] else "plain"
    return SummaryLine("findings", f"{told}{': ' if names else ''}{_few(names, '; ')}", tone)


def _missing(post: Postmortem) -> SummaryLine:
    parts = post.manifest.missing_parts()
    told = ", ".join(parts) if parts else "none of the eight parts"
    lacking = post.judgement.lacking
    return SummaryLine("missing", "; ".join((told, *lacking)), "quiet" if not parts else "plain")


def _few(texts: list[str], between: str = ", ") -> str:
    more = len(texts) - _NAMED
    return between.join(texts[:_NAMED]) + (f" and {more} more" if more > 0 else "")
