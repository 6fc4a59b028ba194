"""What is in a ROS 1 bag: by its own index, or by passing over all of it.

A bag that was never closed has no index; one that was cut has none that holds; where records are
broken, the next chunk is looked for by its header, so that damage costs what lies before it.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from slamreplay.ingest.readers import ros1_records as r
from slamreplay.ingest.readers.compression import Bytes, decompress, decompress_start
from slamreplay.ingest.readers.damage import Damage
from slamreplay.ingest.readers.reader import Connection, normalise_type

_STEP = 4_000_000
#: A chunk's header has three fields, written in any order; its `op` is one of them.
_CHUNK_OP = re.compile(rb"\x04\x00\x00\x00op=\x05")
_LONGEST_HEADER = 200


@dataclass(frozen=True)
class Chunk:
    """A chunk: its first byte, one past its index records, its content's size."""

    start: int
    end: int
    size: int


@dataclass
class Contents:
    """What a bag holds.

    Attributes:
        connections: by their number in the bag.
        counts: messages by that number.
        chunks: in the order of the file.
        cut: first byte of a chunk that the file ends in.
        seen: sizes and checksums of the chunks that were passed over.
        twice: chunks that are in the file a second time.
    """

    connections: dict[int, Connection] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    chunks: list[Chunk] = field(default_factory=list)
    cut: int | None = None
    seen: set[tuple[int, int]] = field(default_factory=set)
    twice: int = 0

    def learn(self, header: r.Header, data: Bytes) -> None:
        """A connection record; the first of a number counts."""
        number = r.u32(header[b"conn"])
        if number in self.connections:
            return
        said = r.fields(data)
        topic = header.get(b"topic", said.get(b"topic", b"")).decode("utf-8", "replace")
        kind = normalise_type(said.get(b"type", b"").decode("utf-8", "replace"))
        text = said.get(b"message_definition", b"").decode("utf-8", "replace")
        index = len(self.connections)
        self.connections[number] = Connection(index, topic, kind, "ros1", text, "msg", 0)


def from_index(path: Path) -> Contents | None:
    """What the index at the end says; None where there is none or it does not hold."""
    size = path.stat().st_size
    contents = Contents()
    try:
        with path.open("rb") as stream:
            stream.seek(len(r.MAGIC))
            header, _ = record(stream, size)
            if r.opcode(header) != r.BAG:
                return None
            (index_pos,) = struct.unpack("<Q", header[b"index_pos"])
            if not len(r.MAGIC) < index_pos <= size:
                return None
            starts = _read_index(contents, stream, index_pos, size)
            if len(starts) != r.u32(header[b"chunk_count"]):
                return None
            for start, end in zip(starts, [*starts[1:], index_pos], strict=True):
                if not len(r.MAGIC) < start < end:
                    return None
                contents.chunks.append(Chunk(start, end, _content_size(stream, start, size)))
    except (ValueError, struct.error):
        return None
    return contents if set(contents.counts) <= set(contents.connections) else None


def _read_index(contents: Contents, stream: BinaryIO, index_pos: int, size: int) -> list[int]:
    """Learn connections and counts; first bytes of the chunks, sorted."""
    starts = []
    stream.seek(index_pos)
    while stream.tell() < size:
        header, data = record(stream, size)
        kind = r.opcode(header)
        if kind == r.CONNECTION:
            contents.learn(header, data)
        elif kind == r.CHUNK_INFO:
            starts.append(struct.unpack("<Q", header[b"chunk_pos"])[0])
            for number, count in struct.iter_unpack("<II", data):
                contents.counts[number] += count
    return sorted(starts)


def from_scan(path: Path, damage: Damage) -> Contents:
    """What passing over the bag gives, as far as its records go."""
    contents = Contents()
    size = path.stat().st_size
    with path.open("rb") as stream:
        at = len(r.MAGIC)
        while at < size:
            stream.seek(at)
            try:
                header, data = record(stream, size)
                _take(contents, header, data, at, stream.tell())
                at = stream.tell()
                continue
            except (ValueError, struct.error):
                pass
            content = cut_content(path, at)
            following = _next_chunk(stream, at + 1, size)
            if content and following is None:
                contents.cut = at
                _count(contents, content)
                break
            reason = "the file is cut" if following is None else "broken records between chunks"
            lost = (following or size) - at
            damage.lose("bytes", reason, at=at, count=lost, size=lost)
            if following is None:
                break
            at = following
    damage.mend("files", "read without an index: never closed, cut, or its index is broken")
    if contents.twice:
        damage.mend("chunks", "written twice, read once", contents.twice)
    return contents


