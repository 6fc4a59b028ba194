"""How well settings predict a log's sightings: the likelihood of the prediction errors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.estimators.ekf import kernels
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.ekf.observations import Observations
from slamreplay.estimators.ekf.passing import Filtered
from slamreplay.geometry import se2

#: Share of sightings that are taken to mean nothing: a wrong name, a glimpse of something else.
OUTLIERS = 0.01


def log_densities(observations: Observations, done: Filtered, noise: Noise) -> se2.Array:
    """(M,) logarithm of the density of each sighting, predicted from all that came before it.

    Their sum is the log likelihood of the settings, by the prediction error decomposition: log
    N(residual; 0, S) for each (Harvey 1989, chapter 3; Hamilton 1994, chapter 13). Each density is
    mixed with a share of `OUTLIERS` of an even one, over all ranges up to the longest and over the
    circle. One that was rejected therefore costs what an outlier costs, however far off it is, and
    settings gain nothing by rejecting much; one that found no pose to be held against costs as
    much. The density is that of the range as it was measured: taking all ranges for shorter ones
    makes none of them more probable.

    Args:
        observations: the sightings.
        done: what the filter made of them,
        noise: with these settings.
    """
    longest = float(observations.sensed[:, 0].max(initial=1.0))
    even = -np.log(longest) - (observations.dims - 1) * np.log(2.0 * np.pi)
    fits = np.full(len(observations), -np.inf)
    for rows, m in groups(observations, done):
        L = np.linalg.cholesky(done.S[rows, :m, :m])
        white = np.linalg.solve(L, done.residual[rows, :m, None])[:, :, 0]
        spread = np.log(np.diagonal(L, axis1=1, axis2=2)).sum(axis=1)
        fits[rows] = -0.5 * np.sum(white**2, axis=1) - spread - 0.5 * m * np.log(2.0 * np.pi)
    fits -= np.log(observations.stretch(noise))
    near = observations.is_near  # a density of x and y, as one of range and bearing
    fits[near] += np.log(observations.sensed[near, 0])
    return np.logaddexp(np.log1p(-OUTLIERS) + fits, np.log(OUTLIERS) + even)


def score_vectors(
    observations: Observations, done: Filtered, others: list[Filtered], step: float
) -> se2.Array:
    """(P, K) vectors whose products are the information that sightings hold on P settings.

    For Gaussian prediction errors the information is the sum over sightings of
    dr' S^-1 dr + tr(S^-1 dS S^-1 dS) / 2 (Harvey 1989, chapter 3); derivatives are differences.
    Sightings that were rejected, or fared otherwise in one of the runs, count for nothing.

    Args:
        observations: the sightings.
        done: what the filter made of them.
        others: the same with each setting by `step` larger.
        step: of every setting.
    """
    columns: list[list[se2.Array]] = [[] for _ in others]
    for rows, m in groups(observations, done, kernels.ACCEPTED):
        L = np.linalg.cholesky(done.S[rows, :m, :m])
        for other, found in zip(others, columns, strict=True):
            same = (other.status[rows] == kernels.ACCEPTED)[:, None]
            dr = np.where(same, other.residual[rows, :m] - done.residual[rows, :m], 0.0) / step
            dS = (other.S[rows, :m, :m] - done.S[rows, :m, :m]) / step
            dS = np.where(same[:, :, None], dS, 0.0)
            half = np.linalg.solve(L, dS)
            both = np.linalg.solve(L, np.swapaxes(half, 1, 2))
            found += [np.linalg.solve(L, dr[:, :, None]).ravel(), both.ravel() / np.sqrt(2.0)]
    return np.array([np.concatenate(found) if found else np.zeros(0) for found in columns])


def groups(
    observations: Observations, done: Filtered, status: int | None = None
) -> list[tuple[NDArray[np.int64], int]]:
    """Rows of the sightings that were used (or have a status), by their number of axes."""
    wanted = done.status != kernels.UNUSED if status is None else done.status == status
    found = [(np.flatnonzero(wanted & (observations.dims == m)), m) for m in (2, 3)]
    return [(rows, m) for rows, m in found if len(rows)]
