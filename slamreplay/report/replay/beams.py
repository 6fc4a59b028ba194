"""Scans thinned to a budget of bytes: fewer scans, every n-th beam, ends at 1 cm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.evidence.scene import Met, SceneScans
from slamreplay.report.replay.packing import deflated_size

#: Ends are whole numbers of these, about the base; what lies beyond 16 bits (327 m) is left out.
END_M = 0.01
#: What a beam met without a return: nothing to draw but the ray through the wall that is gone.
REMOVED_UNSEEN = 6
#: More beams in one scan than this look alike; fewer scans a second than this no longer flow.
_ENOUGH_BEAMS, _ENOUGH_HZ = 400, 2.0
#: So many scans are packed to learn what one takes.
_SAMPLE = 48


@dataclass(frozen=True)
class Thinning:
    """What stayed of a laser's scans and beams."""

    scans: int
    of_scans: int
    beams: int
    of_beams: int
    every_beam: int


@dataclass(frozen=True, eq=False)
class PackedScans:
    """Scans of one laser as they travel.

    Attributes:
        rows: (N,) which of the scene's scans stayed.
        ends: (2, N, B) int16 x and y of the ends in cm in the base frame. Where nothing is drawn
            the beam before stands again: a step of zero takes no room.
        met: (N, B) uint8 of `Met` or `REMOVED_UNSEEN`; 0 is not drawn.
        thinning: what was left out.
    """

    rows: NDArray[np.int64]
    ends: NDArray[np.int16]
    met: NDArray[np.uint8]
    thinning: Thinning


def packed_scans(scans: SceneScans, usable: NDArray[np.bool_], budget: int) -> PackedScans | None:
    """As many scans as the budget holds, evenly in their order; None where there is none to draw.

    Beams go first where a scan has more than 400; then scans, down to two a second; then beams
    again, down to 100.

    Args:
        scans: of one laser.
        usable: (N,) scans that can be drawn, because a pose of their time is known.
        budget: bytes, deflated.
    """
    rows, width = np.flatnonzero(usable), scans.met.shape[1]
    if not len(rows) or not width:
        return None
    span_s = max(float(scans.t_ns[rows[-1]] - scans.t_ns[rows[0]]) / 1e9, 1.0)
    every_beam = max(1, -(-width // _ENOUGH_BEAMS))
    while True:
        sample = _evenly(rows, _SAMPLE)
        taken = _size(*_drawn(scans, sample, every_beam)) / len(sample)
        fit = min(max(int(budget / max(taken, 1e-9)), 1), len(rows))
        flows = fit >= min(_ENOUGH_HZ * span_s, float(len(rows)))
        if flows or width / every_beam <= _ENOUGH_BEAMS / 4:
            break
        every_beam *= 2
    while True:
        kept = _evenly(rows, fit)
        ends, met = _drawn(scans, kept, every_beam)
        over = _size(ends, met) / max(budget, 1)
        if over <= 1.0 or fit == 1:
            break
        fit = max(int(fit / max(over, 1.02)), 1)
    told = Thinning(len(kept), len(rows), met.shape[1], width, every_beam)
    return PackedScans(kept, ends, met, told)


def _evenly(rows: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """So many of the rows, the first and the last among them."""
    if count >= len(rows):
        return rows
    return rows[np.round(np.linspace(0, len(rows) - 1, count)).astype(np.int64)]


def _size(ends: NDArray[np.int16], met: NDArray[np.uint8]) -> int:
    return deflated_size(ends) + deflated_size(met)


def _drawn(
    scans: SceneScans, rows: NDArray[np.int64], every: int
) -> tuple[NDArray[np.int16], NDArray[np.uint8]]:
    ends_cm = np.round(scans.ends_m[rows, ::every].astype(np.float64) / END_M)
    is_hit, met = scans.is_hit[rows, ::every], scans.met[rows, ::every].copy()
    met[is_hit & (met == Met.INVALID)] = Met.OTHER
    met[~is_hit & (met != Met.REMOVED)] = Met.INVALID
    met[~is_hit & (met == Met.REMOVED)] = REMOVED_UNSEEN
    with np.errstate(invalid="ignore"):
        met[~(np.abs(ends_cm) < 2**15).all(axis=2)] = Met.INVALID
    beam = np.where(met != Met.INVALID, np.arange(met.shape[1]), 0)
    before = np.maximum.accumulate(beam, axis=1)
    ends = np.take_along_axis(np.nan_to_num(ends_cm), before[..., None], axis=1)
    ends[met[np.arange(len(rows))[:, None], before] == Met.INVALID] = 0.0
    return np.moveaxis(ends, 2, 0).astype(np.int16), met
