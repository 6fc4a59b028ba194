"""Pages of an SQLite file, read where they are: in the file, or in its write-ahead log."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from slamreplay.ingest.readers.sqlite.btree import PAD, Block
from slamreplay.ingest.readers.sqlite.numbers import Ints
from slamreplay.ingest.readers.sqlite.wal import WriteAheadLog

PAGE_SIZES = tuple(1 << power for power in range(9, 17))
_BLOCK_BYTES = 1 << 22


@dataclass(frozen=True, eq=False)
class Pages:
    """The pages of a file, those of its write-ahead log in their place.

    Attributes:
        path: the database.
        page_size: bytes of a page.
        usable: bytes of a page without the reserved ones at its end.
        count: pages, the last perhaps in part.
        log: committed pages of the write-ahead log beside it.
    """

    path: Path
    page_size: int
    usable: int
    count: int
    log: WriteAheadLog | None = None

    def read(self, numbers: Ints) -> Block:
        """The pages of these numbers (1 to `count`); what the file lacks is zeros."""
        size = self.page_size
        flat = np.zeros(len(numbers) * size + PAD, dtype=np.uint8)
        offsets = (numbers - 1) * size
        logged = np.full(len(numbers), fill_value=False)
        if self.log is not None:
            logged, frames = self.log.find(numbers)
            offsets = np.where(logged, frames, offsets)
        breaks = np.flatnonzero((np.diff(offsets) != size) | (np.diff(logged) != 0)) + 1
        present = np.zeros(len(numbers), dtype=np.int64)
        with ExitStack() as stack:
            main = stack.enter_context(self.path.open("rb", buffering=0))
            log = stack.enter_context(self.log.path.open("rb", buffering=0)) if self.log else main
            view = flat.data
            for first, last in pairwise([0, *breaks.tolist(), len(numbers)]):
                stream = log if logged[first : first + 1].any() else main
                stream.seek(int(offsets[first]) if last else 0)
                read = stream.readinto(view[first * size : last * size])
                present[first:last] = np.clip(read - size * np.arange(last - first), 0, size)
        return Block(flat, numbers, size, self.usable, present)

    def blocks(self) -> Iterator[Block]:
        """All pages in the order of their numbers, a few megabytes at a time."""
        step = max(_BLOCK_BYTES // self.page_size, 1)
        for first in range(1, self.count + 1, step):
            yield self.read(np.arange(first, min(first + step, self.count + 1)))
