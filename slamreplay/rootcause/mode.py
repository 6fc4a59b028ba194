"""The failure mode that a report tells, where replays know more than the evidence by itself."""

from __future__ import annotations

from slamreplay.rootcause.result import RootCause
from slamreplay.verdict.judgement import FailureMode


def mode_of(cause: RootCause, read_off: FailureMode) -> FailureMode:
    """How it began by the replays, which took what was read off the evidence into account.

    Where the two differ the sentences say so, and why the replays are followed or are not.

    Args:
        cause: the answer.
        read_off: the verdict's own failure mode, without any replay.
    """
    if not cause.trials:
        return read_off
    best = next((one for one in cause.candidates if one.kind == cause.began_as), None)
    if cause.began_as == "none" or best is None:
        if read_off.kind == "none":
            return read_off
        text = "no single thing put back into healed evidence reproduces the loss"
        text += f" ({cause.reason})" if cause.reason else ""
        return FailureMode(read_off.kind, read_off.confidence, (*read_off.evidence, text))
    told = f"replayed: {best.text}"
    if cause.began_as == read_off.kind:
        return FailureMode(read_off.kind, cause.probability, (*read_off.evidence, told))
    kept = read_off.evidence
    if read_off.kind != "none":
        other = read_off.kind.replace("_", " ")
        kept = (f"without replays it looks like {other}: {'; '.join(read_off.evidence)}",)
    return FailureMode(cause.began_as, cause.probability, (told, *kept))
