"""One pass over the pages of an SQLite file: its structure, and every cell that is a message."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from slamreplay.ingest.readers.sqlite.btree import Cells
from slamreplay.ingest.readers.sqlite.numbers import Bytes, Ints, Mask, signed, type_bytes
from slamreplay.ingest.readers.sqlite.pages import Pages
from slamreplay.ingest.readers.sqlite.tree import HIGHEST, LOWEST, Structure

#: Columns of `messages` in every version of rosbag2's schema; `id` is the row id.
MESSAGE_COLUMNS = ("id", "topic_id", "timestamp", "data")
_NULL, _BLOB, _TEXT = 0, 12, 13


@dataclass(frozen=True, eq=False)
class MessageCells:
    """Where messages are; small numbers, for there may be millions.

    Attributes:
        id: (N,) int64, number of the message.
        topic_id: (N,) int64, number of its topic.
        t_log_ns: (N,) int64, log time.
        page: (N,) uint32, leaf page.
        body: (N,) uint32, where the record starts, from the page's start.
        payload: (N,) uint32, bytes of the record.
        overflow: (N,) uint32, first overflow page, 0 for none.
        spilled: (N,) uint32, bytes of the record on overflow pages.
        data: (N,) uint32, where the data starts, from the record's start.
        size: (N,) uint32, bytes of data.
    """

    id: Ints
    topic_id: Ints
    t_log_ns: Ints
    page: NDArray[np.uint32]
    body: NDArray[np.uint32]
    payload: NDArray[np.uint32]
    overflow: NDArray[np.uint32]
    spilled: NDArray[np.uint32]
    data: NDArray[np.uint32]
    size: NDArray[np.uint32]

    def __len__(self) -> int:
        return len(self.id)

    def take(self, index: Ints | Mask) -> Self:
        """The cells at an index array or a mask."""
        return type(self)(**{f.name: getattr(self, f.name)[index] for f in fields(self)})

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Cells of several parts (at least one), one after the other."""
        names = [f.name for f in fields(cls)]
        return cls(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})


@dataclass(frozen=True, eq=False)
class Scan:
    """What one pass finds. Arrays over pages have an entry 0 that stands for no page.

    Attributes:
        structure: what the pages say of themselves.
        links: (P+1,) next page of each, were it an overflow page.
        present: (P+1,) bytes of each page that the file has.
        others: (P+1,) cells on leaf pages that are no messages.
        texts: (P+1,) whether a leaf page has rows that begin with a text, as topics do.
        messages: cells that are messages, those of deleted messages included.
        chains: (C, 3) leaf page, first overflow page and overflow bytes of what is no message.
    """

    structure: Structure
    links: Ints
    present: Ints
    others: Ints
    texts: Mask
    messages: MessageCells
    chains: Ints


def scan(pages: Pages, names: Sequence[str] = MESSAGE_COLUMNS) -> Scan:
    """Read all pages once; `names` are the columns of `messages`."""
    count = pages.count + 1
    kinds: Bytes = np.zeros(count, dtype=np.uint8)
    smallest, largest = np.full(count, LOWEST), np.full(count, HIGHEST)
    damaged, texts = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    links, present, others = (np.zeros(count, dtype=np.int64) for _ in range(3))
    edges, messages, chains = [], [], [np.zeros((0, 3), dtype=np.int64)]
    for block in pages.blocks():
        numbers = block.numbers
        kinds[numbers] = block.kinds
        links[numbers] = block.links
        present[numbers] = block.present
        children = block.edges()
        edges.append(np.stack([children.parent, children.child, children.key]))
        damaged[children.damaged] = True
        inner = children.key != HIGHEST
        _bound(smallest, largest, children.parent[inner], children.key[inner])

        cells = block.cells()
        damaged[cells.damaged] = True
        _bound(smallest, largest, cells.page[cells.sound], cells.rowid[cells.sound])
        found, is_message, is_text = _messages(cells, names)
        messages.append(found)
        other = cells.row[~is_message & cells.placed]
        others[numbers] = np.bincount(other, minlength=len(numbers))
        texts[cells.page[is_text]] = True
        spilled = cells.sound & ~is_message & (cells.overflow > 0)
        spill = np.stack([cells.page, cells.overflow, cells.payload - cells.local], axis=1)
        chains.append(spill[spilled])
    parent, child, key = np.concatenate([np.zeros((3, 0), dtype=np.int64), *edges], axis=1)
    return Scan(
        Structure(kinds, smallest, largest, damaged, parent, child, key),
        links,
        present,
        others,
        texts,
        MessageCells.joined(messages),
        np.concatenate(chains),
    )


def _bound(smallest: Ints, largest: Ints, page: Ints, key: Ints) -> None:
    """Set the bounds of pages that have keys."""
    if len(page):
        smallest[page], largest[page] = HIGHEST, LOWEST
        np.minimum.at(smallest, page, key)
        np.maximum.at(largest, page, key)


def _messages(cells: Cells, names: Sequence[str]) -> tuple[MessageCells, Mask, Mask]:
    """The cells that are messages, which they are, and which begin with a text."""
    types, whole = cells.types(len(names))
    sizes = type_bytes(types)
    topic, time, data = (names.index(name) for name in MESSAGE_COLUMNS[1:])
    is_message = whole & (types[:, data] >= _BLOB) & (types[:, data] % 2 == 0)
    if "id" in names:
        is_message &= types[:, names.index("id")] == _NULL
    starts = cells.payload[:, None] - np.cumsum(sizes[:, ::-1], axis=1)[:, ::-1]
    for column in (topic, time):
        kind = types[:, column]
        is_message &= ((kind >= 1) & (kind <= 6)) | (kind == 8) | (kind == 9)
        is_message &= starts[:, column] + sizes[:, column] <= cells.local
    is_text = cells.sound & (types[:, 0] == _NULL) & (types[:, 1] >= _TEXT) & (types[:, 1] % 2 == 1)

    kept = np.flatnonzero(is_message)
    flat, body = cells.block.flat, cells.body[kept]
    topic_id, t_log_ns = (
        signed(flat, body + starts[kept, column], types[kept, column]) for column in (topic, time)
    )
    small = (
        cells.page[kept],
        body - cells.block.starts[cells.row[kept]],
        cells.payload[kept],
        cells.overflow[kept],
        cells.payload[kept] - cells.local[kept],
        starts[kept, data],
        sizes[kept, data],
    )
    columns = (values.astype(np.uint32) for values in small)
    found = MessageCells(cells.rowid[kept], topic_id, t_log_ns, *columns)
    return found, is_message, is_text & ~is_message
