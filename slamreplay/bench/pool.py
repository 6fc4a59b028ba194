"""Cases on several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

import numba

from slamreplay.bench.measure import Measured
from slamreplay.bench.schedule import Case


def played(
    cases: Sequence[Case], jobs: int, play: Callable[[Case], Measured]
) -> Iterator[Measured]:
    """Each case as it is done, from processes of their own: a fresh interpreter per worker.

    Args:
        cases: to be played.
        jobs: processes; with one they are played in this one.
        play: picklable; what it raises ends all.
    """
    if jobs <= 1:
        yield from (play(c) for c in cases)
        return
    # A process has one core to itself: threads within it would only stand in each other's way.
    with ProcessPoolExecutor(
        jobs, get_context("spawn"), initializer=numba.set_num_threads, initargs=(1,)
    ) as pool:
        for future in as_completed([pool.submit(play, c) for c in cases]):
            yield future.result()
