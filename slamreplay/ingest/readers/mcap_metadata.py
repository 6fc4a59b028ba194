"""MCAP's metadata records (mcap.dev/spec): a name and texts by key, found without reading the log.

A closed file lists them in its summary. One that was cut is passed over by the heads of its
records, which costs a seek per chunk.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from slamreplay.ingest.readers.mcap_records import FOOTER, HEAD, MAGIC, TAIL, records

_METADATA, _METADATA_INDEX, _DATA_END = 0x0C, 0x0D, 0x0F
#: A summary or a record larger than this is passed over, B; so is what comes after so many records.
_MOST, _MOST_RECORDS = 64_000_000, 100_000


def metadata_records(path: Path) -> list[tuple[str, dict[str, str]]]:
    """Name and content of each metadata record, in the order of the file; broken ones left out.

    Raises:
        OSError: the file cannot be read.
    """
    found = []
    with path.open("rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            return []
        places = _by_summary(stream)
        for at, length in _by_heads(stream) if places is None else places:
            stream.seek(at)
            content = stream.read(min(length, _MOST))
            try:
                found.append(_record(content))
            except (struct.error, ValueError):
                continue
    return found


def _by_summary(stream: BinaryIO) -> list[tuple[int, int]] | None:
    """Where the contents of the records are, and how long; None without a summary."""
    size = stream.seek(0, os.SEEK_END)
    if size < TAIL + len(MAGIC):
        return None
    stream.seek(size - TAIL)
    tail = stream.read(TAIL)
    if tail[0] != FOOTER or not tail.endswith(MAGIC):
        return None
    (start,) = struct.unpack_from("<Q", tail, HEAD)
    if not 0 < start < size - TAIL or size - TAIL - start > _MOST:
        return None
    stream.seek(start)
    summary = stream.read(size - TAIL - start)
    places = []
    for opcode, begin, end in records(summary):
        if opcode == _METADATA_INDEX and end - begin >= 16:
            at, length = struct.unpack_from("<QQ", summary, begin)
            places.append((at + HEAD, length - HEAD))
    return [(at, length) for at, length in places if at + length <= size and length > 0]


def _by_heads(stream: BinaryIO) -> Iterator[tuple[int, int]]:
    size = stream.seek(0, os.SEEK_END)
    at = len(MAGIC)
    for _ in range(_MOST_RECORDS):
        stream.seek(at)
        head = stream.read(HEAD)
        if len(head) < HEAD:
            return
        opcode, length = struct.unpack("<BQ", head)
        if opcode == _METADATA and at + HEAD + length <= size:
            yield at + HEAD, length
        if opcode in (0, _DATA_END) or at + HEAD + length > size:
            return
        at += HEAD + length


def _record(content: bytes) -> tuple[str, dict[str, str]]:
    name, at = _text(content, 0)
    (length,) = struct.unpack_from("<I", content, at)
    at += 4
    end = at + length
    if end > len(content):
        raise ValueError("a map is longer than its record")
    found = {}
    while at < end:
        key, at = _text(content, at)
        found[key], at = _text(content, at)
    return name, found


def _text(content: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", content, at)
    begin = at + 4
    if begin + length > len(content):
        raise ValueError("a text is longer than its record")
    return content[begin : begin + length].decode("utf-8", "replace"), begin + length
