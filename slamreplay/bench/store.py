"""Judged logs on disk, one file each, so that a benchmark that was stopped goes on."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from pathlib import Path

import numpy as np

from slamreplay.bench.measure import Measured
from slamreplay.bench.schedule import Case
from slamreplay.bundle.atomic import write_file

#: What does not bear on a measurement: words, pages and commands.
_NOT_MEASURED = ("cli", "report", "export", "testing")


def fingerprint() -> str:
    """Of the package's own source: a log judged by other code is judged again."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root)
        if name.parts[0] not in _NOT_MEASURED:
            digest.update(f"{name.as_posix()}\0".encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def write_measured(folder: Path, one: Measured, code: str) -> None:
    """Keep one log's result; the file appears whole or not at all."""
    said = {"code": code, **one.facts}
    buffer = io.BytesIO()
    text = np.frombuffer(json.dumps(said, sort_keys=True).encode(), dtype=np.uint8)
    np.savez_compressed(buffer, allow_pickle=False, facts=text, **one.moments)
    write_file(_path(folder, one.case), buffer.getvalue())


def read_measured(folder: Path, case: Case, code: str) -> Measured | None:
    """One log's result, None if there is none that this code made."""
    path = _path(folder, case)
    if not path.is_file():
        return None
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
            facts = json.loads(arrays["facts"].tobytes())
            moments = {name: arrays[name] for name in arrays.files if name != "facts"}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None  # cut off: made again
    if facts.pop("code", None) != code:
        return None
    return Measured(case, facts, moments)


def _path(folder: Path, case: Case) -> Path:
    return folder / f"{case.name}.npz"
