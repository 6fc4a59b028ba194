"""What can still be read of a damaged .db3 of rosbag2, by its pages and without a database engine.

Where the b-tree of messages can be followed, it says which pages count. Where it has holes, leaf
pages that nobody claims fill them, but for those that are free: they may hold what was deleted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slamreplay.bundle.manifest import Loss
from slamreplay.ingest.readers.sqlite.btree import INDEX_PAGES, INTERIOR
from slamreplay.ingest.readers.sqlite.layout import Header, free_pages, open_pages
from slamreplay.ingest.readers.sqlite.numbers import Ints, Mask
from slamreplay.ingest.readers.sqlite.overflow import Chains
from slamreplay.ingest.readers.sqlite.pages import Pages
from slamreplay.ingest.readers.sqlite.rosbag2 import (
    SMALL_TABLES,
    Schema,
    Topic,
    read_definitions,
    read_topics,
)
from slamreplay.ingest.readers.sqlite.scan import MessageCells, Scan
from slamreplay.ingest.readers.sqlite.tree import (
    HIGHEST,
    Tree,
    absent,
    merged,
    no_tree,
    walk,
    within,
)

_LOCK_BYTE = 1 << 30  # the page with this byte is never used
_BATCH_BYTES = 1 << 24


@dataclass(frozen=True, eq=False)
class Salvaged:
    """What was found in a file.

    Attributes:
        topics: number, name, type and serialisation format of each topic, by number.
        definitions: encoding and text of each type's definition.
        counts: messages of each topic number, those of topics whose row is gone included.
        lost: messages that are known to be lost. Where pages are missing they are counted by the
            numbers that are missing: at most so many, if messages had been deleted before.
        unread_bytes: bytes cut off, and of pages that could not be put to any use.
        last_good_ns: log time of the message with the highest number; None without messages.
    """

    topics: list[Topic]
    definitions: dict[str, tuple[str, str]]
    counts: Mapping[int, int]
    lost: int
    unread_bytes: int
    last_good_ns: int | None
    _payloads: _Payloads | None = None

    @property
    def untopiced(self) -> int:
        """Messages whose topic is in no row: nobody can say what they are."""
        known = {number for number, *_ in self.topics}
        return sum(count for number, count in self.counts.items() if number not in known)

    def losses(self, name: str) -> list[Loss]:
        """What is missing from the file of this name."""
        found = [
            ("messages", self.lost, "on damaged or missing pages"),
            ("bytes", self.unread_bytes, "cut off, or pages of no use"),
            ("messages", self.untopiced, "the row that names their topic is gone"),
        ]
        return [
            Loss(
                kind="lost",
                what=f"{name}: {what}",
                count=count,
                reason=reason,
                bytes=count if what == "bytes" else None,
                last_good_ns=self.last_good_ns,
            )
            for what, count, reason in found
            if count
        ]

    def messages(self, after: int | None = None) -> Iterator[tuple[int, int, bytes]]:
        """Topic number, log time in ns and data of the messages, in the order of their numbers.

        Args:
            after: only messages with larger numbers.
        """
        if self._payloads is not None:
            yield from self._payloads.read(after)


def salvage(path: Path) -> Salvaged:
    """Read a database of rosbag2 as far as its pages go, its write-ahead log (-wal) included.

    Nothing is written, in the file or beside it. SQLite has no checksums: a byte that is damaged
    within a message, its log time or its topic number goes unseen.

    Raises:
        OSError: the file cannot be read.
    """
    opened = open_pages(path)
    if opened is None:
        return Salvaged([], {}, {}, 0, path.stat().st_size, None)
    pages, header = opened
    schema = Schema.read(pages)
    found = schema.scan(pages)
    free = free_pages(pages, header)

    small = {name: _tree(found, schema.root(name, found)) for name in SMALL_TABLES}
    claimed = np.any([t.pages for t in (_tree(found, 1), *small.values())], axis=0)
    strays = found.texts & ~claimed & ~free
    topics = read_topics(pages, schema, small["topics"], strays)
    definitions = read_definitions(pages, schema, small["message_definitions"], strays)
    claimed |= strays

    tree = _message_tree(found, schema.root("messages", found), claimed | free)
    attached, orphans = _chosen(found.messages, tree, claimed | free)
    lost = _lost_on_leaves(found, tree, attached)
    claimed |= tree.pages
    claimed[orphans.page] = True
    chains = Chains(found.links, (found.present == pages.page_size) & ~claimed & ~free)
    cells, broken = _with_chains(chains, attached, orphans, pages.usable - 4)
    for name in schema.roots:
        claimed |= _tree(found, schema.root(name, found)).pages
    chains.claim(*_other_chains(found, claimed, pages.usable - 4))

    claimed |= chains.taken | free
    claimed = _in_use(found, claimed)
    unread = _unread_pages(pages, header, found, schema, claimed)
    # Numbers that are missing are no loss where every page is accounted for.
    fullest = int(np.bincount(cells.page).max()) if len(cells) else pages.usable
    seen = np.sort(np.concatenate([attached.id, orphans.id]))
    gaps = int(np.minimum(absent(merged(tree.gaps), seen), 1 << 40).sum())
    numbers, counts = np.unique(cells.topic_id, return_counts=True)
    return Salvaged(
        topics,
        definitions,
        dict(zip(numbers.tolist(), counts.tolist(), strict=True)),
        lost + broken + min(gaps, unread * fullest),
        unread * pages.page_size,
        int(cells.t_log_ns[-1]) if len(cells) else None,
        _Payloads(pages, chains, cells),
    )


def _tree(found: Scan, root: int) -> Tree:
    return walk(found.structure, root) if root else no_tree(len(found.links) - 1)


def _message_tree(found: Scan, root: int, barred: Mask) -> Tree:
    """The tree of messages; where its root is unknown or wrong, the one there can be."""
    holding = np.zeros_like(barred)
    holding[found.messages.page] = True
    holding &= ~barred
    tree = _tree(found, root)
    if (tree.pages & holding).any() or not holding.any():
        return tree
    # A table's root keeps its place, which is before the first of its other pages.
    structure = found.structure
    parents = np.unique(structure.parent)
    tops = parents[~np.isin(parents, structure.child) & ~barred[parents]]
    tops = tops[tops < np.argmax(holding)]
    trees = [walk(structure, int(top)) for top in tops]
    trees = [tree for tree in trees if (tree.pages & holding).any()]
    return trees[0] if len(trees) == 1 else no_tree(len(barred) - 1)


def _chosen(messages: MessageCells, tree: Tree, barred: Mask) -> tuple[MessageCells, MessageCells]:
    """Messages of the tree, and of other pages where the tree has holes; each number once."""
    attached = messages.take(tree.pages[messages.page])
    attached = attached.take(np.unique(attached.id, return_index=True)[1])
    fills = ~tree.pages[messages.page] & ~barred[messages.page]
    fills &= within(merged(tree.holes), messages.id) & ~np.isin(messages.id, attached.id)
    orphans = messages.take(fills)
    return attached, orphans.take(np.unique(orphans.id, return_index=True)[1])


def _lost_on_leaves(found: Scan, tree: Tree, attached: MessageCells) -> int:
    """Messages lost on leaf pages of the tree: unsound cells, and numbers seen twice."""
    damaged = found.structure.damaged
    pages, open_end = tree.leaves, tree.ranges[:, 1] == HIGHEST
    unsound, gone = found.others[pages], absent(tree.ranges, attached.id)
    # A damaged page may have had more cells or fewer: the numbers that belong there tell, but for
    # the last page, where nobody knows how many there were.
    told = np.where(unsound > 0, np.minimum(unsound, gone), np.minimum(gone, 1 << 16))
    told = np.where(open_end, np.maximum(np.maximum(unsound, gone), 1), told)
    sound = tree.pages & ~damaged
    twice = int(sound[found.messages.page].sum()) - int(sound[attached.page].sum())
    return int(np.where(damaged[pages], told, unsound).sum()) + twice


def _with_chains(
    chains: Chains, attached: MessageCells, orphans: MessageCells, room: int
) -> tuple[MessageCells, int]:
    """Messages whose overflow pages are there, by number, and how many have lost theirs."""
    parts = [p.take(chains.claim(*_overflow(p, room))) for p in (attached, orphans)]
    cells = MessageCells.joined(parts)
    broken = len(attached) + len(orphans) - len(cells)
    return cells.take(np.argsort(cells.id)), broken


def _overflow(cells: MessageCells, room: int) -> tuple[Ints, Ints]:
    """First overflow page of cells, and how many there are, for `room` bytes on each."""
    return cells.overflow.astype(np.int64), -(-cells.spilled.astype(np.int64) // room)


def _other_chains(found: Scan, claimed: Mask, room: int) -> tuple[Ints, Ints]:
    """Overflow pages of what is no message, on pages that are in use."""
    _, first, spilled = found.chains[claimed[found.chains[:, 0]]].T
    return first, -(-spilled // room)


def _in_use(found: Scan, claimed: Mask) -> Mask:
    """The claimed pages and those of indices, but for pages whose kind cannot be the true one."""
    structure = found.structure
    index = np.isin(structure.kinds, INDEX_PAGES)
    child = structure.child[claimed[structure.parent]]
    index[child[child < len(index)]] = False  # a table's page was this
    return (claimed & ~(structure.damaged & (structure.kinds == INTERIOR))) | index


def _unread_pages(pages: Pages, header: Header, found: Scan, schema: Schema, used: Mask) -> int:
    """Pages that are of no use, or no longer there."""
    unread = int((~used[1:]).sum())
    lock = _LOCK_BYTE // pages.page_size + 1
    if lock <= pages.count and not used[lock]:
        unread -= 1
    # The header may be wrong about its length, unless something was on the pages it names.
    named = [*schema.roots.values(), int(found.structure.child.max(initial=0))]
    if max(named) > pages.count or found.present[-1] < pages.page_size:
        unread += max(header.count - pages.count, 0)
    return unread


@dataclass(frozen=True, eq=False)
class _Payloads:
    """Reads the data of messages, some megabytes at a time."""

    pages: Pages
    chains: Chains
    cells: MessageCells

    def read(self, after: int | None) -> Iterator[tuple[int, int, bytes]]:
        """See `Salvaged.messages`."""
        cells, page_size = self.cells, self.pages.page_size
        first = 0 if after is None else int(np.searchsorted(cells.id, after, "right"))
        most = max(_BATCH_BYTES // page_size, 1)  # each may be on a page of its own
        ends = np.cumsum(cells.payload, dtype=np.int64)
        while first < len(cells):
            before = int(ends[first - 1]) if first else 0
            last = int(np.searchsorted(ends, before + _BATCH_BYTES, "right"))
            last = min(max(last, first + 1), first + most)
            yield from self._batch(cells.take(np.arange(first, last)))
            first = last

    def _batch(self, cells: MessageCells) -> Iterator[tuple[int, int, bytes]]:
        usable, page_size = self.pages.usable, self.pages.page_size
        numbers, row = np.unique(cells.page.astype(np.int64), return_inverse=True)
        leaves = self.pages.read(numbers).flat.data
        bodies = row * page_size + cells.body
        first, counts = _overflow(cells, usable - 4)
        numbers, order = np.unique(self.chains.pages(first, counts), return_inverse=True)
        flat = self.pages.read(numbers).flat
        overflow = flat[: len(numbers) * page_size].reshape(-1, page_size)[:, 4:usable]
        ends = np.cumsum(counts)
        for i, (body, data, size) in enumerate(
            zip(bodies.tolist(), cells.data.tolist(), cells.size.tolist(), strict=True)
        ):
            if counts[i]:
                local = int(cells.payload[i] - cells.spilled[i])
                chain = overflow[order[ends[i] - counts[i] : ends[i]]]
                record = bytes(leaves[body : body + local]) + chain.tobytes()
                payload = record[data : data + size]
            else:
                payload = bytes(leaves[body + data : body + data + size])
            yield int(cells.topic_id[i]), int(cells.t_log_ns[i]), payload
