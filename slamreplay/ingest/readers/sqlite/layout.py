"""How a file of SQLite is laid out: page size, reserved bytes, pages that are free."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slamreplay.ingest.readers.sqlite.btree import PAD, Block
from slamreplay.ingest.readers.sqlite.numbers import Bytes, Ints, Mask
from slamreplay.ingest.readers.sqlite.pages import PAGE_SIZES, Pages
from slamreplay.ingest.readers.sqlite.wal import read_log

_MAGIC = b"SQLite format 3\0"
_LEAST_USABLE = 480
_PROBE_BYTES = 1 << 22  # a multiple of every page size
_ENOUGH = 16  # leaf pages that agree on a layout
_SPILLED = 256  # more than can be reserved
_PROBES = 4  # to be made where the header itself makes sense


@dataclass(frozen=True)
class Header:
    """What page 1 says; zeros where it says nothing that can be true.

    Attributes:
        page_size: bytes of a page.
        reserved: bytes at the end of each page that SQLite leaves alone.
        count: pages of the file when it was whole.
        first_free: page the list of free pages starts on.
    """

    page_size: int = 0
    reserved: int = 0
    count: int = 0
    first_free: int = 0


def read_header(head: bytes) -> Header:
    """The header of a file from its first 100 bytes."""
    if len(head) < 100 or not head.startswith(_MAGIC) or head[21:24] != b"\x40\x20\x20":
        return Header()
    page_size = int.from_bytes(head[16:18])
    page_size = 65536 if page_size == 1 else page_size
    if page_size not in PAGE_SIZES or page_size - head[20] < _LEAST_USABLE:
        return Header()
    # Writers that know nothing of the page count leave the two change counters apart.
    count = int.from_bytes(head[28:32]) if head[24:28] == head[92:96] else 0
    return Header(page_size, head[20], count, int.from_bytes(head[32:36]))


def open_pages(path: Path) -> tuple[Pages, Header] | None:
    """The pages of a file with its write-ahead log, and its header; None where there are none."""
    log = read_log(path.with_name(path.name + "-wal"))
    size = path.stat().st_size
    if log is not None:
        usable = log.page_size  # until page 1 says what of it is reserved
        first = Pages(path, log.page_size, usable, log.count, log).read(np.array([1]))
        header = read_header(first.flat[:100].tobytes())
        reserved = header.reserved if header.page_size == log.page_size else 0
        return Pages(path, log.page_size, log.page_size - reserved, log.count, log), header
    with path.open("rb") as stream:
        header = read_header(stream.read(100))
    page_size, reserved = _probe(path, header)
    if not page_size:
        return None
    if page_size != header.page_size:
        header = Header()
    return Pages(path, page_size, page_size - reserved, -(-size // page_size)), header


def _probe(path: Path, header: Header) -> tuple[int, int]:
    """Page size and reserved bytes: the header's, unless leaf pages show others.

    Cells fill a leaf page from its end: none ends behind where the reserved bytes start, and on
    some page one ends right there.
    """
    votes = {page_size: np.zeros(_SPILLED + 1, dtype=np.int64) for page_size in PAGE_SIZES}
    best = PAGE_SIZES[0]
    with path.open("rb") as stream:
        while data := stream.read(_PROBE_BYTES):
            for page_size in PAGE_SIZES:
                votes[page_size] += _votes(np.frombuffer(data, dtype=np.uint8), page_size)
            best = max(PAGE_SIZES, key=lambda page_size: int(votes[page_size].sum()))
            enough = votes[best].sum() >= _ENOUGH
            if enough or (header.page_size and stream.tell() >= _PROBES * _PROBE_BYTES):
                break
    if header.page_size and (votes[header.page_size].any() or not votes[best].any()):
        best = header.page_size
    if not votes[best].any():
        return header.page_size, header.reserved
    stated = header.reserved if header.page_size == best else _SPILLED
    seen = np.flatnonzero(votes[best][:_SPILLED])
    least = min(stated, *seen[:1].tolist(), _SPILLED)
    return best, least if least < _SPILLED else 0


def _votes(data: Bytes, page_size: int) -> Ints:
    """(257,) how many leaf pages of messages leave so many bytes at their end.

    The last entry is for pages with overflow, whose cells have their size only if none is reserved.
    """
    count = len(data) // page_size
    flat = np.concatenate([data[: count * page_size], np.zeros(PAD, dtype=np.uint8)])
    numbers = np.arange(count) + 2  # page 1 has no messages
    block = Block(flat, numbers, page_size, page_size, np.full(count, page_size))
    cells = block.cells()
    types, whole = cells.types(4)
    fits = whole & (types[:, 0] == 0) & (types[:, 3] >= 12)
    end, spilled = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=bool)
    np.maximum.at(end, cells.row, cells.end)
    spilled[cells.row[cells.overflow > 0]] = True
    kept = (np.bincount(cells.row, weights=~fits, minlength=count) == 0) & (end > 0)
    kept &= ~spilled | (end == page_size)
    reserved = np.where(spilled, _SPILLED, page_size - end)[kept]
    return np.bincount(reserved[reserved <= _SPILLED], minlength=_SPILLED + 1)


def free_pages(pages: Pages, header: Header) -> Mask:
    """(P+1,) pages in the list of free ones: they may still hold what was deleted."""
    free = np.zeros(pages.count + 1, dtype=bool)
    known = max(header.count, pages.count)
    trunk = header.first_free
    while 0 < trunk <= pages.count and not free[trunk]:
        block = pages.read(np.array([trunk]))
        words = block.flat[: pages.usable // 4 * 4].view(">u4").astype(np.int64)
        count, listed = int(words[1]), words[2:]
        if count > len(listed) or words[0] > known:
            break
        listed = listed[:count]
        if ((listed < 2) | (listed > known)).any():
            break
        free[trunk] = True
        free[listed[listed <= pages.count]] = True
        trunk = int(words[0])
    return free
