"""Records of MCAP files (mcap.dev/spec): what this reader needs of each kind."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.ingest.readers.compression import Bytes

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = 2, 3, 4, 5, 6, 7, 8
STATISTICS, METADATA, METADATA_INDEX, DATA_END = 0x0B, 0x0C, 0x0D, 0x0F
#: Opcode and length before the content of every record.
HEAD = 9
#: Channel, sequence, log time and publish time before the payload of a message.
MESSAGE_HEAD = 22
#: Bytes of the footer record with the closing magic.
TAIL = HEAD + 20 + len(MAGIC)


@dataclass(frozen=True)
class Schema:
    """A message type and its definition."""

    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True)
class Channel:
    """A topic."""

    schema: int
    topic: str
    encoding: str


@dataclass(frozen=True)
class ChunkHead:
    """A chunk without its records; `at` is where they begin, from the start of the content."""

    size: int
    crc: int
    compression: str
    at: int
    compressed: int


@dataclass(frozen=True)
class ChunkIndex:
    """Where a chunk is and which channels it holds (None where it does not say)."""

    start: int
    length: int
    index_length: int
    size: int
    channels: frozenset[int] | None


def records(data: Bytes, at: int = 0) -> Iterator[tuple[int, int, int]]:
    """Opcode, first and one past the last byte of every whole record; ends where none fits."""
    end = len(data)
    unpack = struct.Struct("<BQ").unpack_from
    while at + HEAD <= end:
        opcode, length = unpack(data, at)
        begin = at + HEAD
        at = begin + length
        if at > end:
            return
        yield opcode, begin, at


def is_sequence(content: Bytes) -> bool:
    """Whether a chunk's content is records that it may hold, one after another to its end."""
    last = 0
    for opcode, _, end in records(content):
        if opcode not in (SCHEMA, CHANNEL, MESSAGE):
            return False
        last = end
    return last == len(content)


def schema(data: Bytes) -> tuple[int, Schema]:
    """Id and schema. Raises ValueError, struct.error where the record is none."""
    (number,) = struct.unpack_from("<H", data)
    name, at = text(data, 2)
    encoding, at = text(data, at)
    (length,) = struct.unpack_from("<I", data, at)
    return number, Schema(name, encoding, bytes(data[at + 4 : at + 4 + length]))


def channel(data: Bytes) -> tuple[int, Channel]:
    """Id and channel. Raises ValueError, struct.error where the record is none."""
    number, own = struct.unpack_from("<HH", data)
    topic, at = text(data, 4)
    encoding, _ = text(data, at)
    return number, Channel(own, topic, encoding)


def chunk_head(data: Bytes) -> ChunkHead:
    """Of the first bytes of a chunk. Raises ValueError, struct.error where it is none."""
    _, _, size, crc = struct.unpack_from("<QQQI", data)
    compression, at = text(data, 28)
    (compressed,) = struct.unpack_from("<Q", data, at)
    return ChunkHead(size, crc, compression, at + 8, compressed)


def chunk_index(data: bytes) -> ChunkIndex:
    """Raises ValueError, struct.error where the record is none."""
    _, _, start, length, entries = struct.unpack_from("<QQQQI", data)
    numbers = struct.unpack_from("<" + "HQ" * (entries // 10), data, 36)[::2]
    at = 36 + entries
    (index_length,) = struct.unpack_from("<Q", data, at)
    _, at = text(data, at + 8)
    _, size = struct.unpack_from("<QQ", data, at)
    channels = frozenset(int(n) for n in numbers) if index_length else None
    return ChunkIndex(start, length, index_length, size, channels)


def statistics(data: bytes) -> tuple[int, int, dict[int, int]]:
    """Messages, chunks, and messages of each channel."""
    messages, _, _, _, _, chunks, _, _, entries = struct.unpack_from("<QHIIIIQQI", data)
    flat = struct.unpack_from("<" + "HQ" * (entries // 10), data, 46)
    return messages, chunks, dict(zip(flat[::2], flat[1::2], strict=True))


def message_index(data: Bytes) -> tuple[int, NDArray[np.int64]]:
    """Channel, and (N,) offsets of its messages in the chunk's content."""
    number, size = struct.unpack_from("<HI", data)
    entries = np.frombuffer(data, dtype="<u8", count=size // 8, offset=6)
    return int(number), entries[1::2].astype(np.int64)


def text(data: Bytes, at: int) -> tuple[str, int]:
    """A text and where it ends. Raises ValueError, struct.error where there is none."""
    (length,) = struct.unpack_from("<I", data, at)
    begin = at + 4
    if begin + length > len(data):
        raise ValueError("a text is longer than its record")
    return bytes(data[begin : begin + length]).decode("utf-8", "replace"), begin + length
