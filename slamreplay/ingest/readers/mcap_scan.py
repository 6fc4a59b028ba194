"""What is in an MCAP file: by its own summary, or by passing over all of it.

A file that was cut has no summary, a damaged one may lie in it, and an unchunked one has no index
of its messages: these are passed over from front to back. Where the sequence of records breaks, the
next chunk is looked for by its shape, so that a broken record costs what lies before that chunk.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from slamreplay.ingest.readers import mcap_records as m
from slamreplay.ingest.readers.compression import Bytes, decompress, decompress_start
from slamreplay.ingest.readers.damage import Damage

_STEP = 4_000_000
#: A chunk is looked for where the text of its compression stands; those without any are not.
_CODECS = (b"\x04\x00\x00\x00zstd", b"\x03\x00\x00\x00lz4")
#: Content before the text of the compression: two times, size, checksum.
_BEFORE_CODEC = 28


@dataclass
class Contents:
    """What a file holds.

    Attributes:
        schemas: by id.
        channels: by id.
        counts: messages by channel.
        chunks: in the order of the file.
        loose: (offset of the record, one past its end) of messages outside of chunks.
        cut: a chunk that the file ends in, by its first byte.
        seen: sizes and checksums of the chunks that were passed over.
        twice: chunks that are in the file a second time.
    """

    schemas: dict[int, m.Schema] = field(default_factory=dict)
    channels: dict[int, m.Channel] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    chunks: list[m.ChunkIndex] = field(default_factory=list)
    loose: list[tuple[int, int]] = field(default_factory=list)
    cut: int | None = None
    seen: set[tuple[int, int]] = field(default_factory=set)
    twice: int = 0

    def learn(self, opcode: int, record: Bytes) -> None:
        """A schema or channel; the first of a number counts, a broken one does not."""
        try:
            if opcode == m.SCHEMA:
                self.schemas.setdefault(*m.schema(record))
            elif opcode == m.CHANNEL:
                self.channels.setdefault(*m.channel(record))
        except (ValueError, struct.error):
            return


def from_summary(path: Path) -> Contents | None:
    """What the summary says; None where there is none, it is damaged, or it is not complete."""
    size = path.stat().st_size
    summary = summary_of(path, size)
    contents = Contents()
    said = None
    try:
        for opcode, begin, end in m.records(summary):
            record = summary[begin:end]
            contents.learn(opcode, record)
            if opcode == m.CHUNK_INDEX:
                contents.chunks.append(m.chunk_index(record))
            elif opcode == m.STATISTICS:
                said = m.statistics(record)
    except (ValueError, struct.error):
        return None
    if said is None:
        return None
    messages, chunks, counts = said
    whole = set(counts) <= set(contents.channels) and sum(counts.values()) == messages
    # Messages without chunks are ones that nothing says the place of.
    if not whole or chunks != len(contents.chunks) or (messages and not chunks):
        return None
    if any(c.start + c.length + c.index_length > size for c in contents.chunks):
        return None
    contents.counts = Counter(counts)
    contents.chunks.sort(key=lambda c: c.start)
    return contents


def _told(path: Path, size: int) -> dict[int, int]:
    """Messages by channel as the statistics have them; none where there are no statistics."""
    summary = summary_of(path, size)
    for opcode, begin, end in m.records(summary):
        if opcode == m.STATISTICS:
            try:
                return m.statistics(summary[begin:end])[2]
            except (ValueError, struct.error):
                break
    return {}


def summary_of(path: Path, size: int) -> bytes:
    """Records of the summary section; empty where there is none or its checksum differs."""
    with path.open("rb") as stream:
        stream.seek(max(size - m.TAIL, 0))
        tail = stream.read()
        if len(tail) < m.TAIL or tail[-8:] != m.MAGIC or tail[0] != m.FOOTER:
            return b""
        start, _, crc = struct.unpack_from("<QQI", tail, m.HEAD)
        if not 0 < start < size - m.TAIL:
            return b""
        stream.seek(start)
        summary = stream.read(size - m.TAIL - start)
    # The checksum goes over the summary and the footer up to itself.
    if crc and zlib.crc32(tail[: m.HEAD + 16], zlib.crc32(summary)) != crc:
        return b""
    return summary


def from_scan(path: Path, damage: Damage) -> Contents:
    """What passing over the file gives, as far as its records go."""
    contents = Contents()
    size = path.stat().st_size
    with path.open("rb") as stream:
        at = len(m.MAGIC)
        is_closed = False
        while at < size:
            stream.seek(at)
            head = stream.read(m.HEAD)
            if len(head) == m.HEAD:
                opcode, length = struct.unpack("<BQ", head)
                end = at + m.HEAD + length
                if 0 < opcode <= m.DATA_END and end <= size:
                    if opcode in (m.FOOTER, m.DATA_END):
                        is_closed = True
                        break
                    _take(contents, stream, opcode, at, end)
                    at = end
                    continue
                if opcode == m.CHUNK and end > size and _is_chunk(stream, at, length):
                    contents.cut = at
                    _count(contents, _cut_content(stream, at, size))
                    break
            following = _next_chunk(stream, at + 1, size)
            reason = "the file is cut" if following is None else "broken records between chunks"
            lost = (following or size) - at
            damage.lose("bytes", reason, at=at, count=lost, size=lost)
            if following is None:
                break
            at = following
    for number, count in _told(path, size).items():
        contents.counts[number] = max(contents.counts[number], count)  # reading tells what lacks
    if not is_closed:
        damage.mend("files", "it has no end: never closed, or cut")
    if contents.twice:
        damage.mend("chunks", "written twice, read once", contents.twice)
    return contents


def _take(contents: Contents, stream: BinaryIO, opcode: int, at: int, end: int) -> None:
    if opcode == m.MESSAGE:
        (number,) = struct.unpack("<H", stream.read(2).ljust(2, b"\0"))
        contents.counts[number] += 1
        contents.loose.append((at, end))
    elif opcode in (m.SCHEMA, m.CHANNEL):
        contents.learn(opcode, stream.read(end - at - m.HEAD))
    elif opcode == m.MESSAGE_INDEX and contents.chunks and not contents.chunks[-1].size:
        number, length = struct.unpack("<HI", stream.read(6).ljust(6, b"\0"))
        contents.counts[number] += length // 16  # the chunk before could not be read
    elif opcode == m.CHUNK:
        record = stream.read(end - at - m.HEAD)
        try:
            head = m.chunk_head(record)
            packed = record[head.at : head.at + head.compressed]
            content_of = (head.size, zlib.crc32(packed))
            if content_of in contents.seen:  # stamps differ, so no two chunks are alike
                contents.twice += 1
                return
            contents.seen.add(content_of)
            _count(contents, decompress(packed, head.compression, head.size))
            contents.chunks.append(m.ChunkIndex(at, end - at, 0, head.size, None))
        except (ValueError, struct.error):  # reading it tells
            contents.chunks.append(m.ChunkIndex(at, end - at, 0, 0, None))


def _count(contents: Contents, content: Bytes) -> None:
    for opcode, begin, end in m.records(content):
        if opcode == m.MESSAGE and end - begin >= m.MESSAGE_HEAD:
            contents.counts[struct.unpack_from("<H", content, begin)[0]] += 1
        elif opcode in (m.SCHEMA, m.CHANNEL):
            contents.learn(opcode, content[begin:end])


def cut_content(path: Path, at: int) -> Bytes:
    """As much of the content of the chunk that begins at `at` as the file still has."""
    with path.open("rb") as stream:
        return _cut_content(stream, at, path.stat().st_size)


def _cut_content(stream: BinaryIO, at: int, size: int) -> Bytes:
    stream.seek(at + m.HEAD)
    record = stream.read(size - at - m.HEAD)
    try:
        head = m.chunk_head(record)
    except (ValueError, struct.error):
        return b""
    return decompress_start(record[head.at :], head.compression)


def _next_chunk(stream: BinaryIO, at: int, size: int) -> int | None:
    """First byte of the next whole chunk record at `at` or behind it."""
    overlap = m.HEAD + _BEFORE_CODEC + 8
    while at < size:
        stream.seek(at)
        window = stream.read(_STEP + overlap)
        places = []
        for codec in _CODECS:
            place = window.find(codec)
            while place >= 0:
                places.append(place - _BEFORE_CODEC - m.HEAD)
                place = window.find(codec, place + 1)
        for place in sorted(p for p in places if p >= 0):
            opcode, length = struct.unpack_from("<BQ", window, place)
            begin = at + place
            whole = opcode == m.CHUNK and begin + m.HEAD + length <= size
            if whole and _is_chunk(stream, begin, length):
                return begin
        at += _STEP
    return None


def _is_chunk(stream: BinaryIO, at: int, length: int) -> bool:
    """Whether the content's own lengths add up to the record's."""
    stream.seek(at + m.HEAD)
    try:
        head = m.chunk_head(stream.read(_BEFORE_CODEC + 4 + 64))
    except (ValueError, struct.error):
        return False
    return head.at + head.compressed == length
