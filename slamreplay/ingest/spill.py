"""Columns that wait on disk until they are written: logs may hold more than memory does.

While a log is small its rows stay in memory. Once they pass a limit, the wide columns of all topics
go to files of a temporary folder, part by part, and are mapped when somebody asks for them: a map
is let go with the array, so that only what is looked at is in memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged

#: Bytes of rows that are kept in memory.
MEMORY_BYTES = 200_000_000
#: Columns with fewer bytes a row (times, names, single numbers) always stay in memory.
_WIDE_BYTES = 16


class SpilledColumns(Mapping[str, Any]):
    """Columns of one topic by name; the wide ones are read from disk.

    Args:
        folder: an empty folder of this topic's own.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True)
        self._folder = folder
        self._light: dict[str, list[NDArray[Any]]] = {}
        self._wide: dict[str, tuple[str, tuple[int, ...], str]] = {}  # file, shape of a row, dtype
        self._lengths: dict[str, list[NDArray[np.int64]]] = {}
        self._rows = 0

    def append(self, columns: Mapping[str, Any], rows: int) -> None:
        """Rows after those that are there; columns of the same names and kinds."""
        for name, data in columns.items():
            if isinstance(data, Ragged):
                self._lengths.setdefault(name, []).append(data.lengths)
                self._write(name, data.values[data.offsets[0] : data.offsets[-1]], ())
            elif data.dtype != object and data[:1].nbytes >= _WIDE_BYTES:
                self._write(name, data, data.shape[1:])
            else:
                self._light.setdefault(name, []).append(data)
        self._rows += rows

    def __getitem__(self, name: str) -> Any:
        if name in self._light:
            self._light[name] = [np.concatenate(self._light[name])]
            return self._light[name][0]
        file, shape, dtype = self._wide[name]
        path = self._folder / file
        if name in self._lengths:
            lengths = np.concatenate(self._lengths[name])
            offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
            return Ragged(_mapped(path, dtype, (int(offsets[-1]),)), offsets)
        return _mapped(path, dtype, (self._rows, *shape))

    def __iter__(self) -> Iterator[str]:
        return iter([*self._light, *self._wide])

    def __len__(self) -> int:
        return len(self._light) + len(self._wide)

    def _write(self, name: str, values: NDArray[Any], shape: tuple[int, ...]) -> None:
        self._wide.setdefault(name, (f"{len(self._wide)}.bin", shape, values.dtype.str))
        with (self._folder / self._wide[name][0]).open("ab") as stream:
            np.ascontiguousarray(values).tofile(stream)


def _mapped(path: Path, dtype: str, shape: tuple[int, ...]) -> NDArray[Any]:
    if not np.prod(shape):
        return np.empty(shape, dtype=dtype)
    return np.memmap(path, dtype=dtype, mode="r", shape=shape)
