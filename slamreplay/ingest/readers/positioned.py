"""Reading at a place of a file that threads share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO


def read_at(stream: BinaryIO, offset: int, size: int) -> bytes:
    """Bytes of the file, fewer where it ends; does not move the stream."""
    if hasattr(os, "pread"):
        return os.pread(stream.fileno(), size, offset)
    with Path(stream.name).open("rb") as own:  # Windows
        own.seek(offset)
        return own.read(size)
