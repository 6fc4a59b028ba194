"""What has no place in the map: the verdict, findings, states and lanes."""

from __future__ import annotations

import numpy as np
import rerun as rr

from slamreplay.bundle.findings import Severity
from slamreplay.evidence import colours
from slamreplay.evidence.scene import LaneKey
from slamreplay.evidence.words import FAILURE_MODES, STATES, confidence_text
from slamreplay.export.notes import notes, verdict_facts
from slamreplay.export.rerun.batches import rgba
from slamreplay.export.rerun.sink import Sink
from slamreplay.export.shown import Shown

_LEVEL: dict[Severity, str] = {
    "info": rr.TextLogLevel.INFO,
    "warning": rr.TextLogLevel.WARN,
    "error": rr.TextLogLevel.ERROR,
}
_COLOURS: dict[LaneKey, str] = {
    "error_m": colours.VERMILLION,
    "error_deg": colours.VERMILLION,
    "sigma_m": colours.SKY,
    "nees": colours.PURPLE,
    "changed_share": colours.ORANGE,
    "match": colours.GREEN,
}


def plot(shown: Shown, sink: Sink) -> None:
    """Everything that is told in words and numbers."""
    sink.always("verdict", rr.TextDocument(_verdict(shown), media_type=rr.MediaType.MARKDOWN))
    told = notes(shown)
    columns = rr.TextLog.columns(
        text=[f"{note.source}: {note.text}" for note in told],
        level=[_LEVEL[note.severity] for note in told],
    )
    sink.send("findings", [note.t_ns for note in told], columns)
    _states(shown, sink)
    for lane in shown.lanes:
        entity = f"lanes/{lane.key}"
        unit = f" [{lane.unit}]" if lane.unit else ""
        look = rr.SeriesLines(colors=[rgba(_COLOURS[lane.key])], names=[f"{lane.title}{unit}"])
        sink.always(entity, look)
        sink.send(entity, lane.t_ns, rr.Scalars.columns(scalars=lane.values))
        if lane.limit is not None and len(lane.t_ns):
            ends = lane.t_ns[[0, -1]]
            limit, grey = f"{entity}/limit", rgba(colours.GREY)
            sink.always(limit, rr.SeriesLines(colors=[grey], names=["limit"]))
            sink.send(limit, ends, rr.Scalars.columns(scalars=np.full(2, lane.limit)))


def _states(shown: Shown, sink: Sink) -> None:
    look = rr.StateConfiguration(
        values=list(colours.STATES),
        labels=[STATES[state].name for state in colours.STATES],
        colors=[rgba(colour) for colour in colours.STATES.values()],
    )
    sink.always("state", look)
    columns = rr.StateChange.columns(state=[state.state for state in shown.states])
    sink.send("state", [state.start_ns for state in shown.states], columns)


def _verdict(shown: Shown) -> str:
    facts, judgement = verdict_facts(shown), shown.post.judgement
    lines = [f"# {STATES[judgement.state].name}", "", facts["summary"], ""]
    if judgement.confidence is not None:
        lines.append(f"- confidence {confidence_text(judgement.confidence)}")
    lines.append(f"- failure mode: {FAILURE_MODES[judgement.failure_mode.kind]}")
    lines.append(f"- slamreplay {facts['slamreplay']}, bundle {facts['bundle_id']}")
    return "\n".join(lines)
