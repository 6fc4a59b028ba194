"""ROS 1 bags, version 2.0, read from front to back.

The format (wiki.ros.org/Bags/Format/2.0): records of a header (length, then length-prefixed
`name=value` fields) and data. Chunks hold connections and messages. The index at the end is used
for message counts only, so that a bag that was never closed reads like any other.
"""

from __future__ import annotations

import bz2
import struct
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.errors import LogError
from slamreplay.geometry.times import NS_PER_S
from slamreplay.ingest.readers.reader import Connection, normalise_type

MAGIC = b"#ROS"  # "#ROSBAG V2.0", and "#ROSRECORD V1.2" of the years before 2010
_MESSAGE, _INDEX, _CHUNK, _CONNECTION = 2, 4, 5, 7
_Header = dict[bytes, bytes]


class Ros1Reader:
    """One .bag file.

    Raises:
        LogError: another version of the format, or nothing readable in it.
    """

    def __init__(self, path: Path, source: Source) -> None:
        self.sources = (source,)
        self.losses: list[Loss] = []
        self._path = path
        with path.open("rb") as stream:
            magic = stream.readline(64)
        if magic.strip() != b"#ROSBAG V2.0":
            version = magic.decode("ascii", "replace").strip().lstrip("#")
            raise LogError(
                f"bag format '{version}' is not supported",
                where=path,
                hint="convert it with 'rosbag fix' of ROS 1",
            )
        self._start = len(magic)
        self._ids: dict[int, int] = {}  # connection ids of the bag to ours
        self._found: list[Connection] = []
        counts = self._scan()
        self.connections = tuple(
            Connection(c.index, c.topic, c.type, "ros1", c.definition, "msg", counts[c.index])
            for c in self._found
        )
        self.losses.clear()  # `messages` passes the same damage again

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """See `Reader`."""
        self.losses.clear()
        for header, data in self._records():
            if header[b"op"][0] != _CHUNK:
                continue
            for inner, payload in self._chunk(header, data):
                if inner[b"op"][0] != _MESSAGE:
                    continue
                index = self._ids.get(_u32(inner[b"conn"]))
                if index is not None and index in wanted:
                    sec, nsec = struct.unpack("<II", inner[b"time"])
                    yield index, sec * NS_PER_S + nsec, payload

    def _scan(self) -> Counter[int]:
        """Messages of each connection: from index records where they are, else by reading all."""
        counts: Counter[int] = Counter()
        for header, data in self._records():
            op = header[b"op"][0]
            if op == _CONNECTION:
                self._learn(header, data)
            elif op == _INDEX:
                counts[_u32(header[b"conn"])] += _u32(header[b"count"])
        if not self.losses and self._found and set(counts) <= set(self._ids):
            return Counter({self._ids[number]: count for number, count in counts.items()})
        return self._scan_chunks()

    def _scan_chunks(self) -> Counter[int]:
        counts: Counter[int] = Counter()
        for header, data in self._records():
            records = self._chunk(header, data) if header[b"op"][0] == _CHUNK else ()
            for inner, payload in records:
                if inner[b"op"][0] == _CONNECTION:
                    self._learn(inner, payload)
                elif inner[b"op"][0] == _MESSAGE:
                    counts[self._ids.get(_u32(inner[b"conn"]), -1)] += 1
        return counts

    def _learn(self, header: _Header, data: bytes) -> None:
        number = _u32(header[b"conn"])
        if number in self._ids:
            return
        fields = _fields(data)
        topic = header.get(b"topic", fields.get(b"topic", b"")).decode("utf-8", "replace")
        kind = normalise_type(fields.get(b"type", b"").decode("utf-8", "replace"))
        text = fields.get(b"message_definition", b"").decode("utf-8", "replace")
        self._ids[number] = len(self._found)
        self._found.append(Connection(len(self._found), topic, kind, "ros1", text, "msg", 0))

    def _records(self) -> Iterator[tuple[_Header, bytes]]:
        """Records of the file; a cut or broken tail ends them and becomes a loss."""
        size = self._path.stat().st_size
        with self._path.open("rb") as stream:
            stream.seek(self._start)
            while (position := stream.tell()) < size:
                try:
                    header = _fields(_block(stream.read(4), stream, size))
                    data = _block(stream.read(4), stream, size)
                    _check(header)
                except (ValueError, struct.error) as error:
                    reason = f"broken at byte {position}: {error}"
                    what = f"{self._path.name}: bytes"
                    self.losses.append(
                        Loss(kind="lost", what=what, count=size - position, reason=reason)
                    )
                    return
                yield header, data

    def _chunk(self, header: _Header, data: bytes) -> Iterator[tuple[_Header, bytes]]:
        """Records of one chunk; a damaged one is lost as a whole."""
        compression = header.get(b"compression", b"none").decode("ascii", "replace")
        records = []
        try:
            raw = _decompress(data, compression)
            at = 0
            while at < len(raw):
                fields, at = _slice(raw, at)
                payload, at = _slice(raw, at)
                record = _fields(fields)
                _check(record)
                records.append((record, payload))
        except (ValueError, OSError, RuntimeError, EOFError, struct.error) as error:
            reason = f"damaged chunk ({compression}): {error}"
            what = f"{self._path.name}: chunks"
            self.losses.append(Loss(kind="lost", what=what, count=1, reason=reason))
        yield from records


def _decompress(data: bytes, compression: str) -> bytes:
    if compression == "none":
        return data
    if compression == "bz2":
        return bz2.decompress(data)
    if compression == "lz4":
        import lz4.frame  # type: ignore[import-untyped]

        return bytes(lz4.frame.decompress(data))
    raise ValueError(f"unknown compression '{compression}'")


def _block(length: bytes, stream: BinaryIO, size: int) -> bytes:
    count = _u32(length)
    if count > size:
        raise ValueError(f"a length of {count} bytes")
    data = stream.read(count)
    if len(data) < count:
        raise ValueError("the file ends within a record")
    return data


def _slice(raw: bytes, at: int) -> tuple[bytes, int]:
    end = at + 4 + _u32(raw[at : at + 4])
    if end > len(raw):
        raise ValueError("a record is longer than its chunk")
    return raw[at + 4 : end], end


def _fields(data: bytes) -> _Header:
    out, at = {}, 0
    while at < len(data):
        field, at = _slice(data, at)
        name, found, value = field.partition(b"=")
        if not found:
            raise ValueError("a header field without '='")
        out[name] = value
    return out


def _check(header: _Header) -> None:
    """Raise ValueError where a record lacks the fields that its kind is read by."""
    op = header.get(b"op", b"")
    sizes = {b"op": 1}
    if op == bytes([_MESSAGE]):
        sizes |= {b"conn": 4, b"time": 8}
    elif op == bytes([_INDEX]):
        sizes |= {b"conn": 4, b"count": 4}
    elif op == bytes([_CONNECTION]):
        sizes |= {b"conn": 4}
    if any(len(header.get(name, b"")) != size for name, size in sizes.items()):
        raise ValueError("a record lacks fields")


def _u32(data: bytes) -> int:
    return int(struct.unpack("<I", data)[0])
