"""Where codes lie whose numbers follow a lattice: its spacing and rows from the log itself.

A number counts along the rows (id = row * columns + column), or a name holds two numbers, one for
each axis. Codes of one floor are laid in the same orientation, so that the way from one to the next
that odometry tells, seen from the first, is a whole number of steps along its axes whatever the
robot did between.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.sightings import Sightings
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.geometry.times import ns

#: Ways between codes that odometry tells well: within this time.
_SOON_S = 20.0
#: Codes that seem nearer to each other than this part of a step are one that was read two ways.
_SAME = 0.5
#: So many pairs are needed, of them so many of neighbours in a row, and this share must agree with
#: the lattice that is found.
_LEAST, _FEWEST, _SHARE = 8, 2, 0.7
#: A way agrees when it is this near to a whole number of steps, as a share of one.
_NEAR = 0.2
#: Surveyed codes must lie where the lattice has them, as a share of a step.
_FIT = 0.1
#: A larger number counts nothing, and no floor has more codes to a row.
_LARGEST, _WIDEST = 2**31, 10_000


@dataclass(frozen=True, eq=False)
class Lattice:
    """Codes on a square lattice.

    Attributes:
        spacing_m: from one to the next.
        columns: numbers to a row, 0 where names hold two numbers.
        cell: (C, 2) whole steps of each code along the axes that codes have,
        names: (C,) of the codes.
        share: of the ways between codes that agree with it.
    """

    spacing_m: float
    columns: int
    cell: NDArray[np.int64]
    names: NDArray[np.str_]
    share: float

    def places(self) -> dict[str, se2.Array]:
        """Poses (3,) of the codes in the lattice, whose axes are theirs."""
        at = self.spacing_m * self.cell
        return {str(name): np.array([*xy, 0.0]) for name, xy in zip(self.names, at, strict=True)}

    def placed(self, surveyed: Mapping[str, se2.Array]) -> dict[str, se2.Array] | None:
        """Poses (3,) of all codes in the map of those that are surveyed, None where they disagree.

        The heading of the lattice is the mean of the surveyed codes', its origin the mean of what
        each of them makes of it.
        """
        own = self.places()
        both = [n for n in own if n in surveyed and np.isfinite(surveyed[n]).all()]
        if not both:
            return None
        there = np.array([surveyed[n] for n in both])
        here = np.array([own[n] for n in both])
        yaw = float(np.arctan2(np.sin(there[:, 2]).sum(), np.cos(there[:, 2]).sum()))
        turned = se2.compose([0.0, 0.0, yaw], here)
        shift = (there - turned)[:, :2]
        off = np.hypot(*(shift - np.median(shift, axis=0)).T)
        if np.median(off) > _FIT * self.spacing_m:
            return None
        T = np.array([*np.median(shift, axis=0), yaw])
        return {name: se2.compose(T, pose) for name, pose in own.items()}


def lattice_of(
    sightings: Sightings,
    motion: PoseTrack,
    spacing_m: float | None = None,
    columns: int | None = None,
) -> Lattice | None:
    """The lattice that numbers and ways between codes agree on, None where there is none.

    Args:
        sightings: of codes with headings.
        motion: the base in a frame that drifts by little within some seconds.
        spacing_m: the step, where it is known,
        columns: and the numbers to a row.
    """
    names, number = _numbers(sightings)
    usable = np.flatnonzero((number[:, 0] >= 0) & np.isfinite(sightings.xyyaw[:, 2]))
    before, after, way = _ways(sightings, motion, usable)
    step = number[after] - number[before]
    in_pairs = bool((number[usable, 1] >= 0).all())
    neighbours = np.flatnonzero(np.abs(step if in_pairs else step[:, :1]).sum(axis=1) == 1)
    if spacing_m is None:
        if len(neighbours) < _FEWEST:
            return None
        spacing_m = float(np.median(np.hypot(*way[neighbours].T)))
    moved = np.hypot(*way.T) > _SAME * spacing_m
    before, step, way = before[moved], step[moved], way[moved]
    if len(way) < _LEAST:
        return None
    found = _of_pairs(step, way / spacing_m) if in_pairs else (
        _of_rows(step[:, 0], way / spacing_m, columns))  # fmt: skip
    if found is None:
        return None
    columns, steps_per, share = found
    unique, first = np.unique(names[usable], return_index=True)
    cells = _cells(number[usable[first]], columns, steps_per, number[before], step, way, spacing_m)
    return Lattice(spacing_m, columns, cells, unique.astype(str), share)


def _numbers(sightings: Sightings) -> tuple[NDArray[np.str_], NDArray[np.int64]]:
    """Names (N,) and the one or two numbers (N, 2) in which they differ; -1 where there is none."""
    names = sightings.name.astype(str)
    unique, which = np.unique(names, return_inverse=True)
    found = [[int(text) for text in re.findall(r"\d+", name)] for name in unique]
    sizes = [len(numbers) for numbers in found]
    usual = max(set(sizes), key=sizes.count) if sizes else 0
    table = np.full((len(unique), max(usual, 2)), -1, dtype=np.int64)
    for row, numbers in enumerate(found):
        if len(numbers) == usual and usual and max(numbers) < _LARGEST:
            table[row, :usual] = numbers
    sound = table[:, 0] >= 0
    differ = [c for c in range(usual) if len(set(table[sound, c].tolist())) > 1]
    out = np.full((len(unique), 2), -1, dtype=np.int64)
    if 1 <= len(differ) <= 2:
        out[sound, : len(differ)] = table[sound][:, differ]
    return names, out[which]


def _ways(
    sightings: Sightings, motion: PoseTrack, rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], se2.Array]:
    """Sightings before and after each change of the code, and the way (P, 2) from one to the next.

    In the axes of the code before, m. A way between two codes that turned against each other is
    left out: they are not of one floor, or one was misread.
    """
    rows = rows[np.argsort(sightings.t_ns[rows], kind="stable")]
    other = np.flatnonzero(sightings.name[rows[1:]] != sightings.name[rows[:-1]])
    before, after = rows[other], rows[other + 1]
    T = motion.at(sightings.t_ns).xyyaw
    code = se2.compose(T, sightings.xyyaw)
    way = se2.between(code[before], code[after])
    keep = sightings.t_ns[after] - sightings.t_ns[before] < ns(_SOON_S)
    keep &= np.isfinite(way).all(axis=1) & (np.abs(way[:, 2]) < np.radians(15.0))
    return before[keep], after[keep], way[keep, :2]


_Found = tuple[int, NDArray[np.int64], float]


def _of_rows(step: NDArray[np.int64], way: se2.Array, columns: int | None) -> _Found | None:
    """Columns, steps (2, 2) along the axes for a column and a row, and the share that agrees.

    Of the ways across rows, each tells how many numbers a row would have.

    Args:
        step: (P,) by how much the numbers differ.
        way: (P, 2) in steps.
        columns: where it is known.
    """
    whole = np.rint(way).astype(np.int64)
    near = np.abs(way - whole).max(axis=1) < _NEAR
    best: _Found | None = None
    for axis in (0, 1):
        for sign in (1, -1):
            along, across = sign * whole[:, axis], whole[:, 1 - axis]
            jumps = near & (across != 0) & ((step - along) % np.where(across, across, 1) == 0)
            candidates = ((step - along)[jumps] // across[jumps]).tolist()
            if columns is not None:
                candidates = [columns, -columns]
            for width in sorted(set(candidates)):
                agree = near & (step == along + width * across)
                share = float(agree.mean())
                if 1 < abs(width) <= _WIDEST and (best is None or share > best[2]):
                    per = np.zeros((2, 2), dtype=np.int64)
                    per[0, axis], per[1, 1 - axis] = sign, 1 if width > 0 else -1
                    best = abs(width), per, share
    return best if best is not None and best[2] >= _SHARE else None


def _of_pairs(step: NDArray[np.int64], way: se2.Array) -> _Found | None:
    """The same where names hold a number for each axis: steps (P, 2) of both, ways in steps."""
    whole = np.rint(way).astype(np.int64)
    near = np.abs(way - whole).max(axis=1) < _NEAR
    best: _Found | None = None
    for first in (0, 1):
        for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            per = np.zeros((2, 2), dtype=np.int64)
            per[0, first], per[1, 1 - first] = signs
            share = float((near & (whole == step @ per).all(axis=1)).mean())
            if best is None or share > best[2]:
                best = 0, per, share
    return best if best is not None and best[2] >= _SHARE else None


def _cells(
    number: NDArray[np.int64],
    columns: int,
    per: NDArray[np.int64],
    before: NDArray[np.int64],
    step: NDArray[np.int64],
    way: se2.Array,
    spacing_m: float,
) -> NDArray[np.int64]:
    """(C, 2) steps of codes along the axes; rows begin at a number that most ways agree with.

    Where several do, for the robot never drove there, at the one farthest from where it did: a code
    of a column that was never crossed may be placed at the wrong end of its row.
    """
    if columns == 0:
        return np.asarray((number - number.min(axis=0)) @ per)
    along = np.rint(way / spacing_m).astype(np.int64) @ per[0]
    first, last = before[:, 0], before[:, 0] + step[:, 0]
    agreed = [
        int(((first - begin) % columns + along == (last - begin) % columns).sum())
        for begin in range(columns)
    ]
    begin = _middle(np.array(agreed) == max(agreed))
    row, column = np.divmod(number[:, 0] - begin, columns)
    return np.asarray(np.column_stack([column, row]) @ per)


def _middle(holds: NDArray[np.bool_]) -> int:
    """The middle of the longest stretch (round the end) of (N,) flags of which one is set."""
    n = len(holds)
    if holds.all():
        return 0
    first = int(np.argmin(holds))  # a stretch never reaches over this one
    turned = np.roll(holds, -first)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], turned.astype(np.int64), [0]])))
    starts, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - starts))
    return int((first + (starts[longest] + ends[longest] - 1) // 2) % n)
