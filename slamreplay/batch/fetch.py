"""A log's files to where they can be read."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Mapping
from pathlib import Path, PurePosixPath

from slamreplay.batch.addresses import is_local, shown
from slamreplay.batch.local_files import cannot_read, fingerprint
from slamreplay.batch.remote_files import remote_file
from slamreplay.batch.stores import StoreError, file_system, store_error
from slamreplay.batch.task import LogFile, LogSource
from slamreplay.errors import LogError

#: Tries of a file, and how long to wait before the second; each later one waits twice as long, s.
_TRIES, _WAIT_S = 4, 0.5


def fetch(
    source: LogSource,
    storage: Mapping[str, object],
    folder: Path,
    *,
    wait: Callable[[float], None] = time.sleep,
) -> list[Path]:
    """The paths to give to `ingest`: local files where they are, others copied into a folder.

    A copy takes memory for a few blocks, whatever the file's size. What fails for a passing reason
    is tried four times.

    Args:
        source: the log.
        storage: options of fsspec.
        folder: an empty one that exists; what is written there the caller removes.
        wait: for so many seconds.

    Raises:
        LogError: a file is gone, has changed since the log was listed, cannot be read, or there is
            no room for it.
    """
    log = local_log(source)
    if log is not None:
        for file in source.files:
            _check_local(file)
        return [fetched(source, folder)]
    need = sum(file.size or 0 for file in source.files)
    room = shutil.disk_usage(folder).free
    if need > room:
        raise LogError(
            f"no room for its {need / 1e6:.0f} MB, {room / 1e6:.0f} MB are free",
            where=shown(source.files[0].url), hint="set TMPDIR to a larger disk",
        )  # fmt: skip
    for file in source.files:
        target = folder / _inside(source.folder) / _inside(file.name)
        target.parent.mkdir(parents=True, exist_ok=True)
        _copy(file, target, storage, wait)
    return [fetched(source, folder)]


def fetched(source: LogSource, folder: Path) -> Path:
    """Where a log is once `fetch` was given that folder."""
    return local_log(source) or folder / _inside(source.folder or source.files[0].name)


def local_log(source: LogSource) -> Path | None:
    """Path of the file or folder that a log on this machine is, None of one elsewhere."""
    first = source.files[0]
    if not is_local(first.url):
        return None
    # The folder is above the file's name, which may have folders in it.
    depth = len(Path(first.name).parts) if source.folder else 0
    return Path(first.url).parents[depth - 1] if depth else Path(first.url)


def _inside(name: str) -> Path:
    """A name of a store as a path that cannot lead out of the folder."""
    parts = [part for part in PurePosixPath(name).parts if part not in ("/", "..")]
    return Path(*parts)


def _check_local(file: LogFile) -> None:
    path = Path(file.url)
    try:
        size = path.stat().st_size
    except OSError as error:
        raise cannot_read(path, error) from error
    if size != file.size or fingerprint(path) != file.version:
        raise _changed(file)


def _copy(
    file: LogFile, target: Path, storage: Mapping[str, object], wait: Callable[[float], None]
) -> None:
    for attempt in range(_TRIES):
        try:
            _copy_once(file, target, storage)
        except StoreError as error:
            if not error.is_passing or attempt == _TRIES - 1:
                raise
            wait(_WAIT_S * 2**attempt)
        else:
            return


def _copy_once(file: LogFile, target: Path, storage: Mapping[str, object]) -> None:
    store = file_system(file.url, storage)
    # Several blocks of 50 MB at once, as s3fs would, are more than a worker's memory is counted on.
    more = {"max_concurrency": 1} if "s3" in store.protocol else {}
    try:
        store.get_file(file.url, str(target), **more)
        size = target.stat().st_size
    except Exception as error:
        raise store_error(error, file.url, storage) from error
    now = remote_file(file.url, storage)
    if now is None or (now.version and file.version and now.version != file.version):
        raise _changed(file)
    if file.size is not None and now.size not in (None, file.size):
        raise _changed(file)
    if file.size is not None and size != file.size:
        short = StoreError(f"{size} bytes came of {file.size}", where=shown(file.url))
        short.is_passing = True
        raise short


def _changed(file: LogFile) -> LogError:
    return LogError(
        "changed since the batch listed it", where=shown(file.url),
        hint="run the batch again when nobody writes to it",
    )  # fmt: skip
