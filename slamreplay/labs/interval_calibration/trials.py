"""Mean tests of errors whose memory and size are known, counted."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from slamreplay.consistency.answers import P_ACCUSE
from slamreplay.consistency.statistics.intervals import mean_interval
from slamreplay.consistency.statistics.mean_test import NOMINAL, mean_test
from slamreplay.geometry.se2 import Array
from slamreplay.labs.intervals import share_interval


@dataclass(frozen=True)
class Cell:
    """Many logs of one kind.

    Attributes:
        memory: how errors follow each other, in words.
        dof: components of each error.
        n_eff: independent samples that the squares of one log are worth; None where it is not one
            number that can be written down.
        rho: correlation of one error with the next, of AR(1) errors.
        ratio: how many times too small sigma is told; 1 is consistent.
        rows: of each log.
        logs: how many there were.
        missed: of them outside of the nominal 95 % interval, where something was decided.
        accused: of them at p < 0.001.
        undecided: insufficient.
        naive: outside of the textbook's interval, which counts every row as independent.
        estimated: median of the effective samples as estimated.
    """

    memory: str
    dof: int
    n_eff: int | None
    rho: float | None
    ratio: float
    rows: int
    logs: int
    missed: int
    accused: int
    undecided: int
    naive: int
    estimated: float

    def numbers(self) -> dict[str, float | int | str | None]:
        """For results.json: shares, with a 95 % interval of what was missed."""
        low, high = share_interval(self.missed, self.logs)
        return {
            "memory": self.memory,
            "dof": self.dof,
            "n_eff": self.n_eff,
            "rho": self.rho,
            "sigma_too_small_by": self.ratio,
            "rows": self.rows,
            "logs": self.logs,
            "outside_95": self.missed / self.logs,
            "outside_95_low": low,
            "outside_95_high": high,
            "accused_at_0.001": self.accused / self.logs,
            "insufficient": self.undecided / self.logs,
            "outside_95_textbook": self.naive / self.logs,
            "n_eff_estimated": self.estimated,
        }


def rows_for(n_eff: float, rho: float) -> int:
    """Rows of an AR(1) log worth `n_eff`: T (1 - rho^2) / (1 + rho^2) independent squares."""
    return round(n_eff * (1.0 + rho**2) / (1.0 - rho**2))


def autoregressive(
    dof: int, n_eff: int, rho: float, ratio: float, logs: int, rng: np.random.Generator
) -> Cell:
    """AR(1) errors whose sigma is told `ratio` times too small."""
    rows = rows_for(n_eff, rho)
    errors = (ratio * remembering(rng, rows, rho, dof) for _ in range(logs))
    return _count("AR(1)", dof, n_eff, rho, ratio, rows, errors)


def harder(name: str, rows: int, logs: int, rng: np.random.Generator) -> Cell:
    """Consistent errors (rows, 3) with a memory of `HARDER` that is not one number."""
    errors = (HARDER[name](rng, rows) for _ in range(logs))
    return _count(name, 3, None, None, 1.0, rows, errors)


def _slow_under_white(rng: np.random.Generator, rows: int) -> Array:
    slow, white = remembering(rng, rows, 0.99, 3), rng.standard_normal((rows, 3))
    return np.asarray(np.sqrt(0.4) * slow + np.sqrt(0.6) * white)


def _each_its_own(rng: np.random.Generator, rows: int) -> Array:
    return np.hstack([remembering(rng, rows, rho, 1) for rho in (0.98, 0.6, 0.0)])


def _turning(rng: np.random.Generator, rows: int) -> Array:
    """Of a robot that errs ahead and to the left while it turns by 0.3 rad a row."""
    errors, turn = remembering(rng, rows, 0.97, 3), 0.3 * np.arange(rows)
    x, y = errors[:, 0].copy(), errors[:, 1].copy()
    errors[:, 0] = np.cos(turn) * x - np.sin(turn) * y
    errors[:, 1] = np.sin(turn) * x + np.cos(turn) * y
    return errors


HARDER: dict[str, Callable[[np.random.Generator, int], Array]] = {
    "slow error under white noise": _slow_under_white,
    "each axis a memory of its own": _each_its_own,
    "error turns with the robot": _turning,
}


def _count(
    memory: str,
    dof: int,
    n_eff: int | None,
    rho: float | None,
    ratio: float,
    rows: int,
    logs: Iterable[Array],
) -> Cell:
    low, high = mean_interval(dof, rows, NOMINAL)
    tests = [mean_test(white) for white in logs]
    decided = [t for t in tests if t.sufficient]
    return Cell(
        memory,
        dof,
        n_eff,
        rho,
        ratio,
        rows,
        len(tests),
        missed=sum(t.p_value is not None and t.p_value < NOMINAL for t in decided),
        accused=sum(t.p_value is not None and t.p_value < P_ACCUSE for t in decided),
        undecided=len(tests) - len(decided),
        naive=sum(t.mean is not None and not low <= t.mean <= high for t in tests),
        estimated=float(np.median([t.n_eff for t in tests])),
    )


def remembering(rng: np.random.Generator, rows: int, rho: float, dof: int) -> Array:
    """(rows, dof) stationary AR(1) errors of unit variance."""
    noise = rng.standard_normal((rows, dof))
    noise[1:] *= np.sqrt(1.0 - rho**2)
    return np.asarray(lfilter([1.0], [1.0, -rho], noise, axis=0))
