"""Jobs shared out to threads: only for work that does without Python's lock."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numba


def share_out(count: int, work: Callable[[int, int], None], least: int = 1) -> None:
    """Call `work(first, stop)` for parts that cover 0 to `count`, at once on all cores allowed.

    The work on one index must not depend on which others go with it: then what comes out is the
    same, byte for byte, whatever the number of threads (numba's: NUMBA_NUM_THREADS sets it).

    Args:
        count: of the jobs.
        work: writes its results where nobody else does.
        least: jobs that are worth a thread.
    """
    parts = max(1, min(numba.get_num_threads(), count // max(least, 1)))
    edges = [count * k // parts for k in range(parts + 1)]
    if parts == 1:
        work(0, count)
        return
    with ThreadPoolExecutor(parts) as pool:
        for done in [pool.submit(work, a, b) for a, b in pairwise(edges)]:
            done.result()
