"""Records of ROS 1 bags, version 2.0 (wiki.ros.org/Bags/Format/2.0).

A record is a header (its length, then `name=value` fields, each with its length) and data (its
length, then bytes). Chunks hold connection and message records.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.times import NS_PER_S
from slamreplay.ingest.readers.compression import Bytes

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
_KNOWN = frozenset({MESSAGE, BAG, INDEX, CHUNK, CHUNK_INFO, CONNECTION})
_SIZES: dict[int, dict[bytes, int]] = {
    MESSAGE: {b"conn": 4, b"time": 8},
    BAG: {b"index_pos": 8, b"conn_count": 4, b"chunk_count": 4},
    INDEX: {b"conn": 4, b"count": 4},
    CHUNK: {b"size": 4},
    CHUNK_INFO: {b"chunk_pos": 8, b"count": 4},
    CONNECTION: {b"conn": 4},
}

Header = Mapping[bytes, bytes]


def u32(data: Bytes, at: int = 0) -> int:
    """Raises struct.error where there are no four bytes."""
    return int(struct.unpack_from("<I", data, at)[0])


def fields(data: Bytes) -> dict[bytes, bytes]:
    """Header fields by name. Raises ValueError, struct.error where they are none."""
    out, at = {}, 0
    while at < len(data):
        end = at + 4 + u32(data, at)
        if end > len(data):
            raise ValueError("a field is longer than its header")
        name, found, value = bytes(data[at + 4 : end]).partition(b"=")
        if not found:
            raise ValueError("a header field without '='")
        out[name] = value
        at = end
    return out


def opcode(header: Header) -> int:
    """The kind of a record. Raises ValueError where it is none, or lacks what it is read by."""
    op = header.get(b"op", b"")
    if len(op) != 1 or op[0] not in _KNOWN:
        raise ValueError("a record of no known kind")
    if any(len(header.get(name, b"")) != size for name, size in _SIZES[op[0]].items()):
        raise ValueError("a record lacks fields")
    return op[0]


def records(data: Bytes) -> Iterator[tuple[dict[bytes, bytes], int, int]]:
    """Header, first and one past the last byte of the data of every record of a chunk.

    Raises:
        ValueError, struct.error: a record is broken or cut; those before it were good.
    """
    at = 0
    while at < len(data):
        begin = at + 4 + u32(data, at)
        if begin > len(data):
            raise ValueError("a record is longer than its chunk")
        header = fields(data[at + 4 : begin])
        opcode(header)
        end = begin + 4 + u32(data, begin)
        if end > len(data):
            raise ValueError("a record is longer than its chunk")
        yield header, begin + 4, end
        at = end


def stamp_ns(data: bytes) -> int:
    """Eight bytes of seconds and nanoseconds."""
    sec, nsec = struct.unpack("<II", data)
    return int(sec) * NS_PER_S + int(nsec)


def index_offsets(data: Bytes, count: int) -> NDArray[np.int64]:
    """(N,) offsets of messages in the chunk's content, of an index record of version 1."""
    entries = np.frombuffer(data, dtype=[("time", "<u8"), ("at", "<u4")], count=count)
    return entries["at"].astype(np.int64)