def _take(contents: Contents, header: r.Header, data: bytes, at: int, end: int) -> None:
    kind = r.opcode(header)
    if kind == r.CHUNK:
        size = r.u32(header[b"size"])
        content_of = (size, zlib.crc32(data))
        if content_of in contents.seen:  # stamps differ, so no two chunks are alike
            contents.twice += 1
            return
        contents.seen.add(content_of)
        contents.chunks.append(Chunk(at, end, size))
        try:
            _count(contents, decompress(data, codec_of(header), size))
        except ValueError:
            contents.chunks[-1] = Chunk(at, end, 0)  # reading it tells
    elif kind == r.CONNECTION:
        contents.learn(header, data)
    elif kind == r.INDEX and contents.chunks:
        last = contents.chunks[-1]
        if not last.size:  # the chunk before could not be read
            contents.counts[r.u32(header[b"conn"])] += r.u32(header[b"count"])
        contents.chunks[-1] = Chunk(last.start, end, last.size)


def _count(contents: Contents, content: Bytes) -> None:
    try:
        for header, begin, end in r.records(content):
            kind = r.opcode(header)
            if kind == r.CONNECTION:
                contents.learn(header, content[begin:end])
            elif kind == r.MESSAGE:
                contents.counts[r.u32(header[b"conn"])] += 1
    except (ValueError, struct.error):
        return  # those before are good; reading tells of the rest


def codec_of(header: r.Header) -> str:
    """The compression of a chunk record."""
    return header.get(b"compression", b"none").decode("ascii", "replace")


def cut_content(path: Path, at: int) -> Bytes:
    """As much of the content of the chunk that begins at `at` as the file still has.

    Empty where no chunk begins there, or where the file does not end in it.
    """
    size = path.stat().st_size
    try:
        with path.open("rb") as stream:
            stream.seek(at)
            header = r.fields(_block(stream, size))
            length = r.u32(stream.read(4))
            if r.opcode(header) != r.CHUNK or stream.tell() + length <= size:
                return b""
            return decompress_start(stream.read(), codec_of(header))
    except (ValueError, struct.error):
        return b""


def record(stream: BinaryIO, size: int) -> tuple[dict[bytes, bytes], bytes]:
    """Header and data of the record at the stream's place, of a file of this size.

    Raises:
        ValueError, struct.error: it is broken or cut.
    """
    return r.fields(_block(stream, size)), _block(stream, size)


def _block(stream: BinaryIO, size: int) -> bytes:
    count = r.u32(stream.read(4))
    if count > size:
        raise ValueError(f"a length of {count} bytes")
    data = stream.read(count)
    if len(data) < count:
        raise ValueError("the file ends within a record")
    return data


def _content_size(stream: BinaryIO, start: int, size: int) -> int:
    stream.seek(start)
    header = r.fields(_block(stream, size))
    if r.opcode(header) != r.CHUNK:
        raise ValueError("there is no chunk where the index says")
    return r.u32(header[b"size"])


def _next_chunk(stream: BinaryIO, at: int, size: int) -> int | None:
    """First byte of the next chunk record at `at` or behind it."""
    while at < size:
        stream.seek(at)
        window = stream.read(_STEP + _LONGEST_HEADER)
        for match in _CHUNK_OP.finditer(window):
            # The record's own length stands before the first of its fields.
            for back in range(4, min(_LONGEST_HEADER, match.start()) + 1):
                begin = match.start() - back
                if _is_chunk_header(window, begin, match.start()):
                    return at + begin
        at += _STEP
    return None


def _is_chunk_header(window: bytes, begin: int, op: int) -> bool:
    try:
        end = begin + 4 + r.u32(window, begin)
        if not op < end <= begin + _LONGEST_HEADER:
            return False
        return r.opcode(r.fields(window[begin + 4 : end])) == r.CHUNK
    except (ValueError, struct.error):
        return False
