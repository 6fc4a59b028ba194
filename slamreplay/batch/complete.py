"""Is a log on this machine all there, or is somebody still writing or copying it?

Told by what the formats themselves put at their end. What has no end to be seen (a CARMEN text, a
database without its metadata.yaml) is for the caller to watch standing still; so is a log that a
robot never closed, for a longer while.
"""

from __future__ import annotations

import os
import re
import struct
import zlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO, Literal

import yaml

from slamreplay.batch.grouping import METADATA, WAL, is_storage_name
from slamreplay.ingest.readers import mcap_records, ros1_records, sqlite_file
from slamreplay.ingest.readers.compression import ZSTD
from slamreplay.ingest.readers.ros1_scan import record
from slamreplay.ingest.text_logs.lines import BZIP2, GZIP, decompressed

#: Names under which programs write what is not whole: recorders, browsers, copies, editors.
_TEMPORARY = re.compile(
    r"^\.|~$|\.(active|part|partial|filepart|tmp|temp|crdownload|download|incomplete|swp)\Z",
    re.IGNORECASE,
)
#: Opcode and length of MCAP's last record, the footer, which is followed by the magic once more.
_FOOTER = struct.pack("<BQ", mcap_records.FOOTER, 20)

State = Literal["yes", "no", "unknown"]


@dataclass(frozen=True)
class Completeness:
    """What a log's own bytes say.

    Attributes:
        state: `yes` it is closed; `no` it is being written, or was never closed; `unknown` its
            format does not say.
        reason: in a few words.
    """

    state: State
    reason: str


_CLOSED = Completeness("yes", "its end is there")
_EMPTY = Completeness("no", "it is empty")


def is_complete(path: Path) -> Completeness:
    """Whether a log is all there; one that vanished or cannot be read is not.

    Args:
        path: of a file, or of a folder of rosbag2 or MRCLAM or a bundle, as of `fetch.local_log`.
    """
    try:
        if is_temporary(path.name):
            return Completeness("no", "it still has a temporary name")
        return _folder(path) if path.is_dir() else _file(path)
    except FileNotFoundError:
        return Completeness("no", "it is gone")
    except OSError as error:
        return Completeness("no", f"cannot read: {error.strerror or 'the system does not say why'}")


def is_temporary(name: str) -> bool:
    """Whether a file of this name is not whole, by its name alone."""
    return _TEMPORARY.search(name) is not None


def _folder(path: Path) -> Completeness:
    entries = {entry.name for entry in path.iterdir()}
    unfinished = sorted(name for name in entries if is_temporary(name))
    if unfinished:
        return Completeness("no", f"{unfinished[0]} in it has a temporary name")
    if METADATA not in entries:
        if any(map(is_storage_name, entries)):
            return Completeness("no", f"there is no {METADATA} yet")
        return Completeness("unknown", "a folder of this kind has no end")
    named = _named_files(path / METADATA)
    if named is None:
        return Completeness("no", f"{METADATA} is not whole")
    for name in named:
        places = (path / name, path / Path(name).name, path / f"{Path(name).name}.zstd")
        file = next((place for place in places if place.is_file()), None)
        if file is None:
            return Completeness("no", f"{Path(name).name} is not there yet")
        said = _file(file, is_listed=True)
        if said.state != "yes":
            return Completeness(said.state, f"{file.name}: {said.reason}")
    return Completeness("yes", f"{METADATA} is there and all files it names")


def _named_files(metadata: Path) -> list[str] | None:
    """The storage files that a metadata.yaml names, None where it is not (yet) one."""
    try:
        whole = yaml.safe_load(metadata.read_text(encoding="utf-8"))
        named = whole["rosbag2_bagfile_information"]["relative_file_paths"]
    except (ValueError, TypeError, KeyError, RecursionError, yaml.YAMLError):
        return None
    is_list = isinstance(named, list) and bool(named) and all(isinstance(n, str) for n in named)
    return named if is_list else None


def _file(path: Path, *, is_listed: bool = False) -> Completeness:
    about = path.stat()
    for suffix in (WAL, "-journal"):
        try:
            if path.with_name(path.name + suffix).stat().st_size:
                return Completeness("no", f"its {suffix.strip('-')} holds what is not in it yet")
        except FileNotFoundError:
            continue
    said = _by_content(path, about.st_size, about.st_mtime_ns)
    if said.state == "unknown" and is_listed and said is _DATABASE:
        return _CLOSED
    return said


