"""Numbers of places as colours over a map: five classes, each one outline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.fleet.schema import PLACE_M
from slamreplay.geometry.se2 import Array

Int = NDArray[np.int64]

#: So many classes has a layer; the page's style has an opacity for each.
CLASSES = 5
#: Places that are told one by one where a pointer rests on them: the highest ones.
_SPOTS = 60
#: More places than this are drawn in blocks.
_MOST_PLACES = 4000


@dataclass(frozen=True)
class Shade:
    """Places of one class.

    Attributes:
        level: 0, the lowest, to `CLASSES - 1`.
        text: what its numbers are.
        path: their outline, in m of the map's frame, as SVG has it; empty where there are none.
    """

    level: int
    text: str
    path: str


@dataclass(frozen=True)
class Spot:
    """One place with its number in words; (x, y) is its lower left corner, m."""

    x: float
    y: float
    text: str


@dataclass(frozen=True)
class Heat:
    """A layer over a map.

    Attributes:
        shades: from the lowest class to the highest.
        spots: the highest places, the highest first.
        edge_m: edge of what is drawn as one place.
    """

    shades: tuple[Shade, ...]
    spots: tuple[Spot, ...]
    edge_m: float


@dataclass(frozen=True, eq=False)
class Blocks:
    """Places in blocks of `size` by `size`; arrays are (N,), one per block that has a place."""

    size: int
    col: Int
    row: Int
    _of: Int

    def sum(self, values: NDArray) -> Array:
        """Over the places (M,) of each block."""
        weights = np.asarray(values, dtype=np.float64)
        return np.bincount(self._of, weights, len(self.col)).astype(np.float64)

    def greatest(self, values: NDArray) -> Array:
        """Over the places (M,) of each block: of counts of logs, which may be the same logs."""
        out = np.zeros(len(self.col))
        np.maximum.at(out, self._of, np.asarray(values, dtype=np.float64))
        return out


def blocks_of(col: NDArray, row: NDArray) -> Blocks:
    """Places (M,) as blocks of one place each, or of more where there are too many to draw."""
    size = 1
    while True:
        both = np.stack([row, col]).astype(np.int64) // size
        found, of = np.unique(both, axis=1, return_inverse=True)
        if found.shape[1] <= _MOST_PLACES:
            return Blocks(size, found[1], found[0], of.ravel())
        size *= 2


def shares(part: Array, whole: Array, least: float = 1.0) -> Array:
    """(N,) part by whole; 0 where of the whole there is less than `least`."""
    return np.divide(part, whole, out=np.zeros_like(whole), where=whole >= least)


def heat(
    places: Blocks,
    value: Array,
    *,
    bounds: Sequence[float],
    classes: Sequence[str],
    texts: Sequence[str],
) -> Heat:
    """A layer of places.

    Args:
        places: (N,) of them.
        value: (N,) what decides the class; nothing is drawn at 0 and below, or where it is NaN.
        bounds: the highest value of each class but the last, rising.
        classes: what each class is, in words.
        texts: what each place is, in words.
    """
    shown = np.flatnonzero(value > 0.0)
    level, edge = np.searchsorted(bounds, value[shown]), PLACE_M * places.size
    shades = tuple(
        Shade(k, text, _outline(places.col[shown[level == k]], places.row[shown[level == k]], edge))
        for k, text in enumerate(classes)
    )
    highest = shown[np.argsort(-value[shown], kind="stable")][:_SPOTS]
    spots = tuple(
        Spot(places.col[i] * edge, places.row[i] * edge, texts[i]) for i in highest.tolist()
    )
    return Heat(shades, spots, edge)


def _outline(col: Int, row: Int, edge: float) -> str:
    """Rectangles along rows as one path: neighbours in a row, which are in order, are one."""
    if not len(col):
        return ""
    apart = (np.diff(row) != 0) | (np.diff(col) != 1)
    first = np.concatenate([[0], np.flatnonzero(apart) + 1])
    lengths = np.diff(np.concatenate([first, [len(col)]]))
    return "".join(
        f"M{x * edge:g} {y * edge:g}h{n * edge:g}v{edge:g}h{-n * edge:g}z"
        for x, y, n in zip(col[first].tolist(), row[first].tolist(), lengths.tolist(), strict=True)
    )
