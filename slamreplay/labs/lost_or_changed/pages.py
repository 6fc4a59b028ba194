"""The answer as tables, sentences and a picture."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from slamreplay.labs.digits import four_digits
from slamreplay.labs.lab import LabResults, ResultTable
from slamreplay.labs.lost_or_changed.drive import FAR_START_M
from slamreplay.labs.lost_or_changed.parting import parting
from slamreplay.labs.lost_or_changed.trials import AFTERWARDS, FOR_S, OFF_M, ON_BOARD, Trial
from slamreplay.report.figures.lost_or_changed import Dose, Mark, lost_or_changed_figure

_TITLES = {
    "sigma_m": "on board: the covariance's sigma",
    "beams_off": "on board: share of beams off the map",
    "error_m": "afterwards: belief against hindsight",
    "changed_share": "afterwards: changed beams, cast from hindsight (few: lost)",
}
NAMES = {
    "": "nothing",
    "wrong_start_m": "wrong start [m]",
    "slip_s": "slip [s]",
    "carried_m": "carried [m]",
    "boxes": "boxes put down",
    "racks_removed": "racks removed",
    "racks_moved_m": "racks moved [m]",
    "boxes_and_wrong_start": f"boxes, and a start {FAR_START_M:g} m off",
}
_IS = {
    "lost": ("lost", "lost_and_map_changed"),
    "map_changed": ("map_changed", "lost_and_map_changed"),
}
#: Who says what state a trial is in.
_SAYS: dict[str, Callable[[Trial], str]] = {
    "verdict": lambda t: t.state,
    "truth": lambda t: t.true_state,
}
Bracket = list[float | None]


def results(trials: Sequence[Trial]) -> LabResults:
    """What all worlds say together."""
    areas = {
        name: parting(trials, name, low_is_lost=name == "changed_share")
        for name in (*ON_BOARD, *AFTERWARDS)
    }
    flips = {what: _flips(trials, what) for what in dict.fromkeys(t.what for t in trials) if what}
    right = sum(t.is_right for t in trials)
    numbers = {
        "logs": len(trials),
        "verdicts_right": right,
        "auc_lost_against_changed": {n: [_four(v) for v in area] for n, area in areas.items()},
        "flips": flips,
        "each": [_numbers(t) for t in trials],
    }
    tables = [
        ResultTable(
            "What parts lost moments from changed ones",
            ("measure", "AUC", "95 % interval"),
            [(_TITLES[name], *_told(area)) for name, area in areas.items()],
        ),
        ResultTable(
            "From how much on the verdict flips",
            ("what differs", "to", "verdict: between", "logs", "truth: between", "logs"),
            [row for what, found in flips.items() for row in _flip_rows(what, found)],
        ),
        ResultTable(
            "World by world",
            ("what differs", "level", *(_SHORT[n] for n in _SHORT), "verdict", "truth"),
            _world_rows(trials),
            brief=("what differs", "level", "verdict", "truth"),
        ),
    ]
    return LabResults(
        numbers=numbers,
        tables=tables,
        notes=_notes(right, len(trials)),
        figures={"lost_or_changed": lambda: _figure(trials, areas)},
    )


_SHORT = {
    "sigma_m": "sigma [m]",
    "beams_off": "beams off [%]",
    "error_m": "error [m]",
    "changed_share": "changed beams [%]",
}


def _flips(trials: Sequence[Trial], what: str) -> dict[str, dict[str, Bracket]]:
    """By state, by who says it: the levels between which it flips, and how many logs did."""
    return {
        state: {who: _bracket(trials, what, says, on) for who, says in _SAYS.items()}
        for state, on in _IS.items()
    }


def _bracket(
    trials: Sequence[Trial], what: str, says: Callable[[Trial], str], on: Sequence[str]
) -> Bracket:
    """Over the logs: the least last level that did not flip, the greatest first one that did, n.

    Args:
        trials: of all worlds.
        what: the difference.
        says: the state of a trial.
        on: states that count as flipped.
    """
    last, first = [], []
    for log in sorted({t.log for t in trials}):
        course = sorted((t for t in trials if t.log == log and t.what in ("", what)),
                        key=lambda t: t.level)  # fmt: skip
        said = [says(t) in on for t in course]
        if any(said):
            k = said.index(True)
            first.append(course[k].level)
            last.append(course[max(k - 1, 0)].level)
    if not first:
        return [None, None, 0]
    return [_four(min(last)), _four(max(first)), len(first)]


def _flip_rows(what: str, found: Mapping[str, Mapping[str, Bracket]]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for state, said in found.items():
        if not (said["verdict"][2] or said["truth"][2]):
            continue
        cells = [_between(said[who]) for who in ("verdict", "truth")]
        rows.append((NAMES[what], state, *cells[0], *cells[1]))
    return rows


def _between(bracket: Bracket) -> tuple[str, str]:
    low, high, n = bracket
    return ("never" if low is None else f"{low:g} and {high:g}"), f"{n:g}"


def _world_rows(trials: Sequence[Trial]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for what, level in dict.fromkeys((t.what, t.level) for t in trials):
        every = [t for t in trials if (t.what, t.level) == (what, level)]
        cells = [_span([t.held(n) for t in every], n) for n in _SHORT]
        rows.append((NAMES[what], f"{level:g}" if what else "", *cells,
                     _counted([t.state for t in every]),
                     _counted([t.true_state for t in every])))  # fmt: skip
    return rows


def _span(values: Sequence[float], name: str) -> str:
    factor, digits = (1.0, 2) if name.endswith("_m") else (100.0, 0)
    low, high = f"{factor * min(values):.{digits}f}", f"{factor * max(values):.{digits}f}"
    return low if low == high else f"{low} to {high}"


def _counted(states: Sequence[str]) -> str:
    counts = Counter(states)
    return ", ".join(f"{n} {state}" for state, n in counts.most_common())


def _numbers(t: Trial) -> dict[str, Any]:
    held = {f"{name}_held": _four(t.held(name)) for name in t.measures}
    return {
        "differs": t.what or "nothing",
        "level": t.level,
        "log": t.log,
        "verdict": t.state,
        "truth": t.true_state,
        "lost_s": _four(t.lost_s),
        "changed_s": _four(t.changed_s),
        **held,
    }


def _notes(right: int, n: int) -> list[str]:
    return [
        f"The verdict is the true one in {right} of {n} logs.",
        (
            "AUC: how often a lost moment has the larger value than a changed one; 0.5 is chance. "
            "Its interval is a bootstrap's over the logs."
        ),
        (
            f"sigma, beams off, error and changed beams: what was exceeded for {FOR_S:g} s in all, "
            "which is how long the verdict asks for; least and most over the logs. A beam is off "
            f"that ends more than {OFF_M:g} m from where the map has it, seen from the belief."
        ),
        (
            "between: over the logs, the least level that did not flip the state yet and the "
            "greatest that first did."
        ),
    ]


def _told(area: Sequence[float | None]) -> tuple[str, str]:
    value, low, high = area
    if value is None or low is None or high is None:
        return "-", "-"
    return f"{value:.3f}", f"{low:.3f} to {high:.3f}"


def _four(value: float | None) -> float | None:
    return None if value is None else four_digits(value)


def _figure(trials: Sequence[Trial], areas: Mapping[str, Sequence[float | None]]) -> Figure:
    marks = [Mark(t.true_state, t.state, {n: t.held(n) for n in t.measures}) for t in trials]
    doses = [
        Dose(NAMES[what], [(t.level, t.lost_s, t.changed_s) for t in trials if t.what == what])
        for what in dict.fromkeys(t.what for t in trials)
        if what
    ]
    return lost_or_changed_figure(marks, doses, {n: area[0] for n, area in areas.items()}, FOR_S)
