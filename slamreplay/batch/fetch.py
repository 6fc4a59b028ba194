"""A log's files to where they can be read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from slamreplay.batch.addresses import is_local, shown
from slamreplay.batch.local_files import cannot_read, fingerprint
from slamreplay.batch.task import LogFile, LogSource
from slamreplay.errors import LogError, UsageError


def fetch(source: LogSource, storage: Mapping[str, object], folder: Path) -> list[Path]:
    """The paths to give to `ingest`: local files where they are, others copied into a folder.

    Args:
        source: the log.
        storage: options of fsspec.
        folder: an empty one that exists; what is written there the caller removes.

    Raises:
        LogError: a file is gone, has changed since the log was listed, cannot be read, or there is
            no room for it.
    """
    for file in source.files:
        if not is_local(file.url):
            raise UsageError("addresses are not read yet", where=shown(file.url))
        _check(file)
    log = local_log(source)
    assert log is not None
    return [log]


def _check(file: LogFile) -> None:
    path = Path(file.url)
    try:
        size = path.stat().st_size
    except OSError as error:
        raise cannot_read(path, error) from error
    if size != file.size or fingerprint(path) != file.version:
        raise changed(shown(file.url))


def changed(where: str) -> LogError:
    """The line for a file that is not what was listed."""
    return LogError(
        "changed since the batch listed it", where=where,
        hint="run the batch again when nobody writes to it",
    )  # fmt: skip


def local_log(source: LogSource) -> Path | None:
    """Path of the file or folder that a log on this machine is, None of one elsewhere."""
    first = source.files[0]
    if not is_local(first.url):
        return None
    # The folder is above the file's name, which may have folders in it.
    depth = len(Path(first.name).parts) if source.folder else 0
    return Path(first.url).parents[depth - 1] if depth else Path(first.url)
