"""One program at a time in a folder."""

from __future__ import annotations

import json
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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
        who = f"process {holder.get('pid', '?')} on {holder.get('host', '?')}"
        here = socket.gethostname()
        if not _locked(handle, holder):
            raise OutputError(
                f"{who} is at work here", where=path.parent, hint="wait for it, or stop it"
            )
        if holder.get("host", here) != here:
            raise OutputError(
                f"{who} was at work here and may still be",
                where=path.parent,
                hint=f"if it is not, remove {path}",
            )
        pid = os.getpid()
        try:
            told = {"pid": pid, "host": here, "since": _since(pid)}
            _write(handle, json.dumps(told).encode())
        except OSError as error:
            raise OutputError(f"cannot write: {error.strerror or error}", where=path) from error
        try:
            yield
        finally:
            with suppress(OSError):  # the file stays: to remove it would part those who wait for it
                _write(handle, b"")
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
            return not (holder.get("host") == socket.gethostname() and _lives(holder))
        return True


def _lives(holder: dict[str, Any]) -> bool:
    """Whether the process still is who wrote this: numbers are given anew, soon after a boot."""
    pid = holder.get("pid")
    if not isinstance(pid, int):
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    now, then = _since(pid), holder.get("since")
    return now is None or then is None or now == then


def _since(pid: int) -> str | None:
    """The boot and the clock tick in it at which a process began, None where nobody tells."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8").strip()
        about = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
        return f"{boot} {about.rpartition(')')[2].split()[19]}"  # field 22 of proc_pid_stat(5)
    except (OSError, IndexError):
        return None
