"""Bundles of logs that were read before, each under the hash of all that reading it depends on."""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np
import pyarrow as pa

from slamreplay.bundle.code_hash import code_hash
from slamreplay.bundle.store import MANIFEST, is_bundle
from slamreplay.bundle.view import Bundle
from slamreplay.errors import BundleError, MapError
from slamreplay.ingest.options import IngestOptions

#: Bundles beyond so many bytes go, the least recently used first, but none of the last hour.
MOST_BYTES = 4_000_000_000
_RECENT_S = 3600.0


def ingest_once(
    logs: Sequence[Path],
    cache: Path,
    options: IngestOptions = IngestOptions(),  # noqa: B008 - frozen
    *,
    progress: Callable[[str, float], None] | None = None,
) -> Bundle:
    """The bundle of a log, read anew only where files, options or this program changed.

    Args:
        logs: as of `ingest`.
        cache: folder of bundles.
        options: as of `ingest`.
        progress: as of `ingest`.

    Raises:
        SlamreplayError: as of `ingest`; of the kind `OutputError` where the cache takes no bundle.
    """

    def read(target: Path) -> Bundle:
        from slamreplay.ingest.pipeline import ingest  # of no use where the bundle is there

        return ingest(logs, target, options, progress=progress)

    return made_once(cache, _lines(logs, options), read)


def made_once(cache: Path, told: Iterable[str], make: Callable[[Path], Bundle]) -> Bundle:
    """A bundle from a folder of them, made where it is not there or damaged.

    Args:
        cache: folder of bundles.
        told: lines that say all that the bundle depends on, beside this program.
        make: writes it into the folder that it is given.
    """
    target = cache / _key(told)
    if is_bundle(target):
        try:
            found = Bundle.open(target)
        except BundleError:
            pass  # damaged: it is replaced
        else:
            os.utime(target / MANIFEST)
            return found
    bundle = make(target)
    _trim(cache, keep=target)
    return bundle


def _key(told: Iterable[str]) -> str:
    digest = hashlib.sha256(f"{code_hash()} {np.__version__} {pa.__version__}\n".encode())
    for line in told:
        digest.update(f"{line}\n".encode(errors="surrogateescape"))
    return digest.hexdigest()[:32]


def _lines(logs: Sequence[Path], options: IngestOptions) -> Iterator[str]:
    for log in logs:
        yield f"log {log.name}"
        yield from (_line(name, file) for name, file in _files_of(log))
    for field in fields(options):
        value = getattr(options, field.name)
        is_file = isinstance(value, Path) and value.is_file()
        yield _line(f"{field.name} {value.name}", value) if is_file else f"{field.name} {value}"
    if options.map is not None:
        yield _map_version(options.map)


def _files_of(log: Path) -> Iterator[tuple[str, Path]]:
    """The log's files by name: of a database its write-ahead log, too, of a folder all."""
    if log.is_dir():
        files = sorted(file for file in log.rglob("*") if file.is_file())
        yield from ((file.relative_to(log).as_posix(), file) for file in files)
    elif log.is_file():
        yield from ((f.name, f) for f in (log, log.with_name(f"{log.name}-wal")) if f.is_file())


def _line(name: str, file: Path) -> str:
    with file.open("rb") as stream:
        return f"{name} {hashlib.file_digest(stream, 'sha256').hexdigest()}"


def _map_version(path: Path) -> str:
    """What a yaml's map is, image included, and what had to be mended in it."""
    from slamreplay.maps.map_server import read_map

    remarks: list[str] = []
    try:
        return " ".join([read_map(path, warn=remarks.append).version, *remarks])
    except MapError as error:
        return str(error)  # ingest will say so


def _trim(cache: Path, keep: Path) -> None:
    used = []
    for manifest in cache.glob(f"*/{MANIFEST}"):
        try:
            size = sum(f.stat().st_size for f in manifest.parent.rglob("*") if f.is_file())
            used.append((manifest.stat().st_mtime, size, manifest.parent))
        except OSError:
            continue  # somebody else takes it away
    total = 0
    for at, size, folder in sorted(used, reverse=True):
        total += size
        if total > MOST_BYTES and folder != keep and time.time() - at > _RECENT_S:
            shutil.rmtree(folder, ignore_errors=True)
