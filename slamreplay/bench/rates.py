"""Rates over logs, with intervals that treat a log as one draw: its moments are not independent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: Resamples of the bootstrap, and the share of them that an interval holds.
RESAMPLES, LEVEL = 400, 0.95


@dataclass(frozen=True)
class Rate:
    """A number and its interval; None where nothing was there to count."""

    value: float | None
    low: float | None = None
    high: float | None = None

    def as_json(self) -> list[float | None]:
        """value, low, high."""
        return [self.value, self.low, self.high]


def clustered(
    statistic: Callable[[NDArray[np.float64]], float], n_logs: int, seed: int = 0
) -> Rate:
    """A statistic and its percentile interval from a bootstrap over logs (Efron, 1979).

    Args:
        statistic: of weights (L,), how often each log counts; NaN where it has no value.
        n_logs: L.
        seed: of the resamples.
    """
    value = statistic(np.ones(n_logs)) if n_logs else float("nan")
    if not np.isfinite(value):
        return Rate(None)
    rng = np.random.Generator(np.random.PCG64(seed))
    draws = rng.multinomial(n_logs, np.full(n_logs, 1.0 / n_logs), size=RESAMPLES)
    found = np.array([statistic(w) for w in draws.astype(np.float64)])
    found = found[np.isfinite(found)]
    tail = (1.0 - LEVEL) / 2.0
    low, high = np.quantile(found, [tail, 1.0 - tail]) if len(found) else (value, value)
    return Rate(float(value), float(low), float(high))


def share(hits: NDArray, of: NDArray, seed: int = 0) -> Rate:
    """Sum of `hits` (L,) over sum of `of` (L,), both counted per log."""
    hits, of = np.asarray(hits, dtype=np.float64), np.asarray(of, dtype=np.float64)
    return clustered(lambda w: _ratio(float(w @ hits), float(w @ of)), len(hits), seed)


def f1(true: NDArray, false: NDArray, missed: NDArray, seed: int = 0) -> Rate:
    """2 TP / (2 TP + FP + FN) of counts per log (L,); no value where there is nothing to find."""
    t, f, m = (np.asarray(v, dtype=np.float64) for v in (true, false, missed))
    return clustered(
        lambda w: _f1(float(w @ t), float(w @ f), float(w @ m)),
        len(t),
        seed,
    )


def auc(
    scores: NDArray, positive: NDArray[np.bool_], log: NDArray[np.int64], n_logs: int, seed: int = 0
) -> Rate:
    """Area under the ROC curve: how often a positive moment scores above a negative one.

    Ties count half (Mann and Whitney, 1947). Moments without a score rank lowest.

    Args:
        scores: (M,) of the moments.
        positive: (M,) their class.
        log: (M,) the log each is from.
        n_logs: how many there are.
        seed: of the bootstrap.
    """
    values = np.where(np.isnan(scores), -np.inf, scores)
    _, rank = np.unique(values, return_inverse=True)
    size = int(rank.max(initial=-1)) + 1

    def of(weights: NDArray) -> float:
        w = weights[log]
        up = np.bincount(rank, w * positive, minlength=size)
        down = np.bincount(rank, w * ~positive, minlength=size)
        below = np.cumsum(down) - 0.5 * down
        return _ratio(float(up @ below), float(up.sum() * down.sum()))

    return clustered(of, n_logs, seed)


def best_f1(scores: NDArray, positive: NDArray[np.bool_]) -> tuple[float, float]:
    """The threshold on (M,) scores with the largest F1, and that F1: a bar no rule can be above."""
    values = np.where(np.isnan(scores), -np.inf, scores)
    order = np.argsort(-values, kind="stable")
    hits = np.cumsum(positive[order])
    last = np.append(values[order][1:] != values[order][:-1], True)
    told = np.arange(1, len(order) + 1)
    quality = np.where(last, 2.0 * hits / (told + max(int(positive.sum()), 1)), -1.0)
    if not len(quality):
        return float("nan"), float("nan")
    at = int(np.argmax(quality))
    return float(values[order][at]), float(quality[at])


def _f1(true: float, false: float, missed: float) -> float:
    return 2 * true / (2 * true + false + missed) if true + missed else float("nan")


def _ratio(a: float, b: float) -> float:
    return float(a / b) if b else float("nan")
