"""A recording that is written as it is made, on the log's clock alone."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike

TIMELINE = "log_time"
_APPLICATION = "slamreplay"


class Sink:
    """Writes one recording.

    Args:
        path: the file.
        recording_id: the same log always gives the same recording.
        screen: the blueprint that it is opened with.
    """

    def __init__(self, path: Path, recording_id: str, screen: Any) -> None:
        self._stream = rr.RecordingStream(
            _APPLICATION, recording_id=recording_id, send_properties=False
        )
        self._stream.save(path, default_blueprint=screen)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stream.flush()
        self._stream.disconnect()

    def always(self, entity: str, *what: Any) -> None:
        """Something that holds at all times."""
        self._stream.log(entity, *what, static=True)

    def send(self, entity: str, t_ns: ArrayLike, columns: Iterable[Any]) -> None:
        """Rows of columns, each at its time (N,) ns."""
        times = np.asarray(t_ns, dtype=np.int64)
        if len(times):
            at = rr.TimeColumn(TIMELINE, timestamp=times.astype("datetime64[ns]"))
            self._stream.send_columns(entity, [at], columns)
