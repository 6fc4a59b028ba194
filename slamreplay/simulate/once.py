"""Logs that were simulated before, each under the hash of the program that made it."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

import slamreplay
from slamreplay.bundle.atomic import atomic_folder
from slamreplay.simulate.pipeline import simulate

_MARKER = "scenario.txt"


def simulate_once(scenario: str, seed: int, cache: Path) -> Path:
    """The log of a scenario, made anew only where this program changed.

    Args:
        scenario: a key of `slamreplay.simulate.SCENARIOS`.
        seed: of every random number.
        cache: folder of such logs.

    Raises:
        UsageError: there is no such scenario.
        OutputError: the cache cannot be written.
    """
    folder, name = cache / _key(scenario, seed), f"{scenario}.mcap"
    if not (folder / _MARKER).is_file():
        with atomic_folder(folder, marker=_MARKER) as work:
            simulate(scenario, work / name, seed=seed)
            (work / _MARKER).write_text(f"{scenario} {seed}\n", encoding="utf-8")
    return folder / name


def _key(scenario: str, seed: int) -> str:
    root = Path(slamreplay.__file__).parent
    digest = hashlib.sha256(f"{scenario} {seed} {np.__version__}".encode())
    for file in sorted(root.rglob("*.py")):
        digest.update(file.relative_to(root).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:32]
