"""How a worker of this machine starts: dask calls `dask_setup` in its process."""

from __future__ import annotations

import os
import sys
from typing import Any


def dask_setup(worker: Any) -> None:  # noqa: ARG001 - as dask calls it
    """Leave the terminal to the client."""
    sys.stderr.flush()
    silence = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(silence, stream)
    os.close(silence)