_DATABASE = Completeness("unknown", "a database looks closed after each write")


@lru_cache(maxsize=1 << 14)
def _by_content(path: Path, size: int, mtime_ns: int) -> Completeness:  # noqa: ARG001 - kept by it
    if not size:
        return _EMPTY
    with path.open("rb") as stream:
        head = stream.read(100)
        if head.startswith(mcap_records.MAGIC):
            return _mcap(stream, size)
        if head.startswith(ros1_records.MAGIC):
            return _bag(stream, size)
        if head.startswith(sqlite_file.MAGIC):
            return _database(head, size)
        if head.startswith((GZIP, BZIP2, ZSTD)):
            return _packed(stream, head)
    return Completeness("unknown", "a file of this kind has no end")


def _mcap(stream: BinaryIO, size: int) -> Completeness:
    stream.seek(max(size - mcap_records.TAIL, len(mcap_records.MAGIC)))
    end = stream.read()
    if end.startswith(_FOOTER) and end.endswith(mcap_records.MAGIC):
        return _CLOSED
    return Completeness("no", "it has no footer yet")


def _bag(stream: BinaryIO, size: int) -> Completeness:
    """Closed where its header says where the index is, and the index ends with the file."""
    stream.seek(len(ros1_records.MAGIC))
    try:
        header, _ = record(stream, size)
        (at,) = struct.unpack("<Q", header[b"index_pos"])
        records = sum(ros1_records.u32(header[name]) for name in (b"conn_count", b"chunk_count"))
    except (KeyError, ValueError, struct.error):
        return Completeness("no", "its header is not whole")
    if not at:
        return Completeness("no", "its recorder has not closed it")
    is_whole = records > 0 and at <= size
    try:
        stream.seek(min(at, size))
        for _ in range(records):
            record(stream, size)
    except (ValueError, struct.error):
        is_whole = False
    return _CLOSED if is_whole else Completeness("no", "its index is not all there yet")


def _database(head: bytes, size: int) -> Completeness:
    """Its header counts its pages (sqlite.org/fileformat2.html, section 1.3)."""
    if len(head) < 100:
        return Completeness("no", "its header is not whole")
    page = struct.unpack_from(">H", head, 16)[0]
    (pages,) = struct.unpack_from(">I", head, 28)
    page = 65536 if page == 1 else page
    if head[24:28] == head[92:96] and size < page * pages:  # else the count is an old one
        return Completeness("no", f"{page * pages - size} bytes of it are not there yet")
    return _DATABASE


def _packed(stream: BinaryIO, head: bytes) -> Completeness:
    """Whether a compressed stream ends, all its parts if it has more than one."""
    try:
        if head.startswith(ZSTD):
            is_whole = _is_whole_zstd(stream)
        else:
            stream.seek(0)
            for _ in decompressed(stream):
                pass
            is_whole = True
    except EOFError:
        is_whole = False
    except (OSError, zlib.error, ValueError) as error:
        return Completeness("no", f"its compression is damaged ({type(error).__name__})")
    return _CLOSED if is_whole else Completeness("no", "its compressed stream has no end yet")


def _is_whole_zstd(stream: BinaryIO) -> bool:
    """Frame by frame and block by block to the end, by their heads (RFC 8878, section 3.1)."""
    size = stream.seek(0, os.SEEK_END)
    at = 0
    while at < size:
        stream.seek(at)
        head = stream.read(5).ljust(5, b"\0")
        if not head.startswith(ZSTD):
            return at > 0  # what comes after a frame is no part of the log
        kind = head[4]
        is_single = kind >> 5 & 1
        content_size = (is_single, 2, 4, 8)[kind >> 6]
        at += 5 + (not is_single) + (0, 1, 2, 4)[kind & 3] + content_size
        is_last = False
        while not is_last:
            stream.seek(at)
            block = int.from_bytes(stream.read(3).ljust(3, b"\0"), "little")
            is_last, is_repeated = bool(block & 1), block >> 1 & 3 == 1
            at += 3 + (1 if is_repeated else block >> 3)
            if at > size:
                return False
        at += 4 * (kind >> 2 & 1)
    return at == size
