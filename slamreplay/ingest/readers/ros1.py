"""ROS 1 bags, version 2.0: chunks by their index, in threads; unclosed and cut bags as well."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.errors import LogError
from slamreplay.geometry.times import NS_PER_S
from slamreplay.ingest.readers import ros1_records as r
from slamreplay.ingest.readers.compression import Bytes, decompress
from slamreplay.ingest.readers.damage import Damage
from slamreplay.ingest.readers.positioned import read_at
from slamreplay.ingest.readers.reader import Block
from slamreplay.ingest.readers.ros1_scan import Chunk, codec_of, cut_content, from_index, from_scan
from slamreplay.ingest.readers.windows import compact, loaded
from slamreplay.ingest.wire.places import gather

MAGIC = b"#ROS"  # "#ROSBAG V2.0", and "#ROSRECORD V1.2" of the years before 2010


@dataclass(frozen=True)
class _Loaded:
    """A chunk that was read: its wanted messages, and what was wrong."""

    chunk: Chunk
    block: Block | None
    problem: str = ""
    is_index_wrong: bool = False


class Ros1Reader:
    """One .bag file.

    A damaged chunk is lost and counted, the whole messages before the damage are kept; a bag that
    was cut is read up to the cut.

    Raises:
        LogError: another version of the format, or nothing readable in it.
    """

    def __init__(self, path: Path, source: Source) -> None:
        self.sources = (source,)
        self._path = path
        with path.open("rb") as stream:
            magic = stream.readline(64)
        if magic.strip() != r.MAGIC.strip():
            version = magic.decode("ascii", "replace").strip().lstrip("#")
            raise LogError(
                f"bag format '{version}' is not supported",
                where=path,
                hint="convert it with 'rosbag fix' of ROS 1",
            )
        self._damage = Damage(path.name)
        self._contents = from_index(path) or from_scan(path, self._damage)
        self._damage.keep()
        counts = self._contents.counts
        self.connections = tuple(
            replace(connection, count=counts[number])
            for number, connection in self._contents.connections.items()
        )
        if not self.connections and self.losses:
            raise LogError(self.losses[0].reason, where=path)

    @property
    def losses(self) -> list[Loss]:
        """See `Reader`."""
        return self._damage.losses()

    def blocks(self, wanted: Collection[int]) -> Iterator[Block]:
        """See `Reader`."""
        self._damage.clear()
        contents = self._contents
        indices = {n: c.index for n, c in contents.connections.items() if c.index in wanted}
        table = np.full(max(indices, default=0) + 1, -1, dtype=np.int64)
        for number, index in indices.items():
            table[number] = index
        lost = read = 0
        with self._path.open("rb") as stream:
            for window in loaded(
                contents.chunks, lambda c: c.size, lambda c: _load(stream, c, table)
            ):
                for part in window:
                    lost += bool(part.problem)
                    self._tell(part)
                blocks = [p.block for p in window if p.block is not None and len(p.block)]
                if blocks:
                    block = Block.joined(blocks)
                    read += len(block)
                    yield block
        if contents.cut is not None:
            block, _ = _by_walking(cut_content(self._path, contents.cut), table)
            if len(block):
                self._damage.good(int(block.t_log_ns.max()))
            reason = "the file is cut within a chunk; what is whole of it is read"
            left = self._path.stat().st_size - contents.cut
            self._damage.lose("chunks", reason, at=contents.cut, size=left)
            read += len(block)
            if len(block):
                yield block
        missing = sum(contents.counts[number] for number in indices) - read
        if missing > 0 and lost:
            self._damage.count_messages(missing)
        elif missing > 0:
            self._damage.lose("messages", "its index counts more than it holds", count=missing)

    def _tell(self, part: _Loaded) -> None:
        if part.problem:
            size = part.chunk.end - part.chunk.start
            self._damage.lose("chunks", part.problem, at=part.chunk.start, size=size)
        elif part.is_index_wrong:
            self._damage.mend("chunks", "the index of the chunk is wrong; read without it")
        if part.block is not None and len(part.block):
            self._damage.good(int(part.block.t_log_ns.max()))


def _load(stream: BinaryIO, chunk: Chunk, table: np.ndarray) -> _Loaded:
    """Read and decompress one chunk; called in threads."""
    raw = memoryview(read_at(stream, chunk.start, chunk.end - chunk.start))
    codec = "none"
    try:
        begin = 4 + r.u32(raw)
        header = r.fields(raw[4:begin])
        if r.opcode(header) != r.CHUNK:
            return _Loaded(chunk, None, "there is no chunk where the index says")
        end = begin + 4 + r.u32(raw, begin)
        codec = codec_of(header)
        content = decompress(raw[begin + 4 : end], codec, r.u32(header[b"size"]))
    except (ValueError, struct.error) as error:
        return _Loaded(chunk, None, f"damaged chunk ({codec}): {error}")
    block = _by_index(content, raw[end:], table)
    if block is not None:
        return _Loaded(chunk, compact(block))
    block, problem = _by_walking(content, table)
    if problem:
        return _Loaded(chunk, compact(block), f"damaged chunk ({codec}): {problem}")
    return _Loaded(chunk, compact(block), is_index_wrong=end < len(raw))


def _by_index(content: Bytes, index: Bytes, table: np.ndarray) -> Block | None:
    """Wanted messages where the chunk's index records put them; None where these are wrong."""
    data = np.frombuffer(content, dtype=np.uint8)
    found = []
    try:
        for header, begin, end in r.records(index):
            number = r.u32(header[b"conn"]) if r.opcode(header) == r.INDEX else -1
            if not 0 <= number < len(table):
                continue
            places = r.index_offsets(index[begin:end], r.u32(header[b"count"]))
            block = _messages(data, places, number)
            if block is None:
                return None
            found.append(replace(block, connection=np.full(len(block), table[number])))
    except (ValueError, struct.error):
        return None
    if not found:
        return None
    start = np.concatenate([b.start for b in found])
    connection = np.concatenate([b.connection for b in found])
    order = np.argsort(start, kind="stable")
    order = order[connection[order] >= 0]
    return Block(
        data,
        connection[order],
        start[order],
        np.concatenate([b.end for b in found])[order],
        np.concatenate([b.t_log_ns for b in found])[order],
    )


