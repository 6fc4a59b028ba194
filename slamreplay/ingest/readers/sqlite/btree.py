"""SQLite's b-tree pages (sqlite.org/fileformat2.html), taken apart without a database engine.

A file is a row of pages of one size, numbered from 1. Tables are b-trees: rows are cells of leaf
pages, in the order of their row ids; interior pages name their children with the largest row id
below each. What of a row does not fit its page goes on in a chain of overflow pages. Everything
here takes many pages at once: positions are arrays, and damage makes a cell unsound, not an error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from slamreplay.ingest.readers.sqlite.numbers import (
    MAX_PAYLOAD,
    Bytes,
    Ints,
    Mask,
    local_bytes,
    type_bytes,
    unsigned,
    varints,
)

INTERIOR, LEAF = 5, 13  # kinds of pages of tables
INDEX_PAGES = (2, 10)  # of no use here
PAD = 64  # zeros behind a block, so that a varint at its end can be read without a question
_FILE_HEADER = 100  # bytes of page 1 before its b-tree header


@dataclass(frozen=True, eq=False)
class Block:
    """Some pages in memory.

    Attributes:
        flat: their bytes, and some zeros behind.
        numbers: (P,) page numbers.
        page_size: bytes of a page.
        usable: bytes of a page that SQLite uses.
        present: (P,) bytes of each page that the file has; the rest is zeros.
    """

    flat: Bytes
    numbers: Ints
    page_size: int
    usable: int
    present: Ints

    @cached_property
    def starts(self) -> Ints:
        """(P,) where each page starts in `flat`."""
        return np.arange(len(self.numbers)) * self.page_size

    @cached_property
    def heads(self) -> Ints:
        """(P,) where each page's b-tree header starts in `flat`."""
        return self.starts + np.where(self.numbers == 1, _FILE_HEADER, 0)

    @property
    def kinds(self) -> Bytes:
        """(P,) first bytes of the b-tree headers."""
        return self.flat[self.heads]

    @property
    def links(self) -> Ints:
        """(P,) what would be the next page, were each page one of overflow."""
        return unsigned(self.flat, self.starts, 4)

    @property
    def whole(self) -> Mask:
        """(P,) whether the file has all of the page."""
        return self.present == self.page_size

    @cached_property
    def _ends(self) -> Ints:
        return np.minimum(self.present, self.usable)

    def edges(self) -> Edges:
        """Children of the interior pages."""
        rows = np.flatnonzero(self.kinds == INTERIOR)
        row, pointer = self._pointers(rows, 12)
        at = self.starts[row] + np.minimum(pointer, self.page_size)
        key, width = varints(self.flat, at + 4)
        sound = (pointer >= 12) & (pointer + 4 + width <= self._ends[row])
        damaged = self._damaged(rows, row, np.where(sound, 4 + width, -1), key)
        last = np.full(len(rows), np.iinfo(np.int64).max)
        parent = np.concatenate([row[sound], rows])
        child = np.concatenate(
            [unsigned(self.flat, at[sound], 4), unsigned(self.flat, self.heads[rows] + 8, 4)]
        )
        order = np.argsort(parent, kind="stable")  # the rightmost child comes after the others
        return Edges(
            self.numbers[parent][order],
            child[order],
            np.concatenate([key[sound], last])[order],
            self.numbers[rows[damaged]],
        )

    def cells(self) -> Cells:
        """Cells of the leaf pages."""
        rows = np.flatnonzero(self.kinds == LEAF)
        row, pointer = self._pointers(rows, 8)
        at = self.starts[row] + np.minimum(pointer, self.page_size)
        payload, width = varints(self.flat, at)
        rowid, more = varints(self.flat, at + width)
        width += more
        sound = (pointer >= 8) & (payload > 0) & (payload <= MAX_PAYLOAD)
        payload = np.where(sound, payload, 0)
        local = local_bytes(payload, self.usable)
        spilled = payload > local
        size = width + local + 4 * spilled
        sound &= pointer + size <= self._ends[row]
        damaged = self._damaged(rows, row, np.where(sound, size, -1), rowid)
        placed = (self._content(row) <= pointer) & (pointer < self.usable)
        body = np.where(sound, at + width, 0)
        overflow = np.where(sound & spilled, unsigned(self.flat, body + local * sound, 4), 0)
        end = np.where(sound, pointer + size, 0)
        return Cells(
            self,
            row,
            body,
            rowid,
            payload,
            local,
            overflow,
            end,
            sound,
            placed,
            self.numbers[rows[damaged]],
        )

    def _pointers(self, rows: Ints, header: int) -> tuple[Ints, Ints]:
        """Row and cell pointer (from the page's start) of every cell of the pages at `rows`."""
        first = self.heads[rows] + header
        room = (self.starts[rows] + self.usable - first) // 6  # of the smallest cells
        counts = np.clip(unsigned(self.flat, self.heads[rows] + 3, 2), 0, np.maximum(room, 0))
        before = np.cumsum(counts) - counts
        within = np.arange(int(counts.sum())) - np.repeat(before, counts)
        at = np.repeat(first, counts) + 2 * within
        return np.repeat(rows, counts), unsigned(self.flat, at, 2)

    def _damaged(self, rows: Ints, row: Ints, sizes: Ints, keys: Ints) -> Mask:
        """Which pages cannot be as they were written.

        Cells are unsound (their size is -1) or out of order, or bytes are in no cell and not free.
        """
        taken = np.bincount(row, weights=sizes, minlength=len(self.numbers))[rows]
        free = self._free_bytes(rows) + self.flat[self.heads[rows] + 7]
        damaged = self._content(rows) + taken + free != self.usable
        disorder = (row[1:] == row[:-1]) & (keys[1:] <= keys[:-1])
        for cell in (sizes < 0, np.append(disorder, np.zeros(1, dtype=bool))[: len(row)]):
            damaged |= np.bincount(row[cell], minlength=len(self.numbers))[rows] > 0
        return damaged

    def _content(self, rows: Ints) -> Ints:
        """Where the cells of the pages at `rows` begin, from the page's start."""
        content = unsigned(self.flat, self.heads[rows] + 5, 2)
        return np.where(content == 0, 65536, content)

    def _free_bytes(self, rows: Ints) -> Ints:
        """Bytes in the chains of free blocks of the pages at `rows`."""
        total = np.zeros(len(rows), dtype=np.int64)
        starts, block = self.starts[rows], unsigned(self.flat, self.heads[rows] + 1, 2)
        before = np.zeros_like(block)
        going = np.flatnonzero(block)
        while len(going):  # each is behind the one before it: the loop ends
            at = starts[going] + np.minimum(block[going], self.page_size - 4)
            total[going] += unsigned(self.flat, at + 2, 2)
            before[going] = block[going]
            block[going] = unsigned(self.flat, at, 2)
            going = going[block[going] > before[going]]
        return total


