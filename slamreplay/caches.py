"""Where the program keeps what it need not make twice."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


def cache_folder() -> Path:
    """`$XDG_CACHE_HOME/slamreplay`, by default under ~/.cache; without a home temporary."""
    named = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(named) if named else Path.home() / ".cache") / "slamreplay"
    except RuntimeError:
        return Path(tempfile.gettempdir()) / "slamreplay"


def run_folder() -> Path:
    """Where runs are kept by the hash of all they depend on."""
    return cache_folder() / "runs"


def bundle_folder() -> Path:
    """Where bundles of raw logs are kept for the commands that ask more than once."""
    return cache_folder() / "bundles"


def watch_folder() -> Path:
    """Where `perturb` tells how far it is, and `inspect` looks."""
    return cache_folder() / "watch"
