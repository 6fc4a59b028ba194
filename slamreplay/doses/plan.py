"""What a design asks: doses of perturbations, over seeds, against limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from slamreplay.errors import UsageError
from slamreplay.perturb import PERTURBATIONS
from slamreplay.perturb.variant import check_level
from slamreplay.registry import nearest
from slamreplay.replay.dose import Limit

#: Trials of one design, counted as if nothing were shared: more is a slip of the pen.
MAX_TRIALS = 20_000
#: Levels that a search begins with.
LADDER = 5
#: Rounds in which one bracket may be halved.
MAX_HALVINGS = 12
#: From a last over a first level of this ratio on, a search goes by factors and not by steps.
_LOG_FROM = 10.0


@dataclass(frozen=True)
class Axis:
    """One perturbation and the levels that it is given, on one side of its baseline.

    Attributes:
        perturbation: `NAME.VARIANT`.
        unit: of the levels.
        baseline: the level that changes nothing.
        levels: by growing distance from the baseline, without it: all there are, or the ladder
            that a search begins with.
        tolerance: the search ends with a bracket no wider than this; None where only `levels` are
            tried.
        by_factor: whether a bracket is halved at its geometric mean.
    """

    perturbation: str
    unit: str
    baseline: float
    levels: tuple[float, ...]
    tolerance: float | None = None
    by_factor: bool = False

    @property
    def side(self) -> int:
        """1 where the levels are above the baseline, -1 below it."""
        return 1 if self.levels[-1] > self.baseline else -1

    def is_narrow(self, width: float) -> bool:
        """Whether a bracket of this width ends the search; every one does where none was asked."""
        # 0.2 to 0.3 is no wider than 0.1, whatever their binary digits say.
        return self.tolerance is None or width <= self.tolerance * (1.0 + 1e-9)

    @property
    def most_halvings(self) -> int:
        """Rounds after the first, at most."""
        steps = pairwise((self.baseline, *self.levels))
        widest, rounds = max(abs(b - a) for a, b in steps), 0
        while not self.is_narrow(widest) and rounds < MAX_HALVINGS:
            widest, rounds = widest / 2.0, rounds + 1
        return rounds

    @property
    def most_levels(self) -> int:
        """Levels that one seed may come to."""
        return len(self.levels) + self.most_halvings


@dataclass(frozen=True)
class Dose:
    """One level of one perturbation."""

    perturbation: str
    unit: str
    level: float


@dataclass(frozen=True)
class Plan:
    """A design on one log.

    Attributes:
        question: one sentence.
        seeds: of the trials; each is paired with the baseline of the same seed.
        estimators: names in the registry.
        limits: what counts as broken; the first is the one that is searched for.
        axes: the perturbations.
        positive_control: known to break every estimator; None takes the first that an estimator
            can be given of those in `doses.controls`.
    """

    question: str
    seeds: tuple[int, ...]
    estimators: tuple[str, ...]
    limits: tuple[Limit, ...]
    axes: tuple[Axis, ...]
    positive_control: Dose | None = None

    @property
    def most_trials(self) -> int:
        """Trials at most: baselines, doses and controls."""
        doses = sum(axis.most_levels for axis in self.axes)
        each = (1 + doses) * len(self.seeds) + len(self.axes) + 1
        return len(self.estimators) * each


def of_levels(name: str, levels: Sequence[float]) -> Axis:
    """The axis of levels that are given one by one, in any order.

    Args:
        name: `NAME[.VARIANT]`; a bare name means its first variant.
        levels: in the variant's unit, at least one.

    Raises:
        UsageError: no such perturbation; a level out of its range, given twice, on the other side
            of the baseline, or the baseline itself.
    """
    name, unit, baseline = variant_of(name, levels)
    if len(set(levels)) != len(levels):
        raise UsageError(f"a level of {name} is given twice")
    if baseline in levels:
        raise UsageError(
            f"level {baseline:g} of {name} is its baseline, which every design runs anyway"
        )
    if len({level > baseline for level in levels}) > 1:
        raise UsageError(
            f"levels of {name} lie on both sides of its baseline {baseline:g} {unit}",
            hint="give it twice, once for each side",
        )
    return Axis(name, unit, baseline, tuple(sorted(levels, key=lambda v: abs(v - baseline))))


def of_search(name: str, first: float, last: float, tolerance: float) -> Axis:
    """The axis of a search from one level to another, farther from the baseline.

    It goes by factors where both differ from the baseline, the last one by ten times as much or
    more; by equal steps otherwise.

    Args:
        name: as of `of_levels`.
        first: where it begins: the baseline, or a level that may hold.
        last: the end of the range.
        tolerance: width of the bracket it ends with, in the unit.

    Raises:
        UsageError: no such perturbation, a range out of the variant's, one that does not lead away
            from the baseline, or a tolerance that takes too many rounds.
    """
    name, unit, baseline = variant_of(name, (first, last))
    near, far = first - baseline, last - baseline
    if near * far < 0.0 or abs(far) <= abs(near):
        raise UsageError(
            f"the search of {name} does not lead away from its baseline {baseline:g} {unit}",
            hint="'to' lies farther from it than 'from', on the same side",
        )
    by_factor = near != 0.0 and far / near >= _LOG_FROM
    shares = [k / (LADDER - 1 if near else LADDER) for k in range(LADDER + (not near))]
    offsets = [near * (far / near) ** s if by_factor else near + s * (far - near) for s in shares]
    levels = tuple(float(f"{baseline + offset:.3g}") for offset in offsets if offset != 0.0)
    levels = (first, *levels[1:-1], last) if near else (*levels[:-1], last)
    axis = Axis(name, unit, baseline, levels, tolerance, by_factor)
    widest = max(abs(b - a) for a, b in pairwise((baseline, *levels)))
    if widest / tolerance > 2.0**MAX_HALVINGS:
        raise UsageError(
            f"a tolerance of {tolerance:g} {unit} is too fine for the range of {name}",
            hint=f"{widest / 2**MAX_HALVINGS:.2g} is the least",
        )
    return axis


def variant_of(name: str, levels: Sequence[float]) -> tuple[str, str, float]:
    """Full name, unit and baseline of a variant that can take these levels.

    Raises:
        UsageError: it cannot, or there is none.
    """
    short, dot, variant = name.partition(".")
    found = PERTURBATIONS.load(short)
    variant = variant if dot else next(iter(found.variants))
    if variant not in found.variants:
        names = [f"{short}.{v}" for v in found.variants]
        raise UsageError(f"there is no perturbation '{name}'", hint=nearest(name, names))
    made = found.variants[variant]
    for level in levels:
        check_level(short, found.variants, variant, level)
    return f"{short}.{variant}", made.unit, made.baseline