def _messages(data: np.ndarray, at: np.ndarray, number: int) -> Block | None:
    """The message records of one connection at `at` (N,); None where one of them is none.

    Their headers are alike but for the time, so that the first one tells where its fields are.
    """
    if not len(at) or at.max() + 4 > len(data):
        return None
    lengths = gather(data, at, 0, 4).view("<u4")[:, 0]
    length = int(lengths[0])
    if (lengths != length).any() or at.max() + 8 + length > len(data):
        return None
    heads = gather(data, at, 4, length)
    first = heads[0].tobytes()
    header = r.fields(first)
    if r.opcode(header) != r.MESSAGE or r.u32(header[b"conn"]) != number:
        return None
    time = first.find(b"\x0d\x00\x00\x00time=") + 9
    alike = heads == heads[0]
    alike[:, time : time + 8] = True
    if not alike.all():
        return None
    seconds = np.ascontiguousarray(heads[:, time : time + 8]).view("<u4").astype(np.int64)
    sizes = gather(data, at, 4 + length, 4).view("<u4")[:, 0].astype(np.int64)
    start = at + 8 + length
    if np.any(start + sizes > len(data)):
        return None
    t_log_ns = seconds[:, 0] * NS_PER_S + seconds[:, 1]
    return Block(data, np.zeros(len(at), dtype=np.int64), start, start + sizes, t_log_ns)


def _by_walking(content: Bytes, table: np.ndarray) -> tuple[Block, str]:
    """Wanted messages record by record, and what ended the walk before the content did."""
    found = []
    problem = ""
    try:
        for header, begin, end in r.records(content):
            if r.opcode(header) == r.MESSAGE:
                number = r.u32(header[b"conn"])
                if number < len(table) and table[number] >= 0:
                    found.append((int(table[number]), begin, end, r.stamp_ns(header[b"time"])))
    except (ValueError, struct.error) as error:
        problem = str(error)
    return Block.of(content, found), problem
