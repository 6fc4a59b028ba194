"""MCAP's metadata records (mcap.dev/spec): a name and texts by key, found without reading the log.

A closed file lists them in its summary. One that was cut is passed over by the heads of its
records, which costs a seek per chunk.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from slamreplay.ingest.readers import mcap_records as m
from slamreplay.ingest.readers.mcap_scan import summary_of

#: Of a record as many bytes are read, B; what comes after so many records is passed over.
_MOST, _MOST_RECORDS = 64_000_000, 100_000


def metadata_records(path: Path) -> list[tuple[str, dict[str, str]]]:
    """Name and content of each metadata record, in the order of the file; broken ones left out.

    Raises:
        OSError: the file cannot be read.
    """
    found = []
    size = path.stat().st_size
    summary = summary_of(path, size)
    with path.open("rb") as stream:
        if stream.read(len(m.MAGIC)) != m.MAGIC:
            return []
        for at, length in _by_index(summary, size) if summary else _by_heads(stream, size):
            stream.seek(at)
            content = stream.read(min(length, _MOST))
            try:
                found.append(_record(content))
            except (struct.error, ValueError):
                continue
    return found


def _by_index(summary: bytes, size: int) -> Iterator[tuple[int, int]]:
    """Where the contents of the records are, and how long."""
    for opcode, begin, end in m.records(summary):
        if opcode == m.METADATA_INDEX and end - begin >= 16:
            at, length = struct.unpack_from("<QQ", summary, begin)
            if at + length <= size and length > m.HEAD:
                yield at + m.HEAD, length - m.HEAD


def _by_heads(stream: BinaryIO, size: int) -> Iterator[tuple[int, int]]:
    at = len(m.MAGIC)
    for _ in range(_MOST_RECORDS):
        stream.seek(at)
        head = stream.read(m.HEAD)
        if len(head) < m.HEAD:
            return
        opcode, length = struct.unpack("<BQ", head)
        if opcode == m.METADATA and at + m.HEAD + length <= size:
            yield at + m.HEAD, length
        if opcode in (0, m.DATA_END) or at + m.HEAD + length > size:
            return
        at += m.HEAD + length


def _record(content: bytes) -> tuple[str, dict[str, str]]:
    name, at = m.text(content, 0)
    (length,) = struct.unpack_from("<I", content, at)
    at += 4
    end = at + length
    found = {}
    while at < end:
        key, at = m.text(content, at)
        found[key], at = m.text(content, at)
    return name, found
