"""What was found, in words and numbers: findings, states, and lanes to be plotted."""

from __future__ import annotations

import math
from collections.abc import Iterator

from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import Message

from slamreplay.bundle.findings import Severity
from slamreplay.evidence.clean import clean
from slamreplay.evidence.scene import Lane
from slamreplay.export.foxglove import topics
from slamreplay.export.foxglove.own import message_type
from slamreplay.export.foxglove.parts import Stream, stamp
from slamreplay.export.notes import notes, verdict_facts
from slamreplay.export.shown import Shown
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.judgement import Interval

_LEVEL: dict[Severity, Log.Level.ValueType] = {
    "info": Log.INFO,
    "warning": Log.WARNING,
    "error": Log.ERROR,
}
#: Messages of states in a file, about.
_MOST_STATES = 20_000


def told(shown: Shown) -> Iterator[Stream]:
    """Streams of the verdict, of findings, states and lanes."""
    yield _verdict(shown)
    yield _notes(shown)
    yield _states(shown)
    for lane in shown.lanes:
        yield _lane(lane)


def _verdict(shown: Shown) -> Stream:
    """All in one message at the start: a list of log lines forgets what came before a jump."""
    judgement = shown.post.judgement
    message = message_type("Verdict")(
        timestamp=stamp(shown.start_ns),
        summary=verdict_facts(shown)["summary"],
        state=judgement.state,
        confidence=_or_nan(judgement.confidence),
        failure_mode=judgement.failure_mode.kind,
        findings=[
            clean(f"{finding.severity} {finding.id}: {finding.message}")
            for finding in shown.post.findings
        ],
    )
    yield shown.start_ns, topics.VERDICT, message


def _notes(shown: Shown) -> Stream:
    for note in notes(shown):
        message = Log(
            timestamp=stamp(note.t_ns),
            level=_LEVEL[note.severity],
            message=note.text,
            name=note.source,
        )
        yield note.t_ns, topics.FINDINGS, message


def _states(shown: Shown) -> Stream:
    """Each state at its start and every second on, the last one at its end, too.

    A plot knows only of the part of a file that its viewer has read. A clock that spans years has
    longer steps.
    """
    step_ns = max(NS_PER_S, (shown.end_ns - shown.start_ns) // _MOST_STATES)
    for state in shown.states:
        for t_ns in range(state.start_ns, state.end_ns, step_ns):
            yield t_ns, topics.STATE, _state(state, t_ns)
    if shown.states:
        yield shown.end_ns, topics.STATE, _state(shown.states[-1], shown.end_ns)


def _state(state: Interval, t_ns: int) -> Message:
    return message_type("State")(
        timestamp=stamp(t_ns),
        state=state.state,
        confidence=_or_nan(state.confidence),
        max_error_m=_or_nan(state.max_error_m),
        max_error_rad=_or_nan(state.max_error_rad),
        findings=state.findings,
    )


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def _lane(lane: Lane) -> Stream:
    number = message_type("Number")
    topic = topics.lane(lane.key)
    for t_ns, value in zip(lane.t_ns.tolist(), lane.values.tolist(), strict=True):
        yield t_ns, topic, number(timestamp=stamp(t_ns), value=value, unit=lane.unit)
