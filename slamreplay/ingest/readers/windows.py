"""Parts of a container loaded ahead, in threads, a window at a time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol, TypeVar

import numpy as np

from slamreplay.ingest.readers.reader import WINDOW_BYTES, Block


class Loaded(Protocol):
    """A part of a container in memory."""

    @property
    def block(self) -> Block | None:
        """Its messages."""
        ...


_Part = TypeVar("_Part")
_Loaded = TypeVar("_Loaded", bound=Loaded)
#: Decompression and checksums let go of Python's lock, so two threads keep two cores busy.
_THREADS = 2


def loaded(
    parts: Iterable[_Part], size: Callable[[_Part], int], load: Callable[[_Part], _Loaded]
) -> Iterator[list[_Loaded]]:
    """Loaded parts in their order, with about `WINDOW_BYTES` of messages at a time.

    As much again is on its way in threads, while what was given is worked on.

    Args:
        parts: of the container.
        size: bytes that a part takes until the messages that nobody wants are dropped.
        load: reads one; called in threads.
    """
    with ThreadPoolExecutor(_THREADS) as pool:
        coming: deque[tuple[int, Future[_Loaded]]] = deque()
        window: list[_Loaded] = []
        on_the_way = held = 0
        for part in parts:
            coming.append((size(part), pool.submit(load, part)))
            on_the_way += coming[-1][0]
            while on_the_way > WINDOW_BYTES:
                room, future = coming.popleft()
                on_the_way -= room
                window.append(future.result())
                held += _bytes(window[-1])
                if held > WINDOW_BYTES:
                    yield window
                    window, held = [], 0
        window += [future.result() for _, future in coming]
        if window:
            yield window


def _bytes(part: Loaded) -> int:
    return 0 if part.block is None else part.block.data.nbytes


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
