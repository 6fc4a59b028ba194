"""MCAP files of any profile: chunks by their index, in threads, checksums verified."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import BinaryIO

import numpy as np

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.errors import LogError
from slamreplay.ingest.readers import mcap_records as m
from slamreplay.ingest.readers.compression import Bytes, decompress
from slamreplay.ingest.readers.damage import Damage
from slamreplay.ingest.readers.mcap_scan import Contents, cut_content, from_scan, from_summary
from slamreplay.ingest.readers.positioned import read_at
from slamreplay.ingest.readers.reader import WINDOW_BYTES, Block, Connection, normalise_type
from slamreplay.ingest.readers.windows import compact, loaded
from slamreplay.ingest.wire.places import gather

MAGIC = m.MAGIC
_FORMATS = {"ros1msg": "msg", "ros2msg": "msg", "ros2idl": "idl"}


@dataclass(frozen=True)
class _Chunk:
    """A chunk that was read: its wanted messages, or why there are none."""

    index: m.ChunkIndex
    block: Block | None
    problem: str = ""
    is_index_wrong: bool = False


class McapReader:
    """One .mcap file.

    A chunk whose checksum or compression is broken is lost and counted, the rest is kept; a file
    that was cut is read up to the cut, the whole messages of the cut chunk included.

    Raises:
        LogError: nothing readable in it.
    """

    def __init__(self, path: Path, source: Source) -> None:
        self.sources = (source,)
        self._path = path
        self._damage = Damage(path.name)
        self._contents: Contents = from_summary(path) or from_scan(path, self._damage)
        self._damage.keep()
        channels = self._contents.channels
        self._indices = {number: index for index, number in enumerate(sorted(channels))}
        self.connections = tuple(self._connection(number) for number in sorted(channels))
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
        numbers = {number for number, index in self._indices.items() if index in wanted}
        table = np.full(65536, -1, dtype=np.int64)  # channel numbers are 16 bits wide
        for number in numbers:
            table[number] = self._indices[number]
        chunks = [c for c in contents.chunks if c.channels is None or c.channels & numbers]
        lost = read = 0
        with self._path.open("rb") as stream:
            for window in loaded(chunks, lambda c: c.size, lambda c: _load(stream, c, table)):
                for chunk in window:
                    lost += bool(chunk.problem)
                    self._tell(chunk)
                blocks = [c.block for c in window if c.block is not None and len(c.block)]
                if blocks:
                    block = Block.joined(blocks)
                    read += len(block)
                    yield block
            for block in chain(self._loose(stream, table), self._cut(table)):
                read += len(block)
                yield block
        missing = sum(contents.counts[number] for number in numbers) - read
        if missing > 0 and lost:
            self._damage.count_messages(missing)
        elif missing > 0:
            self._damage.lose("messages", "its statistics count more than it holds", count=missing)

    def _tell(self, chunk: _Chunk) -> None:
        if chunk.problem:
            size = chunk.index.length
            self._damage.lose("chunks", chunk.problem, at=chunk.index.start, size=size)
        elif chunk.is_index_wrong:
            self._damage.mend("chunks", "the index of the chunk is wrong; read without it")
        if chunk.block is not None and len(chunk.block):
            self._damage.good(int(chunk.block.t_log_ns.max()))

    def _loose(self, stream: BinaryIO, table: np.ndarray) -> Iterator[Block]:
        """Messages outside of chunks, a window of the file at a time."""
        places = np.array(self._contents.loose, dtype=np.int64).reshape(-1, 2)
        at = 0
        while at < len(places):
            begin = int(places[at, 0])
            stop = int(np.searchsorted(places[:, 1], begin + WINDOW_BYTES, side="right"))
            stop = max(stop, at + 1)
            part = places[at:stop] - begin
            stream.seek(begin)
            data = np.frombuffer(stream.read(int(part[-1, 1])), dtype=np.uint8)
            block = _by_places(data, part[:, 0], table)
            if block is not None and len(block):
                self._damage.good(int(block.t_log_ns.max()))
                yield compact(block)
            at = stop

    def _cut(self, table: np.ndarray) -> Iterator[Block]:
        at = self._contents.cut
        if at is None:
            return
        content = cut_content(self._path, at)
        block = _by_walking(content, table)
        if len(block):
            self._damage.good(int(block.t_log_ns.max()))
        reason = "the file is cut within a chunk; what is whole of it is read"
        left = self._path.stat().st_size - at
        self._damage.lose("chunks", reason, at=at, size=left)
        if len(block):
            yield block

    def _connection(self, number: int) -> Connection:
        channel = self._contents.channels[number]
        schema = self._contents.schemas.get(channel.schema)
        form = _FORMATS.get(schema.encoding, schema.encoding) if schema else ""
        is_text = schema is not None and schema.encoding in _FORMATS
        return Connection(
            self._indices[number],
            channel.topic,
            normalise_type(schema.name) if schema else "",
            channel.encoding,
            schema.data.decode("utf-8", "replace") if schema and is_text else "",
            form,
            self._contents.counts[number],
            schema.data if schema else b"",
        )


def _load(stream: BinaryIO, chunk: m.ChunkIndex, table: np.ndarray) -> _Chunk:
    """Read, decompress and check one chunk; called in threads."""
    raw = memoryview(read_at(stream, chunk.start, chunk.length + chunk.index_length))
    try:
        opcode, length = struct.unpack_from("<BQ", raw)
        if opcode != m.CHUNK or m.HEAD + length != chunk.length:
            return _Chunk(chunk, None, "there is no chunk where the index says")
        record = raw[m.HEAD : chunk.length]
        head = m.chunk_head(record)
        packed = record[head.at : head.at + head.compressed]
        content = decompress(packed, head.compression, head.size)
    except (ValueError, struct.error) as error:
        return _Chunk(chunk, None, f"damaged chunk: {error}")
    if head.crc and zlib.crc32(content) != head.crc:
        return _Chunk(chunk, None, "damaged chunk: its checksum differs")
    block = None
    if chunk.index_length:
        block = _by_index(content, raw[chunk.length :], table)
    is_index_wrong = bool(chunk.index_length) and block is None
    if block is None:
        block = _by_walking(content, table)
        if not m.is_sequence(content):
            return _Chunk(chunk, compact(block), "damaged chunk: its records break off")
    return _Chunk(chunk, compact(block), is_index_wrong=is_index_wrong)


def _by_index(content: Bytes, index: Bytes, table: np.ndarray) -> Block | None:
    """Messages where the chunk's index records put them; None where these are wrong."""
    data = np.frombuffer(content, dtype=np.uint8)
    places = []
    try:
        for opcode, begin, end in m.records(index):
            if opcode == m.MESSAGE_INDEX:
                number, offsets = m.message_index(index[begin:end])
                if table[number] >= 0:
                    places.append(offsets)
    except (ValueError, struct.error):
        return None
    at = np.sort(np.concatenate(places)) if places else np.empty(0, dtype=np.int64)
    return _by_places(data, at, table)


