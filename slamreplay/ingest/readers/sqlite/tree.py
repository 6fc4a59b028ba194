"""Which pages a table of an SQLite file has, as far as its b-tree can still be followed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.ingest.readers.sqlite.btree import INTERIOR, LEAF
from slamreplay.ingest.readers.sqlite.numbers import Bytes, Ints, Mask

LOWEST, HIGHEST = (int(bound) for bound in (np.iinfo(np.int64).min, np.iinfo(np.int64).max))


@dataclass(frozen=True, eq=False)
class Structure:
    """What all pages of a file say of themselves; arrays have an entry 0 that stands for none.

    Attributes:
        kinds: (P+1,) first bytes of the b-tree headers.
        smallest, largest: (P+1,) row ids or keys on the page, without bounds where it has none.
        damaged: (P+1,) pages that may lack cells.
        parent, child, key: (E,) children of interior pages; see `Edges`.
    """

    kinds: Bytes
    smallest: Ints
    largest: Ints
    damaged: Mask
    parent: Ints
    child: Ints
    key: Ints


@dataclass(frozen=True, eq=False)
class Tree:
    """Pages of one table.

    Attributes:
        pages: (P+1,) whether a page belongs to it.
        leaves: (L,) its leaf pages.
        ranges: (L, 2) row ids (above, up to) that belong on each leaf.
        gaps: (H, 2) row ids (above, up to) that belong on pages that were not found.
        holes: (H, 2) the same, so wide that a damaged key does not hide any.
    """

    pages: Mask
    leaves: Ints
    ranges: Ints
    gaps: Ints
    holes: Ints


def no_tree(count: int) -> Tree:
    """The tree of a table whose root is unknown, in a file of `count` pages."""
    none = np.zeros((0, 2), dtype=np.int64)
    everything = np.array([[LOWEST, HIGHEST]])
    return Tree(np.zeros(count + 1, dtype=bool), none[:, 0], none, everything, everything)


def walk(structure: Structure, root: int) -> Tree:
    """Follow a tree down from its root, level by level.

    A child is taken when its row ids fit between the keys around it, at the place where they fit
    best if it is named twice. A child that is not there or does not fit leaves a hole, and so does
    an interior page that is damaged. The key that ends a hole may be damaged too: the hole goes on
    to the key behind it.
    """
    pages = np.zeros(len(structure.kinds), dtype=bool)
    leaves, holes = [], []
    # Columns: child, the bounds of its row ids (above, up to), and the bound behind.
    level = np.array([[root, LOWEST, HIGHEST, HIGHEST]], dtype=np.int64)
    while len(level):
        fits = _fits(structure, level, pages)
        holes.append(level[~fits])
        level = level[fits]
        pages[level[:, 0]] = True
        is_leaf = structure.kinds[level[:, 0]] == LEAF
        leaves.append(level[is_leaf])
        level = level[~is_leaf]
        holes.append(level[structure.damaged[level[:, 0]]])
        level = _children(structure, level)
    found, missing = np.concatenate(leaves), np.concatenate(holes)
    found = found[np.argsort(found[:, 0])]
    return Tree(pages, found[:, 0], found[:, 1:3], missing[:, 1:3], missing[:, [1, 3]])


def _fits(structure: Structure, level: Ints, taken: Mask) -> Mask:
    child, low, high, higher = level.T
    child = np.where((child > 0) & (child < len(taken)), child, 0)
    kinds = structure.kinds[child]
    fits = ((kinds == INTERIOR) | (kinds == LEAF)) & ~taken[child] & (child > 0)
    smallest, largest = structure.smallest[child], structure.largest[child]
    fits &= (largest > low) & (smallest <= higher)
    inexact = (smallest <= low) | (largest > high)
    order = np.lexsort((inexact, ~fits, child))
    again = np.zeros(len(level), dtype=bool)
    again[order[1:]] = child[order[1:]] == child[order[:-1]]
    return fits & ~again


def _children(structure: Structure, level: Ints) -> Ints:
    """The next level: children of interior pages, with the bounds of their row ids."""
    first = np.searchsorted(structure.parent, level[:, 0], "left")
    counts = np.searchsorted(structure.parent, level[:, 0], "right") - first
    of = np.repeat(np.arange(len(level)), counts)
    within = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)
    edge = first[of] + within
    is_last = within == counts[of] - 1
    _, low, high, higher = level[of].T
    # An edge's neighbours in these arrays are its siblings, but at the ends of a page.
    high = np.where(is_last, high, structure.key[edge])
    low = np.where(within == 0, low, np.roll(high, 1))
    higher = np.where(is_last, higher, np.maximum(high, np.roll(high, -1)))
    return np.stack([structure.child[edge], low, high, higher], axis=1)


def merged(ranges: Ints) -> Ints:
    """(R, 2) ranges (above, up to) of row ids, in order and without overlap."""
    ranges = ranges[ranges[:, 0] < ranges[:, 1]]
    if not len(ranges):
        return ranges
    ranges = ranges[np.argsort(ranges[:, 0], kind="stable")]
    high = np.maximum.accumulate(ranges[:, 1])
    first = np.concatenate([[True], ranges[1:, 0] > high[:-1]])
    last = np.concatenate([first[1:], [True]])
    return np.stack([ranges[first, 0], high[last]], axis=1)


def within(ranges: Ints, ids: Ints) -> Mask:
    """Which row ids are in one of the merged ranges."""
    if not len(ranges):
        return np.zeros(len(ids), dtype=bool)
    at = np.searchsorted(ranges[:, 0], ids, "left") - 1
    return (at >= 0) & (ids <= ranges[np.maximum(at, 0), 1])


def absent(ranges: Ints, ids: Ints) -> Ints:
    """How many row ids of each range are not among the sorted `ids`.

    Ids are taken to begin with 1, and to end with the largest that is known.
    """
    lowest = min(0, int(ids[0]) - 1) if len(ids) else 0
    highest = int(ids[-1]) if len(ids) else 0
    low = np.maximum(ranges[:, 0], lowest)
    high = np.where(ranges[:, 1] == HIGHEST, np.maximum(highest, low), ranges[:, 1])
    there = np.searchsorted(ids, high, "right") - np.searchsorted(ids, low, "right")
    return np.maximum(high - low - there, 0)
