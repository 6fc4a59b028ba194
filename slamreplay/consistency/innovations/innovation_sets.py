"""The innovations of a run as its checks see them: in time order, whitened, with the gate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtr, chdtri

from slamreplay.bundle.run import Innovations
from slamreplay.consistency.statistics.truncation import Truncation
from slamreplay.consistency.statistics.whitening import whitened
from slamreplay.geometry.se2 import Array


@dataclass(frozen=True, eq=False)
class InnovationSet:
    """Innovations of one source whose covariance is one, N of them in time order.

    Attributes:
        source: table or sensor.
        axes: name of each of the m components.
        units: of each; empty where it was not told.
        t_ns: (N,) times.
        residual: (N, m) measured minus predicted.
        sigma: (N, m) standard deviations predicted for it.
        white: (N, m) whitened by the whole covariance.
        accepted: (N,) whether the update used it.
        invalid: rows that were left out: not finite, or without a positive definite covariance.
    """

    source: str
    axes: tuple[str, ...]
    units: tuple[str, ...]
    t_ns: NDArray[np.int64]
    residual: Array
    sigma: Array
    white: Array
    accepted: NDArray[np.bool_]
    invalid: int

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def nis(self) -> Array:
        """(N,) normalised innovation squared r' S^-1 r."""
        return np.asarray(np.sum(self.white**2, axis=1))

    @property
    def gated_by_nis(self) -> bool:
        """Whether whatever was rejected was less likely than all that was accepted."""
        nis = self.nis
        kept, lost = nis[self.accepted], nis[~self.accepted]
        return bool(kept.max(initial=0.0) <= lost.min(initial=np.inf))

    @property
    def gate(self) -> Truncation:
        """The NIS above which was rejected, as far as the log shows it.

        The largest of n that came through lies at n / (n + 1) of what the gate lets through on
        average; the gate is put that much higher, and never above the least that was rejected. One
        that is not seen to act is none.
        """
        dof, nis = self.white.shape[1], self.nis
        kept, lost = nis[self.accepted], nis[~self.accepted]
        if not len(lost) or not len(kept) or not self.gated_by_nis:
            return Truncation(dof)
        share = float(chdtr(dof, kept.max())) * (len(kept) + 1) / len(kept)
        cut = float(chdtri(dof, 1.0 - share)) if share < 1.0 else math.inf
        return Truncation(dof, min(cut, float(lost.min())))


def innovation_sets(innovations: Sequence[Innovations]) -> tuple[InnovationSet, ...]:
    """Each source's; one without any row is left out, and one whose S nothing predicted."""
    return tuple(_set(one) for one in innovations if len(one.t_ns) and one.is_predicted)


def _set(given: Innovations) -> InnovationSet:
    order = np.argsort(given.t_ns, kind="stable")
    residual = np.asarray(given.residual, dtype=np.float64)[order]
    S = np.asarray(given.S, dtype=np.float64)[order]
    white = whitened(residual, S)
    sound = np.isfinite(white).all(axis=1)
    m = residual.shape[1]
    told = given.axes if len(given.axes) == m else tuple(f"axis-{k + 1}" for k in range(m))
    split = [name.rpartition(" ") for name in told]
    sigma = np.sqrt(np.diagonal(S[sound], axis1=1, axis2=2))
    return InnovationSet(
        given.source,
        tuple(name or unit for name, _, unit in split),
        tuple(unit if name else "" for name, _, unit in split),
        np.asarray(given.t_ns)[order][sound],
        residual[sound],
        sigma,
        white[sound],
        np.asarray(given.accepted, dtype=bool)[order][sound],
        int((~sound).sum()),
    )
