"""The answer as tables, sentences and a picture."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from slamreplay.labs.covariance_breathing.cases import DOF, Case, Chained
from slamreplay.labs.covariance_breathing.corridor import Corridor
from slamreplay.labs.covariance_breathing.rules import Rules
from slamreplay.labs.lab import LabResults, ResultTable
from slamreplay.report.figures.breathing import Belief, Claim, Panel, breathing_figure

#: Values of process noise that the picture has room for.
_COLUMNS = 3
_SIGMA = "\N{GREEK SMALL LETTER SIGMA}"

_HEAD = (
    "range updates",
    "Q [m2/step]",
    "sigma along [m]",
    "true error along [m]",
    "sigma across [m]",
    "ANEES",
    "along",
    "across",
    "closure",
    "belief",
)
_BRIEF = (*_HEAD[:4], "along", "closure", "belief")


def results(corridor: Corridor, cases: Sequence[Case], rules: Rules, runs: int) -> LabResults:
    """What all cases say together."""
    honest = [case for case in cases if case.told == case.true]
    fooled = [case for case in cases if case.told != case.true]
    numbers = {
        "runs": runs,
        "steps": corridor.steps,
        "cases": [case.numbers() for case in honest],
        "collapse": [case.numbers() for case in fooled],
    }
    tables = [
        ResultTable("Process noise as it is", _HEAD, [_row(case) for case in honest], brief=_BRIEF),
        ResultTable(
            "Process noise told too small",
            ("range updates", "Q told", "Q true", *_HEAD[2:6], "closure NIS", "belief"),
            [_fooled_row(case) for case in fooled],
            brief=("range updates", "Q told", "Q true", *_HEAD[2:4], "ANEES", "belief"),
        ),
    ]
    return LabResults(
        numbers=numbers,
        tables=tables,
        notes=_notes(cases[0], rules, runs),
        figures={"breathing": lambda: _figure(corridor, honest, fooled)},
    )


def _row(case: Case) -> tuple[str, ...]:
    words = case.words
    return (
        case.updates,
        f"{case.true:g}",
        *_pairs(case),
        words["along"],
        words["across"],
        words["closure"],
        words["belief"],
    )


def _fooled_row(case: Case) -> tuple[str, ...]:
    told = (case.updates, f"{case.told:g}", f"{case.true:g}")
    return (*told, *_pairs(case), _anees(case.closure_nis), case.words["belief"])


def _pairs(case: Case) -> tuple[str, ...]:
    """Sigma and true error along, sigma across and ANEES at the last pose, before -> after."""
    b, a = case.before, case.after
    return (
        _pair(b.sigma[-1, 0], a.sigma[-1, 0]),
        _pair(b.rms[-1, 0], a.rms[-1, 0]),
        _pair(b.sigma[-1, 1], a.sigma[-1, 1]),
        f"{_anees(b.anees[-1])} -> {_anees(a.anees[-1])}",
    )


def _pair(before: float, after: float) -> str:
    return f"{before:.3f} -> {after:.3f}"


def _anees(value: float) -> str:
    return f"{value:.2f}" if value < 10.0 else f"{value:.0f}"


def _notes(case: Case, rules: Rules, runs: int) -> list[str]:
    low, high = case.interval
    p, k = rules.interval_miss_probability, rules.collapsed_from_sigmas
    last, chain = rules.tight_to_ratio, rules.tight_to_chain_ratio
    return [
        (
            "Numbers are of the last pose, before the loop closure -> after it; a true error is "
            f"the root mean square over {runs} runs. The ellipses are of one run, the one whose "
            "NEES at the end of the way is the median."
        ),
        (
            "grows without bound: the largest sigma of the last quarter of the way is at least "
            f"{rules.grows_from_ratio:g} times that of the second quarter (a random walk: 1.41); "
            "else it stays bounded."
        ),
        (
            f"snaps tight: the closure leaves at most {last:g} of the last pose's sigma, and at "
            f"most {chain:g} of the whole chain's (root mean square, looking back both times); "
            "else it changes little."
        ),
        (
            f"consistent: the mean NEES of the last pose before the closure, {DOF} expected, lies "
            f"within {low:.2f} to {high:.2f}, which the mean of {runs} independent runs of a "
            f"consistent filter misses with probability {p:g}; below it the belief is "
            "underconfident, above it overconfident."
        ),
        (
            f"collapsed: above it, and sqrt(ANEES / {DOF}) is at least {k:g}: sigma is too small "
            "by that factor. The closure's NIS, squared innovation in its own covariance, has the "
            "same interval."
        ),
    ]


def _figure(corridor: Corridor, honest: Sequence[Case], fooled: Sequence[Case]) -> Figure:
    updates = list(dict.fromkeys(case.updates for case in honest))
    noises = list(dict.fromkeys(case.true for case in honest))
    last = len(noises) - 1
    shown = [noises[k] for k in dict.fromkeys((0, last // 2, last))][:_COLUMNS]
    by = {(case.updates, case.true): case for case in honest}
    # The silent failure is the one with measurements at hand that the filter hardly listens to.
    wrong = next((case for case in fooled if case.every_steps), fooled[0])
    return breathing_figure(
        corridor.truth(),
        corridor.width_m,
        [f"Range updates: {name}" for name in updates],
        [f"Q = {q:g} m² a step" for q in shown],
        [[_panel(corridor, by[name, q]) for q in shown] for name in updates],
        f"Told the true Q, and far too little; range updates: {wrong.updates}",
        [_claim(by[wrong.updates, wrong.true]), _claim(wrong)],
    )


def _panel(corridor: Corridor, case: Case) -> Panel:
    b, a = case.before, case.after
    note = (
        f"{case.words['along']}; {case.words['closure']} at the closure\n"
        f"at the end: {_SIGMA} {b.sigma[-1, 0]:.2f} → {a.sigma[-1, 0]:.2f} m, "
        f"error {b.rms[-1, 0]:.2f} → {a.rms[-1, 0]:.2f} m"
    )
    return Panel(_belief(corridor, b), _belief(corridor, a), note)


def _belief(corridor: Corridor, chain: Chained) -> Belief:
    return Belief(corridor.truth() + chain.typical, chain.P, chain.rms)


def _claim(case: Case) -> Claim:
    chain = case.before
    low, high = case.interval
    note = (
        f"Q told {case.told:g}, true {case.true:g} m² a step: {case.words['belief']}\n"
        f"at the end: {_SIGMA} {chain.sigma[-1, 0]:.2f} m, error {chain.rms[-1, 0]:.2f} m; "
        f"mean NEES {_anees(chain.anees[-1])} (chance: {low:.2f} to {high:.2f})"
    )
    return Claim(note, chain.sigma[:, 0], chain.errors[:, :, 0].T, chain.rms[:, 0])
