"""Parts that lost bytes after they were written: told, left out, and set aside by the writer."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from slamreplay.errors import OutputError
from slamreplay.fleet.parts import UNFINISHED, Part, parts_in

DAMAGED = "damaged"

#: What a killed process left unfinished goes after so long: nobody writes a part for an hour.
_ABANDONED_S = 3600.0
#: A Parquet file ends with the length of its footer and these letters.
_MAGIC = b"PAR1"

Warn = Callable[[str], None]


def quiet(_line: str) -> None:
    """Tells nobody."""


class DamagedError(Exception):
    """A file of a part that cannot be read."""

    def __init__(self, where: Path, what: str) -> None:
        super().__init__(f"{where}: {what}")
        self.where = where
        self.what = what


def check_part(part: Part) -> None:
    """Whether all files of a part are there to their ends.

    Raises:
        DamagedError: one is not.
    """
    files = sorted(part.folder.glob("*.parquet"))
    if part.file("logs") not in files:
        raise DamagedError(part.file("logs"), "is missing")
    for file in files:
        if not _ends_well(file):
            raise DamagedError(file, "is cut off")


def _ends_well(file: Path) -> bool:
    try:
        with file.open("rb") as stream:
            size = stream.seek(0, os.SEEK_END)
            if size < 12:
                return False
            stream.seek(-8, os.SEEK_END)
            tail = stream.read(8)
    except OSError:
        return False
    return tail[4:] == _MAGIC and int.from_bytes(tail[:4], "little") <= size - 12


def mend(folder: Path) -> list[str]:
    """Set damaged parts aside, and remove what processes left unfinished that were killed long ago.

    For the one who writes: a cut file would fail every query over a pattern of files. The logs of a
    damaged part are committed no longer, so that they are done again.

    Returns:
        One line on each damaged part.

    Raises:
        OutputError: the folder cannot be written.
    """
    lines = []
    for part in parts_in(folder):
        try:
            check_part(part)
        except DamagedError as error:
            lines += set_aside(folder, part, error)
    unfinished = folder / UNFINISHED
    with suppress(OSError):  # it costs room, no more
        for left in [*unfinished.iterdir()]:
            with suppress(FileNotFoundError):
                if time.time() - left.stat().st_mtime > _ABANDONED_S:
                    shutil.rmtree(left, ignore_errors=True)
    return lines


def set_aside(folder: Path, part: Part, error: DamagedError) -> list[str]:
    """Take a damaged part out of the tables; the line that tells it, none where it is gone.

    Raises:
        OutputError: the folder cannot be written.
    """
    aside = folder / DAMAGED / part.folder.name
    try:
        aside.parent.mkdir(exist_ok=True)
        shutil.rmtree(aside, ignore_errors=True)
        part.folder.rename(aside)
    except FileNotFoundError:  # it was laid together with others meanwhile
        return []
    except OSError as fault:
        raise OutputError(f"cannot mend: {fault.strerror or fault}", where=folder) from fault
    file = aside / error.where.name
    return [f"{file}: {error.what}; set aside, the logs of this part are to be done again"]
