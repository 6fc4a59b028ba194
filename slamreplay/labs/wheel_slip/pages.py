"""The answer as tables, sentences and a picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from slamreplay.geometry.se2 import Array
from slamreplay.labs.digits import four_digits
from slamreplay.labs.lab import LabResults, ResultTable
from slamreplay.labs.wheel_slip.trials import SIGMAS, Course
from slamreplay.report.figures.wheel_slip import Panel, wheel_slip_figure
from slamreplay.simulate.worlds import warehouse

_HEAD = (
    "estimator",
    "sigma before the slip [m]",
    "at its end [m]",
    "at its widest [m]",
    "at the end [m]",
    "widest without slip [m]",
    "error at the slip's end [m]",
    "error at the end [m]",
    "within 3 sigma from the slip on",
)
#: A closure's effect is read so long before and after it, s.
_AROUND_S = 0.5


class Pair(NamedTuple):
    """One drive with the slip and without."""

    slipped: Course
    steady: Course


def results(
    pairs: Mapping[str, Sequence[Pair]], slip_s: tuple[float, float], xyyaw: Array, t_s: Array
) -> LabResults:
    """What all bags say together.

    Args:
        pairs: by estimator.
        slip_s: when the slip began and ended.
        xyyaw: (N, 3) the true way with the slip,
        t_s: (N,) and its times.
    """
    found = {name: _summary(every, slip_s) for name, every in pairs.items()}
    logs = len(next(iter(pairs.values())))
    tables = [
        ResultTable(
            f"Medians over {logs} bags (least to most)",
            _HEAD,
            [_row(name, numbers) for name, numbers in found.items()],
        )
    ]
    numbers = {
        "logs": logs,
        "slip_from_s": four_digits(slip_s[0]),
        "slip_to_s": four_digits(slip_s[1]),
        "estimators": found,
    }
    notes = [
        "sigma: standard deviation of the position along its widest axis.",
        (
            f"within {SIGMAS:g} sigma: share of the scans from the beginning of the slip on; at "
            "the end: of the log, after the robot has come round to where it began."
        ),
        "widest without slip: the same drive, the same noise, from the same moment on.",
    ]
    return LabResults(
        numbers=numbers,
        tables=tables,
        notes=notes,
        figures={"wheel_slip": lambda: _figure(pairs, slip_s, xyyaw, t_s)},
    )


def _summary(pairs: Sequence[Pair], slip_s: tuple[float, float]) -> dict[str, Any]:
    first, last = slip_s

    def over(value: Callable[[Pair], float]) -> list[float]:
        values = [value(pair) for pair in pairs]
        return [four_digits(v) for v in (float(np.median(values)), min(values), max(values))]

    out: dict[str, Any] = {
        "sigma_before_m": over(lambda p: p.slipped.sigma_at(first)),
        "sigma_after_m": over(lambda p: p.slipped.sigma_at(last)),
        "widest_m": over(lambda p: p.slipped.widest(first)[0]),
        "widest_at_s": over(lambda p: p.slipped.widest(first)[1]),
        "sigma_end_m": over(lambda p: float(p.slipped.sigma_m[-1])),
        "widest_steady_m": over(lambda p: p.steady.widest(first)[0]),
        "error_after_m": over(lambda p: p.slipped.error_at(last)),
        "largest_error_m": over(lambda p: float(p.slipped.error_m.max())),
        "error_end_m": over(lambda p: float(p.slipped.error_m[-1])),
        "within_3_sigma": over(lambda p: p.slipped.honest_share(first)),
    }
    closed = [p.slipped for p in pairs if p.slipped.closures_s]
    out["logs_closed"] = len(closed)
    if closed:
        out["first_closure_s"] = _spread([c.closures_s[0] for c in closed])
        out["sigma_before_closure_m"] = _spread(
            [c.sigma_at(c.closures_s[0] - _AROUND_S) for c in closed]
        )
        out["sigma_after_closure_m"] = _spread(
            [c.sigma_at(c.closures_s[0] + _AROUND_S) for c in closed]
        )
    return out


def _spread(values: Sequence[float]) -> list[float]:
    return [four_digits(v) for v in (float(np.median(values)), min(values), max(values))]


def _row(name: str, numbers: Mapping[str, Any]) -> tuple[str, ...]:
    keys = ("sigma_before_m", "sigma_after_m", "widest_m", "sigma_end_m", "widest_steady_m",
            "error_after_m", "error_end_m")  # fmt: skip
    within = " to ".join(f"{100.0 * v:.0f}" for v in numbers["within_3_sigma"][1:])
    return (name, *(_told(numbers[key]) for key in keys), f"{within} %")


def _told(values: Sequence[float]) -> str:
    middle, low, high = values
    digits = 2 if high >= 0.1 else 3
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def _figure(
    pairs: Mapping[str, Sequence[Pair]], slip_s: tuple[float, float], xyyaw: Array, t_s: Array
) -> Figure:
    panels = [
        Panel(
            name,
            every[0].slipped.t_s,
            np.array([p.slipped.error_m for p in every]),
            np.array([p.slipped.sigma_m for p in every]),
            every[0].steady.t_s,
            np.array([p.steady.sigma_m for p in every]),
            [t for p in every for t in p.slipped.closures_s],
        )
        for name, every in pairs.items()
    ]
    slips = (t_s >= slip_s[0]) & (t_s <= slip_s[1])
    solids = [solid.corners for solid in warehouse().solids]
    return wheel_slip_figure(panels, slip_s, solids, xyyaw, slips)
