"""SR-CON-006: are innovations as large as the filter predicted them?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import bdtrc, chdtrc, chdtri

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.answers import Answer, Suspicion, about_mean
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.innovations.innovation_sets import InnovationSet, innovation_sets
from slamreplay.consistency.statistics.mean_test import MeanTest, mean_test
from slamreplay.consistency.statistics.truncation import SCALE_MAX

#: Off by this factor the gains are wrong enough to mislead; by less than the other one hardly
#: anybody would notice.
GROSS, SLIGHT = 2.0, 1.1
#: A gate that rejects this share works on a sensor that it should not, or on a lost filter.
MANY, MOST = 0.1, 0.5
#: A mean that is so much larger than the median says is made by few innovations.
_OUTLYING = 1.3


@dataclass(frozen=True, eq=False)
class NisTests:
    """The mean NIS of what one source's update used, of all axes together and of each alone.

    Attributes:
        joint: of the whole innovation.
        axes: of each component, against its own variance.
        two_sided: whether ones that are too small are told apart from ones that were cut off.
        median_ratio: what `joint.ratio` would be by the median, which outliers do not move.
    """

    joint: MeanTest
    axes: tuple[MeanTest, ...]
    two_sided: bool
    median_ratio: float

    @property
    def leading(self) -> MeanTest:
        """The test that is the least likely by chance."""
        return min((self.joint, *(self.axes if len(self.axes) > 1 else ())), key=self._p)

    @property
    def p_value(self) -> float:
        """That of the leading one, times the number of them (Bonferroni)."""
        asked = 1 + (len(self.axes) if len(self.axes) > 1 else 0)
        return min(1.0, asked * self._p(self.leading))

    def _p(self, test: MeanTest) -> float:
        p = test.p_value if self.two_sided else test.p_small
        return 1.0 if p is None else p


def nis_tests(seen: InnovationSet) -> NisTests:
    """Test the accepted innovations of a source for what its gate, where it has one, leaves."""
    kept, gate = seen.accepted, seen.gate
    white = seen.residual[kept] / seen.sigma[kept]
    axes = tuple(mean_test(white[:, [k]], gate) for k in range(white.shape[1]))
    median = float(np.median(seen.nis[kept])) if kept.any() else 0.0
    by_median = math.sqrt(median / float(chdtri(white.shape[1], 0.5)))
    return NisTests(mean_test(seen.white[kept], gate), axes, seen.gated_by_nis, by_median)


def check(context: CheckContext) -> tuple[Answer, ...]:
    """SR-CON-006 by source, or SR-CON-003 where there are too few innovations to tell."""
    answers: list[Answer] = []
    for seen in innovation_sets(context.innovations):
        tests = nis_tests(seen)
        answers.append(_size(seen, tests) if tests.joint.sufficient else _undecided(seen, tests))
        if not seen.accepted.all() and seen.gated_by_nis:
            answers.append(_rejected(seen))
    return tuple(answers)


def _size(seen: InnovationSet, tests: NisTests) -> Suspicion:
    test, joint = tests.leading, tests.joint
    which = f"the innovations of {seen.source}"
    if test is not joint:
        which = f"the {seen.axes[tests.axes.index(test)]} {which[4:]}"
    ratio = test.ratio or 0.0
    text = f"{which} {_sentence(ratio)}: {_numbers(test)}{_by_axis(seen, tests)}"
    text += f"{_outliers(tests)}{_left_out(seen)}"
    finding = about_mean("SR-CON-006", _severity(ratio), text, seen.t_ns, test)
    return Suspicion(finding, tests.p_value)


def _sentence(ratio: float) -> str:
    together = "its noise R and the process noise Q are together too"
    if ratio >= SCALE_MAX:
        return (
            f"are more than {SCALE_MAX:.0f} times as large as predicted: its noise R or the "
            "process noise Q is far too small"
        )
    if ratio >= 1.0:
        size = f"are {ratio:.2f} times as large as predicted"
        return f"{size}: {together} small by a factor of {ratio**2:.2g} (variance)"
    size = f"are only {ratio:.2f} times as large as predicted"
    return f"{size}: {together} large by a factor of {max(ratio, 1e-3) ** -2:.2g} (variance)"


def _numbers(test: MeanTest) -> str:
    return (
        f"mean NIS {test.mean:.3g} where {test.expected:.3g} is expected, 95 % of consistent ones "
        f"within {test.low:.3g} to {test.high:.3g}; {test.n} innovations are worth "
        f"{test.n_eff:.0f} independent ones"
    )


def _by_axis(seen: InnovationSet, tests: NisTests) -> str:
    if len(tests.axes) < 2:
        return ""
    alone = (f"{a} {t.ratio or 0.0:.2f}" for a, t in zip(seen.axes, tests.axes, strict=True))
    return f"; each axis alone: {', '.join(alone)}"


def _outliers(tests: NisTests) -> str:
    ratio, typical = tests.joint.ratio or 0.0, tests.median_ratio
    gated = tests.joint.gate is not None and not tests.joint.gate.is_none
    if gated or ratio < _OUTLYING * typical or ratio < SLIGHT:
        return ""
    return f"; outliers do it: the median innovation gives {typical:.2f}, a gate would stop them"


def _left_out(seen: InnovationSet) -> str:
    text = f"; {seen.invalid} without a sound covariance left out" if seen.invalid else ""
    rejected = int((~seen.accepted).sum())
    if not rejected:
        return text
    text += f"; {rejected} of {len(seen)} were rejected"
    if not seen.gated_by_nis:
        return f"{text}, by something else than their NIS: only larger ones than predicted count"
    return f"{text}, what the gate cuts off is allowed for"


def _severity(ratio: float) -> Severity:
    if ratio >= GROSS:
        return "error"
    return "info" if 1.0 / SLIGHT < ratio < SLIGHT else "warning"


def _rejected(seen: InnovationSet) -> Suspicion:
    """Are more innovations rejected than the gate rejects by chance?

    The gate is put as low as the log allows, which makes chance as large as it can be.
    """
    nis, n, m = seen.nis, len(seen), seen.white.shape[1]
    gate = nis[seen.accepted].max() if seen.accepted.any() else nis.min()
    chance, rejected = float(chdtrc(m, gate)), int((~seen.accepted).sum())
    share = rejected / n
    severity: Severity = "error" if share > MOST else "warning" if share > MANY else "info"
    finding = Finding(
        "SR-CON-006",
        severity,
        f"{100.0 * share:.3g} % of {n} innovations of {seen.source} were rejected where a gate at "
        f"a NIS of {gate:.3g} rejects {100.0 * chance:.2g} % by chance: outliers, or R or Q is far "
        "too small",
        start_ns=int(seen.t_ns[~seen.accepted][0]),
        end_ns=int(seen.t_ns[~seen.accepted][-1]),
        value=share,
        low=0.0,
        high=chance,
        unit="1",
        n=n,
    )
    return Suspicion(finding, float(bdtrc(rejected - 1, n, chance)) if rejected else 1.0)


def _undecided(seen: InnovationSet, tests: NisTests) -> Finding:
    n, n_eff = tests.joint.n, tests.joint.n_eff
    return Finding(
        "SR-CON-003",
        "info",
        f"too few innovations of {seen.source} to judge R and Q: {n} accepted are worth "
        f"{n_eff:.0f} independent ones{_left_out(seen)}",
        start_ns=int(seen.t_ns[0]) if len(seen) else None,
        end_ns=int(seen.t_ns[-1]) if len(seen) else None,
        n=n,
        n_eff=n_eff,
    )
