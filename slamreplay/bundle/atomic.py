"""Folders and files that are whole or absent: written elsewhere, renamed at the end."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from slamreplay.errors import OutputError


@contextmanager
def atomic_folder(target: Path, *, marker: str) -> Iterator[Path]:
    """A temporary folder that becomes `target` when the block ends, and vanishes if it fails.

    A block that removes the folder leaves the target as it is.

    Args:
        target: the folder to be; one of ours is replaced in one step.
        marker: the file by which a folder of ours is known; an existing folder without it, unless
            it is empty, is refused.

    Raises:
        OutputError: `target` is somebody else's, or cannot be written.
    """
    check_target(target, marker)
    made: list[Path] = []
    try:
        for parent in reversed([p for p in target.parents if not p.exists()]):
            parent.mkdir()
            made.append(parent)
        work = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as error:
        _remove_empty(made)
        raise _cannot_write(target, error) from error
    try:
        work.chmod(0o755)
        yield work
        if not work.exists():  # the block gave it up: what is at the target stays
            return
        old = work.with_name(work.name + ".old")
        if target.exists():
            target.rename(old)
        work.rename(target)
        shutil.rmtree(old, ignore_errors=True)
    except BaseException as error:
        shutil.rmtree(work, ignore_errors=True)
        _remove_empty(made)
        if isinstance(error, OSError):
            raise _cannot_write(target, error) from error
        raise


def check_target(target: Path, marker: str, option: str = "-o") -> None:
    """Refuse a place that cannot become a folder of ours, before any work is spent on it.

    Args:
        target: the folder to be.
        marker: as of `atomic_folder`.
        option: of the command line by which it was named, for the hint.

    Raises:
        OutputError: `target` exists and is neither empty nor known by `marker`, or the nearest
            folder that exists above it takes no new entries.
    """
    try:
        if target.exists() or target.is_symlink():
            ours = target.is_dir() and ((target / marker).exists() or not any(target.iterdir()))
            if not ours:
                raise OutputError(
                    f"exists and holds no {marker}",
                    where=target,
                    hint=f"name another output with {option}",
                )
        above = next(p for p in target.absolute().parents if p.exists())
        if not above.is_dir():
            raise NotADirectoryError(None, f"{above} is no folder")
        if not os.access(above, os.W_OK | os.X_OK):
            raise PermissionError(None, f"{above} takes no new entries")
    except OSError as error:
        raise _cannot_write(target, error) from error


def write_file(target: Path, content: bytes) -> None:
    """Write one file so that it is whole or absent.

    Raises:
        OutputError: the place cannot be written.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
            Path(name).chmod(0o644)
            Path(name).replace(target)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise _cannot_write(target, error) from error


def _remove_empty(folders: list[Path]) -> None:
    for folder in reversed(folders):
        if not any(folder.iterdir()):
            folder.rmdir()


def _cannot_write(target: Path, error: OSError) -> OutputError:
    return OutputError(f"cannot write: {error.strerror or error}", where=target)
