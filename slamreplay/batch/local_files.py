"""Files on this machine: which there are below a folder, and what tells that one has changed."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path

from slamreplay.batch.addresses import printable
from slamreplay.errors import LogError

#: A file up to this size is hashed as a whole, B.
WHOLE = 1 << 20
#: What is hashed of a larger one: its first and last bytes, and pieces spread between them, B.
_END, _PIECE, _PIECES = 1 << 15, 1 << 12, 16


def fingerprint(path: Path) -> str:
    """What changes with a file's content, and stays when it is only touched, copied or moved.

    Of a file of more than 1 MiB: SHA-256 over its size, its first and last 32 KiB and 16 pieces
    of 4 KiB at equal distances. The containers of logs say what they hold in their first or last
    bytes (bag header, MCAP summary, SQLite change counter, CRC of gzip and bzip2), so one that was
    written to differs there; what somebody changes by hand elsewhere, with the same size, may not.

    Raises:
        LogError: it cannot be read.
    """
    try:
        about = path.stat()
        return _fingerprint(path, about.st_size, about.st_mtime_ns, about.st_ino)
    except OSError as error:
        raise cannot_read(path, error) from error


@lru_cache(maxsize=1 << 16)
def _fingerprint(path: Path, size: int, mtime_ns: int, inode: int) -> str:  # noqa: ARG001 - kept by
    digest = hashlib.sha256(f"{size}\n".encode())
    with path.open("rb", buffering=0) as stream:
        if size <= WHOLE:
            digest.update(stream.read(WHOLE + 1))
        else:
            digest.update(stream.read(_END))
            for i in range(_PIECES):
                stream.seek(_END + (size - 2 * _END) * i // _PIECES)
                digest.update(stream.read(_PIECE))
            stream.seek(size - _END)
            digest.update(stream.read(_END))
    return digest.hexdigest()[:32]


def cannot_read(path: object, error: OSError) -> LogError:
    """The line for a file or folder that the system does not give."""
    why = os.strerror(error.errno) if error.errno else "the system gives it not"
    return LogError(f"cannot read: {why}", where=printable(str(path)))


def files_below(
    root: str,
    reaches: Callable[[tuple[str, ...]], bool] = lambda _parts: True,
    skipped: Callable[[str], None] = lambda _why: None,
) -> Iterator[str]:
    """Paths of all files below a folder, links followed, each folder once; hidden ones not.

    A folder that links lead to is taken under its own name where it lies below `root`, else under
    the name of the first link: so no loop, nothing twice.

    Args:
        root: the folder, absolute.
        reaches: told a folder's parts from `root`, whether to look into it.
        skipped: told a reason for each folder that could not be read or was seen before.

    Raises:
        LogError: `root` itself cannot be read.
    """
    seen: set[tuple[int, int]] = set()
    links: list[str] = []
    folders = [root]
    while folders or links:
        folder = folders.pop() if folders else links.pop(0)
        try:
            about = os.stat(folder)  # noqa: PTH116 - paths are texts here: there are many
            if (about.st_dev, about.st_ino) in seen:
                skipped("folders that links lead to a second time")
                continue
            seen.add((about.st_dev, about.st_ino))
            with os.scandir(folder) as listing:
                entries = sorted(listing, key=lambda entry: entry.name, reverse=True)
        except OSError as error:
            if folder == root:
                raise cannot_read(root, error) from error
            skipped(f"folders that cannot be read ({os.strerror(error.errno or 0)})")
            continue
        for entry in entries:
            path = f"{folder.rstrip('/')}/{entry.name}"  # with / everywhere, as `logs_among` has it
            kind = "" if entry.name.startswith(".") else _kind(entry, skipped)
            if kind == "file":
                yield path
            elif kind and reaches(tuple(path[len(root) :].strip("/").split("/"))):
                (links if kind == "link" else folders).append(path)
        links.sort()


def _kind(entry: os.DirEntry[str], skipped: Callable[[str], None]) -> str:
    """`file`, `folder`, `link` to a folder, or empty for what is none of them."""
    try:
        if entry.is_dir():
            return "link" if entry.is_symlink() else "folder"
        if entry.is_file():
            return "file"
        if entry.is_symlink():
            skipped("links that lead nowhere")
    except OSError as error:
        skipped(f"files that cannot be read ({os.strerror(error.errno or 0)})")
    return ""
