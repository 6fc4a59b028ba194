"""Files of settings, read whole: tables, manifests, maps, topics."""

from __future__ import annotations

import errno
from collections.abc import Mapping
from pathlib import Path

from slamreplay.batch.addresses import is_remote, local_path, shown
from slamreplay.batch.local_files import cannot_read
from slamreplay.batch.stores import file_system, store_error
from slamreplay.errors import LogError, UsageError


class NotThereError(LogError):
    """There is no such file."""


def read_small(place: str, storage: Mapping[str, object], *, most: int) -> bytes:
    """The content of a file at a path or an address.

    Args:
        place: path or address.
        storage: options of fsspec.
        most: larger than so many bytes is an error.

    Raises:
        NotThereError: there is none.
        LogError: it cannot be read.
        UsageError: it is no file, or larger.
    """
    content = _remote(place, storage, most) if is_remote(place) else _local(place, most)
    if len(content) > most:
        raise UsageError(f"larger than {most / 1e6:g} MB", where=shown(place))
    return content


def _local(place: str, most: int) -> bytes:
    path = Path(local_path(place))
    try:
        if path.exists() and not path.is_file():  # a pipe would wait for ever
            raise UsageError("not a file", where=shown(place))
        with path.open("rb") as stream:
            return stream.read(most + 1)
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        if not isinstance(error, OSError) or error.errno in (errno.ENOENT, errno.ENOTDIR):
            raise NotThereError("no such file", where=shown(place)) from error
        raise cannot_read(shown(place), error) from error


def _remote(place: str, storage: Mapping[str, object], most: int) -> bytes:
    store = file_system(place, storage)
    try:
        size = store.info(place).get("size")
        if size is not None and size > most:
            return bytes(most + 1)
        content: bytes = store.cat_file(place)
    except Exception as error:
        told = store_error(error, place, storage)
        if told.is_missing:
            raise NotThereError("no such file", where=shown(place)) from error
        raise told from error
    return content
