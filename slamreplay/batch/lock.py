"""One program at a time in a folder."""

from __future__ import annotations

import json
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from slamreplay.errors import OutputError


@contextmanager
def held_lock(path: Path) -> Iterator[None]:
    """Hold the lock for the time of the block.

    The system frees it when its holder dies, however that happens. The file names the holder: on a
    file system that knows no locks between machines another host's name alone tells.

    Raises:
        OutputError: another program holds it, or the place cannot be written.
    """
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise OutputError(f"cannot write: {error.strerror or error}", where=path) from error
    try:
        holder = _holder(handle)
        told = f"process {holder.get('pid', '?')} on {holder.get('host', '?')}"
        here = socket.gethostname()
        if not _locked(handle, holder):
            raise OutputError(
                f"{told} is at work here", where=path.parent, hint="wait for it, or stop it"
            )
        if holder.get("host", here) != here:
            raise OutputError(
                f"{told} was at work here and may still be",
                where=path.parent,
                hint=f"if it is not, remove {path}",
            )
        _write(handle, json.dumps({"pid": os.getpid(), "host": here}).encode())
        try:
            yield
        finally:
            _write(handle, b"")  # the file stays: to remove it would part those who wait for it
    finally:
        os.close(handle)


def _holder(handle: int) -> dict[str, Any]:
    try:
        os.lseek(handle, 0, os.SEEK_SET)
        found = json.loads(os.read(handle, 4096) or b"{}")
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _write(handle: int, content: bytes) -> None:
    os.ftruncate(handle, 0)
    os.lseek(handle, 0, os.SEEK_SET)
    os.write(handle, content)


if sys.platform == "win32":

    def _locked(handle: int, holder: dict[str, Any]) -> bool:  # noqa: ARG001
        import msvcrt

        try:
            os.lseek(handle, 4096, os.SEEK_SET)  # a byte that nobody reads
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:

    def _locked(handle: int, holder: dict[str, Any]) -> bool:
        import fcntl

        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:  # this file system has no locks: the process itself is asked
            return not (holder.get("host") == socket.gethostname() and _lives(holder.get("pid")))
        return True


def _lives(pid: object) -> bool:
    if not isinstance(pid, int):
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
