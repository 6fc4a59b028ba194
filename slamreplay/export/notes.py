"""What was found, as lines of a log: the verdict first, then everything at its own moment."""

from __future__ import annotations

from dataclasses import dataclass

from slamreplay.bundle.findings import Severity
from slamreplay.evidence.clean import clean
from slamreplay.evidence.scene import MarkKind
from slamreplay.evidence.words import FAILURE_MODES, STATES, confidence_text
from slamreplay.export.shown import Shown
from slamreplay.verdict.judgement import UNDECIDED
from slamreplay.version import __version__

#: Marks of these kinds are told as states, stops or findings already.
_TOLD: tuple[MarkKind, ...] = ("lost", "map_changed", "stop", "finding")


@dataclass(frozen=True)
class Note:
    """One line; `source` says what kind it is of: verdict, state, stop, jump or a finding's id."""

    t_ns: int
    severity: Severity
    source: str
    text: str


def notes(shown: Shown) -> list[Note]:
    """Every line in the window by time; what began before it is told at its start."""
    found = [*_verdict(shown), *_states(shown)]
    for number, stop in enumerate(shown.post.judgement.stops, start=1):
        severity: Severity = "info" if stop.state == "healthy" else "warning"
        found.append(Note(stop.t_ns, severity, "stop", f"stop {number}: {stop.cause}"))
    for finding in shown.post.findings:
        start_ns = shown.start_ns if finding.start_ns is None else finding.start_ns
        end_ns = start_ns if finding.end_ns is None else finding.end_ns
        if start_ns < shown.start_ns <= end_ns:
            start_ns = shown.start_ns
        found.append(Note(start_ns, finding.severity, finding.id, finding.message))
    marks = () if shown.scene is None else shown.scene.marks
    found += [Note(m.t_ns, m.severity, m.kind, m.title) for m in marks if m.kind not in _TOLD]
    kept = [note for note in found if shown.has(note.t_ns)]
    kept.sort(key=lambda note: note.t_ns)
    return [Note(n.t_ns, n.severity, n.source, clean(n.text)) for n in kept]


def verdict_facts(shown: Shown) -> dict[str, str]:
    """The verdict and what it is of, by name."""
    judgement = shown.post.judgement
    confidence = judgement.confidence
    return {
        "slamreplay": __version__,
        "bundle_id": shown.post.manifest.bundle_id,
        "state": judgement.state,
        "confidence": "" if confidence is None else f"{confidence:.4f}",
        "summary": clean(judgement.summary),
        "failure_mode": judgement.failure_mode.kind,
        "start_ns": str(shown.start_ns),
        "end_ns": str(shown.end_ns),
        "map_frame": shown.frame_id,
    }


def _verdict(shown: Shown) -> list[Note]:
    judgement = shown.post.judgement
    severity: Severity = "info" if judgement.state == "healthy" else "error"
    if judgement.state in UNDECIDED:
        severity = "warning"
    confidence = judgement.confidence
    sure = "" if confidence is None else f" (confidence {confidence_text(confidence)})"
    found = [f"{STATES[judgement.state].name}{sure}: {judgement.summary}"]
    if judgement.failure_mode.kind != "none":
        found.append(f"failure mode: {FAILURE_MODES[judgement.failure_mode.kind]}")
    return [Note(shown.start_ns, severity, "verdict", words) for words in found]


def _states(shown: Shown) -> list[Note]:
    """Where a state begins; a log of one healthy state has nothing to tell."""
    if len(shown.states) < 2:
        return []
    return [
        Note(
            state.start_ns,
            "error" if state.is_lost else "warning" if state.is_changed else "info",
            "state",
            f"{STATES[state.state].name}: {STATES[state.state].meaning}",
        )
        for state in shown.states
    ]
