"""Where compiled kernels are kept, for installations whose own folder cannot be written to.

numba keeps them beside the source where it can. Else it tries the user's cache folder, and where
that cannot be written to either, as in containers without a home, it refuses to load the kernels.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

#: numba's own variable.
VARIABLE = "NUMBA_CACHE_DIR"


def keep_kernels(caches: Path) -> None:
    """Set the variable, unless it is set or not needed, before numba is loaded.

    Args:
        caches: folder of the program's caches, made where that is allowed. Else kernels go to a
            folder in the temporary one, which must be the user's own: what lies in it is run.
    """
    if VARIABLE in os.environ or os.access(Path(__file__).parent, os.W_OK):
        return
    user = os.getuid() if hasattr(os, "getuid") else 0
    for folder in (caches, Path(tempfile.gettempdir()) / f"slamreplay-{user}"):
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            status = folder.stat()
        except OSError:
            continue
        own = status.st_uid == user and not status.st_mode & 0o022
        if own and os.access(folder, os.W_OK):
            os.environ[VARIABLE] = str(folder / "numba")
            return
