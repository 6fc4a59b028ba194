"""Chains of overflow pages of an SQLite file: where large payloads go on."""

from __future__ import annotations

import numpy as np

from slamreplay.ingest.readers.sqlite.numbers import Ints, Mask

_NOBODY = -1


class Chains:
    """Follows chains, and lets each page belong to one of them.

    Args:
        links: (P+1,) next page of each page.
        open_to_all: (P+1,) pages that can be overflow pages: there, and nothing else.
    """

    def __init__(self, links: Ints, open_to_all: Mask) -> None:
        self._links = links
        self._open = open_to_all
        self._owner = np.full(len(links), _NOBODY, dtype=np.int64)
        self._owners = 0

    @property
    def taken(self) -> Mask:
        """(P+1,) pages that belong to a chain."""
        return self._owner != _NOBODY

    def claim(self, first: Ints, counts: Ints) -> Mask:
        """Which of the chains are whole: they end after `counts` pages, and share none.

        Where two of these chains meet nobody can say whose the pages are: both are lost. A chain
        that was claimed by an earlier call keeps its pages.
        """
        whole = self._followed(first, counts)
        base = self._owners
        self._owners += len(first)
        earlier = self._owner != _NOBODY
        page, going = first.copy(), np.flatnonzero(whole & (counts > 0))
        step = 0
        while len(going):
            at = page[going]
            whole[going[earlier[at]]] = False
            going, at = going[~earlier[at]], at[~earlier[at]]
            nobodys = self._owner[at] == _NOBODY
            self._owner[at[nobodys]] = going[nobodys] + base
            theirs = self._owner[at] != going + base
            whole[self._owner[at[theirs]] - base] = False
            whole[going[theirs]] = False
            page[going] = self._links[at]
            step += 1
            going = going[counts[going] > step]
        return whole

    def _followed(self, first: Ints, counts: Ints) -> Mask:
        """Which chains end where they should, over pages that can be theirs."""
        good = np.full(len(first), fill_value=True)
        page, going, step = first.copy(), np.arange(len(first)), 0
        while len(going):
            ends = counts[going] == step
            good[going[ends]] = page[going[ends]] == 0
            going = going[~ends]
            at = page[going]
            there = (at > 0) & (at < len(self._links))
            there[there] = self._open[at[there]]
            good[going[~there]] = False
            going = going[there]
            page[going] = self._links[page[going]]
            step += 1
        return good

    def pages(self, first: Ints, counts: Ints) -> Ints:
        """The pages of whole chains, one chain after the other."""
        starts = np.cumsum(counts) - counts
        out = np.zeros(int(counts.sum()), dtype=np.int64)
        page, going, step = first.copy(), np.flatnonzero(counts > 0), 0
        while len(going):
            out[starts[going] + step] = page[going]
            page[going] = self._links[page[going]]
            step += 1
            going = going[counts[going] > step]
        return out
