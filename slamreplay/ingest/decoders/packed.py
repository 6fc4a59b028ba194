"""Numbers packed into bytes, as Foxglove's Grid and PointCloud hold them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.ingest.decoders.decoder import Messages

#: foxglove.NumericType; integers and floats are little-endian.
_DTYPES = {1: "<u1", 2: "<i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8"}


@dataclass(frozen=True)
class PackedField:
    """One field of every element.

    Attributes:
        name: its name.
        offset: bytes from the element's first byte to its own.
        dtype: of the number, None where the type is none that is known.
    """

    name: str
    offset: int
    dtype: np.dtype[Any] | None


def packed_fields(messages: Messages) -> list[list[PackedField]]:
    """The `fields` of each message."""
    fields, rows = messages.children("fields")
    found: list[list[PackedField]] = [[] for _ in range(len(messages))]
    columns = (fields.texts("name"), fields.column("offset", np.int64).tolist(),
               fields.column("type", np.int64).tolist())  # fmt: skip
    for row, name, offset, kind in zip(rows.tolist(), *columns, strict=True):
        dtype = np.dtype(_DTYPES[kind]) if kind in _DTYPES else None
        found[row].append(PackedField(name, offset, dtype))
    return found


def unpacked(
    data: NDArray[np.uint8], field: PackedField, counts: tuple[int, ...], strides: tuple[int, ...]
) -> NDArray[Any] | None:
    """A field of all elements, of shape `counts`, or None where the bytes do not hold it.

    Args:
        data: (N,) bytes.
        field: which number of each element.
        counts: number of elements along each axis.
        strides: bytes from one element to the next along each axis.
    """
    if field.dtype is None or field.offset + field.dtype.itemsize > strides[-1]:
        return None
    try:
        cells = np.ndarray(counts, field.dtype, np.ascontiguousarray(data), field.offset, strides)
    except (TypeError, ValueError):
        return None
    return cells.copy()
