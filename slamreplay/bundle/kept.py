"""Bytes that were worked out before, each in a file named by all that it depends on."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

import numpy as np

from slamreplay.bundle.atomic import write_file
from slamreplay.bundle.code_hash import code_hash
from slamreplay.errors import OutputError


def kept(folder: Path | None, told: Iterable[str], make: Callable[[], bytes]) -> bytes:
    """What `make` gives, from the folder where it was made before by the same program.

    Args:
        folder: of such files; one that cannot be read or written costs time, nothing else. None
            keeps nothing.
        told: texts that say all that the bytes depend on, beside this program.
        make: does the work.
    """
    if folder is None:
        return make()
    parts = [code_hash(), np.__version__, *told]
    file = folder / hashlib.sha256("\0".join(parts).encode()).hexdigest()
    with suppress(OSError):
        content = file.read_bytes()
        body, digest = content[:-32], content[-32:]
        if hashlib.sha256(body).digest() == digest:
            return body
    made = make()
    with suppress(OSError, OutputError):
        folder.mkdir(parents=True, exist_ok=True)
        write_file(file, made + hashlib.sha256(made).digest())
    return made
