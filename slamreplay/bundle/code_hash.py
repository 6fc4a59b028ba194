"""This program as a hash, for what is kept from one of its runs to the next."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path


@cache
def code_hash(*packages: str) -> str:
    """Hash of the source of some packages of this program, or of all of it."""
    root = Path(__file__).parents[1]
    places = [root / name for name in packages] or [root]
    digest = hashlib.sha256()
    for file in sorted(file for place in places for file in place.rglob("*.py")):
        digest.update(file.relative_to(root).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()