def _by_places(data: np.ndarray, at: np.ndarray, table: np.ndarray) -> Block | None:
    """Wanted messages of the records at `at` (N,); None where one of them is no message."""
    whole = m.HEAD + m.MESSAGE_HEAD
    if len(at) and (at.min() < 0 or at.max() + whole > len(data)):
        return None
    lengths = gather(data, at, 1, 8).view("<u8")[:, 0]
    fits = (data[at] == m.MESSAGE) & (lengths >= m.MESSAGE_HEAD) & (lengths < len(data))
    ends = at + m.HEAD + np.where(fits, lengths, 0).astype(np.int64)
    if not fits.all() or np.any(ends > len(data)):
        return None
    connection = table[gather(data, at, m.HEAD, 2).view("<u2")[:, 0]]
    keep = connection >= 0
    at, ends = at[keep], ends[keep]
    t_log_ns = gather(data, at, m.HEAD + 6, 8).view("<u8")[:, 0].astype(np.int64)
    return Block(data, connection[keep], at + whole, ends, t_log_ns)


def _by_walking(content: Bytes, table: np.ndarray) -> Block:
    """Wanted messages of a chunk's content, record by record, as far as they are whole."""
    found = []
    head = struct.Struct("<HIQ").unpack_from
    for opcode, begin, end in m.records(content):
        if opcode == m.MESSAGE and end - begin >= m.MESSAGE_HEAD:
            number, _, t_log_ns = head(content, begin)
            if table[number] >= 0:
                t_log_ns = min(t_log_ns, 2**63 - 1)
                found.append((int(table[number]), begin + m.MESSAGE_HEAD, end, t_log_ns))
    return Block.of(content, found)
