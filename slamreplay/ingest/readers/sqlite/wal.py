"""SQLite's write-ahead log (-wal): which pages of a database are newer there, read in place.

The format (sqlite.org/fileformat2.html, section 4): a header of 32 bytes, then frames of a header
of 24 bytes and one page each. Frames count up to the last one that ends a transaction, as long as
salts and cumulative checksums hold; what lies behind is left over from an older round.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_MAGIC, _FORMAT = 0x377F0682, 3007000
_HEADER, _FRAME_HEADER = 32, 24
_BLOCK_BYTES = 1 << 22


@dataclass(frozen=True, eq=False)
class WriteAheadLog:
    """The committed pages of a write-ahead log.

    Attributes:
        path: the log.
        page_size: bytes of a page.
        count: pages of the database after the last transaction.
        pages: (N,) numbers of the pages in it, increasing.
        offsets: (N,) where the newest content of each page starts in the log.
    """

    path: Path
    page_size: int
    count: int
    pages: NDArray[np.int64]
    offsets: NDArray[np.int64]

    def find(self, numbers: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        """Which of the pages are in the log, and where (any number for those that are not)."""
        at = np.minimum(np.searchsorted(self.pages, numbers), len(self.pages) - 1)
        return self.pages[at] == numbers, self.offsets[at]


def read_log(path: Path) -> WriteAheadLog | None:
    """The write-ahead log at a path; None where none is there or nothing in it is committed."""
    if not path.is_file():
        return None
    with path.open("rb") as stream:
        header = np.frombuffer(stream.read(_HEADER).ljust(_HEADER, b"\0"), dtype=">u4")
        magic, version, page_size = (int(word) for word in header[:3])
        order = ">u4" if magic & 1 else "<u4"  # of the words that are summed
        words = np.frombuffer(header.tobytes(), dtype=order)[:6].astype(np.uint32)
        known = magic | 1 == _MAGIC | 1 and version == _FORMAT
        if not known or page_size not in {1 << power for power in range(9, 17)}:
            return None
        before = _sums(words[None], np.zeros(2, dtype=np.uint32)[None])
        if (before[0] != header[6:8]).any():
            return None
        frame = _FRAME_HEADER + page_size
        heads = []
        while len(block := stream.read(max(_BLOCK_BYTES // frame, 1) * frame)) >= frame:
            frames = np.frombuffer(block, np.uint8)[: len(block) // frame * frame]
            frames = frames.reshape(-1, frame)
            head = frames[:, :_FRAME_HEADER].copy().view(">u4").astype(np.uint32)
            words = np.hstack([frames[:, :8], frames[:, _FRAME_HEADER:]]).view(order)
            # A checksum goes on from the one of the frame before: all frames at once.
            sums = _sums(words.astype(np.uint32), np.vstack([before, head[:-1, 4:]]))
            good = (sums == head[:, 4:]).all(axis=1) & (head[:, 2:4] == header[4:6]).all(axis=1)
            good &= head[:, 0] > 0
            valid = len(good) if good.all() else int(np.argmin(good))
            heads.append(head[:valid, :2].astype(np.int64))
            before = head[-1:, 4:]
            if valid < len(good):
                break
    numbers, sizes = np.vstack([np.zeros((0, 2), dtype=np.int64), *heads]).T
    commits = np.flatnonzero(sizes)
    if not len(commits):
        return None
    committed = int(commits[-1]) + 1
    count = int(sizes[committed - 1])
    # The last frame of a page is its newest.
    pages, newest = np.unique(numbers[:committed][::-1], return_index=True)
    offsets = _HEADER + (committed - 1 - newest) * frame + _FRAME_HEADER
    return WriteAheadLog(path, page_size, count, pages, offsets)


def _sums(words: NDArray[np.uint32], start: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """(N, 2) checksums of rows of words, each going on from its row of `start`.

    SQLite adds pairs of words (x, y) up as a += x + b, b += y + a. That is linear modulo 2^32:
    a pair with k pairs behind it counts with Fibonacci numbers, x with F(2k+1) and F(2k+2), y with
    F(2k) and F(2k+1).
    """
    pairs = words.shape[1] // 2
    fibonacci = [0, 1]
    while len(fibonacci) < 2 * pairs + 2:
        fibonacci.append((fibonacci[-1] + fibonacci[-2]) & 0xFFFFFFFF)
    numbers = np.array(fibonacci, dtype=np.uint32)
    even, odd = numbers[: 2 * pairs + 1 : 2], numbers[1 : 2 * pairs + 2 : 2]
    x, y = words[:, 0::2], words[:, 1::2]
    a, b = start[:, 0], start[:, 1]
    first = x @ odd[:pairs][::-1] + y @ even[:pairs][::-1]
    second = x @ even[1:][::-1] + y @ odd[:pairs][::-1]
    # `pairs` steps take (a, b) to (F(2n-1) a + F(2n) b, F(2n) a + F(2n+1) b).
    f_before, f_at, f_after = numbers[2 * pairs - 1], numbers[2 * pairs], numbers[2 * pairs + 1]
    sums = np.stack([first + f_before * a + f_at * b, second + f_at * a + f_after * b], axis=1)
    return sums.astype(np.uint32)