@dataclass(frozen=True, eq=False)
class Edges:
    """Children of interior pages, those of a page together and in the order of their keys.

    Attributes:
        parent: (N,) page number of the interior page.
        child: (N,) page number of the child.
        key: (N,) largest row id below the child; int64's largest for the rightmost child.
        damaged: (D,) interior pages that may have had more children.
    """

    parent: Ints
    child: Ints
    key: Ints
    damaged: Ints


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of table leaf pages.

    Attributes:
        block: the pages.
        row: (N,) index of the page in the block.
        body: (N,) where the payload starts in the block's bytes.
        rowid: (N,) row ids.
        payload: (N,) bytes of payload.
        local: (N,) bytes of payload on the leaf page itself.
        overflow: (N,) first overflow page, 0 for none.
        end: (N,) where the cell ends, from the page's start.
        sound: (N,) whether the cell lies within its page.
        placed: (N,) whether it starts where a page has its cells.
        damaged: (D,) leaf pages with unsound cells, or that may have had more cells.
    """

    block: Block
    row: Ints
    body: Ints
    rowid: Ints
    payload: Ints
    local: Ints
    overflow: Ints
    end: Ints
    sound: Mask
    placed: Mask
    damaged: Ints

    @property
    def page(self) -> Ints:
        """(N,) page numbers."""
        return self.block.numbers[self.row]

    def types(self, columns: int) -> tuple[Ints, Mask]:
        """(N, columns) serial types, and whether a record is whole with as many columns."""
        flat, at = self.block.flat, self.body
        header, width = varints(flat, at)
        end = at + header
        at = at + width
        types = np.zeros((len(at), columns), dtype=np.int64)
        for column in range(columns):
            inside = np.minimum(at, len(flat) - PAD)
            types[:, column], width = varints(flat, inside)
            at = at + width
        sizes = type_bytes(types).sum(axis=1)
        whole = self.sound & (at == end) & (header <= self.local) & (header + sizes == self.payload)
        return types, whole
