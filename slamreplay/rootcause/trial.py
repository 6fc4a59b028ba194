"""One thing put back into healed evidence."""

from __future__ import annotations

from dataclasses import dataclass

from slamreplay.geometry import se2
from slamreplay.rootcause.replays import Evidence
from slamreplay.verdict.judgement import FailureKind


@dataclass(frozen=True, eq=False)
class Trial:
    """What is tried.

    Attributes:
        name: `NAME.VARIANT` of the perturbation it stands for, empty where none does.
        kind: the failure mode it would make.
        level: how much of it, in `unit`; None where it has no size.
        unit: of the level.
        row: from when on it acts, None for all along.
        words: what was put back, as the beginning of a sentence.
        evidence: with it in; None where the belief follows without a filter.
        belief: (N, 3) that belief, which chance has no part in.
        late_ns: by how much later than measured scans are stamped with it in: what the filter said
            that much earlier was about the moment of the scan.
        log_dose: log odds of such a dose with the fault against without it, where that is known.
        seeds: replays of it, where chance decides what becomes of it.
    """

    name: str
    kind: FailureKind
    level: float | None
    unit: str
    row: int | None
    words: str
    evidence: Evidence | None = None
    belief: se2.Array | None = None
    late_ns: int = 0
    log_dose: float = 0.0
    seeds: int = 3
