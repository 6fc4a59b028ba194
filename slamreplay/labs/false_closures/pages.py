"""The answer as tables, sentences and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from slamreplay.labs.digits import four_digits
from slamreplay.labs.false_closures.trials import FALSE_M, FALSE_RAD, Trial
from slamreplay.labs.intervals import share_interval
from slamreplay.labs.lab import LabResults, ResultTable
from slamreplay.report.figures.false_closures import Curve, Panel, false_closures_figure
from slamreplay.simulate.worlds import World

_HEAD = (
    "min_score",
    "closures taken",
    "of them false",
    "left on by the kernel",
    "logs with a false one",
    "largest error [m]",
    "with the kernel [m]",
)
_VANISH = ("corridor", "closures", "none false from min_score", "at the textbook's score",
           "best score of a false place", "kernel holds the error to [m]")  # fmt: skip


class Key(NamedTuple):
    """What was closed, and how."""

    corridor: str
    is_checked: bool
    has_kernel: bool
    min_score: float


def results(
    found: Mapping[Key, Sequence[Trial]],
    ends: Mapping[str, Sequence[float]],
    worlds: Mapping[str, World],
    textbook: float,
) -> LabResults:
    """What all logs say together."""
    cases = [(corridor, checked) for corridor in worlds for checked in (False, True)]
    scores = sorted({key.min_score for key in found})
    logs = len(next(iter(found.values())))
    verdicts = {case: _verdict(found, *case, scores, textbook) for case in cases}
    tables = [ResultTable(f"Where false closures vanish, {logs} logs of each corridor", _VANISH,
                          [_vanish_row(*case, verdicts[case]) for case in cases])]  # fmt: skip
    tables += [
        ResultTable(
            f"{corridor} corridor, {_way(checked)}",
            _HEAD,
            [_row(found, corridor, checked, score) for score in scores],
        )
        for corridor, checked in cases
    ]
    numbers = {
        "logs": logs,
        "odometry_end_error_m": {k: [four_digits(v) for v in sorted(e)] for k, e in ends.items()},
        "verdicts": [
            {"corridor": corridor, "checked": checked, **verdicts[corridor, checked]}
            for corridor, checked in cases
        ],
        "cases": [{**key._asdict(), **_summary(trials)} for key, trials in found.items()],
    }
    return LabResults(
        numbers=numbers,
        tables=tables,
        notes=_notes(textbook),
        figures={"false_closures": lambda: _figure(found, worlds, scores, textbook)},
    )


def _summary(trials: Sequence[Trial]) -> dict[str, Any]:
    hit = sum(t.false > 0 for t in trials)
    return {
        "taken": sum(t.taken for t in trials),
        "false": sum(t.false for t in trials),
        "left_on": sum(t.left_on for t in trials),
        "logs_with_false": hit,
        "logs_with_false_share": [four_digits(v) for v in share_interval(hit, len(trials))],
        "best_false_score": four_digits(max(t.best_false for t in trials)),
        "median_error_m": four_digits(float(np.median([t.median_m for t in trials]))),
        "largest_error_m": [four_digits(v) for v in _spread(trials)],
        "end_error_m": four_digits(float(np.median([t.end_m for t in trials]))),
    }


def _spread(trials: Sequence[Trial]) -> tuple[float, float, float]:
    """Least, median and most over the logs of the largest error on the way."""
    values = [t.largest_m for t in trials]
    return min(values), float(np.median(values)), max(values)


def _verdict(
    found: Mapping[Key, Sequence[Trial]],
    corridor: str,
    checked: bool,
    scores: Sequence[float],
    textbook: float,
) -> dict[str, Any]:
    """From which score on no log has a false closure, and what the kernel leaves of the error."""
    of = {s: found[Key(corridor, checked, has_kernel=False, min_score=s)] for s in scores}
    clean = [s for s in scores if not any(t.false for u in scores if u >= s for t in of[u])]
    kernel = [
        t.largest_m
        for s in scores
        for t in found[Key(corridor, checked, has_kernel=True, min_score=s)]
    ]
    every = [t for s in scores for t in of[s]]
    return {
        "none_false_from": clean[0] if clean else None,
        "false_at_textbook": sum(t.false for t in of[textbook]),
        "logs_with_false_at_textbook": sum(t.false > 0 for t in of[textbook]),
        "best_false_score": four_digits(max(t.best_false for t in every)),
        "largest_error_with_kernel_m": four_digits(max(kernel)),
        "largest_error_m": four_digits(max(t.largest_m for t in every)),
    }


def _vanish_row(corridor: str, checked: bool, verdict: Mapping[str, Any]) -> tuple[str, ...]:
    clean = verdict["none_false_from"]
    held = f"{verdict['false_at_textbook']} in {verdict['logs_with_false_at_textbook']} logs"
    return (
        corridor,
        _way(checked),
        "nowhere" if clean is None else f"{clean:.2f}",
        held,
        f"{verdict['best_false_score']:.2f}",
        f"{verdict['largest_error_with_kernel_m']:.2f} of {verdict['largest_error_m']:.2f}",
    )


def _row(
    found: Mapping[Key, Sequence[Trial]],
    corridor: str,
    checked: bool,
    score: float,
) -> tuple[str, ...]:
    bare, held = (
        _summary(found[Key(corridor, checked, kernel, score)]) for kernel in (False, True)
    )
    low, middle, high = bare["largest_error_m"]
    kernel = held["largest_error_m"]
    return (
        f"{score:.2f}",
        str(bare["taken"]),
        str(bare["false"]),
        str(held["left_on"]),
        str(bare["logs_with_false"]),
        f"{middle:.3f} ({low:.3f} to {high:.3f})",
        f"{kernel[1]:.3f} ({kernel[0]:.3f} to {kernel[2]:.3f})",
    )


def _way(checked: bool) -> str:
    return "checked" if checked else "by the score alone"


def _notes(textbook: float) -> list[str]:
    return [
        (
            f"A closure is false where it puts the robot more than {FALSE_M:g} m or "
            f"{np.degrees(FALSE_RAD):.0f} deg from where it was, seen from the old place's truth."
        ),
        (
            "By the score alone: a window of 7 m to either side is searched and the best place is "
            "taken from min_score on. Checked: the window comes from the graph's own covariance, "
            "the closure must agree with it, and where it is not sure others must say the same."
        ),
        (
            "Largest error: of the position on the way, the first pose laid on the truth; median "
            f"over the logs, least to most. The textbook's score is {textbook:g}."
        ),
    ]


def _figure(
    found: Mapping[Key, Sequence[Trial]],
    worlds: Mapping[str, World],
    scores: Sequence[float],
    textbook: float,
) -> Figure:
    panels = []
    for corridor, world in worlds.items():
        curves = []
        for checked in (False, True):
            for kernel in (False, True):
                of = [found[Key(corridor, checked, kernel, s)] for s in scores]
                curves.append(
                    Curve(
                        f"{_way(checked)}, {'with' if kernel else 'no'} kernel",
                        [float(np.mean([t.false for t in trials])) for trials in of],
                        [_spread(trials) for trials in of],
                    )
                )
        shown = found[Key(corridor, is_checked=False, has_kernel=False, min_score=textbook)]
        pairs = [(t.false_from, t.false_to) for t in shown]
        panels.append(
            Panel(
                f"{corridor} corridor",
                [solid.corners for solid in world.solids],
                np.concatenate([a for a, _ in pairs]),
                np.concatenate([b for _, b in pairs]),
                curves,
            )
        )
    return false_closures_figure(panels, scores, textbook)
