"""Parts of a container loaded ahead, in threads, a window at a time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from slamreplay.ingest.readers.reader import WINDOW_BYTES, Block

_Part = TypeVar("_Part")
_Loaded = TypeVar("_Loaded")
#: Decompression and checksums let go of Python's lock, so two threads keep two cores busy.
_THREADS = 2


def loaded(
    parts: Iterable[_Part], size: Callable[[_Part], int], load: Callable[[_Part], _Loaded]
) -> Iterator[list[_Loaded]]:
    """Loaded parts in their order, about `WINDOW_BYTES` at a time, one window ahead.

    Args:
        parts: of the container.
        size: bytes that a part will take in memory.
        load: reads one; called in threads.
    """
    with ThreadPoolExecutor(_THREADS) as pool:
        waiting: deque[list[Future[_Loaded]]] = deque()
        window: list[Future[_Loaded]] = []
        held = 0
        for part in parts:
            window.append(pool.submit(load, part))
            held += size(part)
            if held >= WINDOW_BYTES:
                waiting.append(window)
                window, held = [], 0
                if len(waiting) > 1:
                    yield [future.result() for future in waiting.popleft()]
        waiting.append(window)
        for window in waiting:
            if window:
                yield [future.result() for future in window]


def compact(block: Block) -> Block:
    """The block without the bytes that no message of it needs, where these are most of them."""
    sizes = block.end - block.start
    if 2 * int(sizes.sum()) > len(block.data):
        return block
    view = memoryview(block.data.data)
    bounds = zip(block.start.tolist(), block.end.tolist(), strict=True)
    data = np.frombuffer(b"".join([view[a:b] for a, b in bounds]), dtype=np.uint8)
    end = np.cumsum(sizes)
    return Block(data, block.connection, end - sizes, end, block.t_log_ns)
