"""numpy columns to Arrow arrays and back without pandas, which pyarrow's own conversion imports.

That import takes a second of every command that touches a bundle; buffers need none of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray


def numbers_to_arrow(
    values: NDArray[Any], kind: pa.DataType, valid: NDArray[np.bool_] | None = None
) -> pa.Array:
    """An array of numbers (N,) in the type's own dtype; null where `valid` (N,) is false."""
    mask = None if valid is None or bool(valid.all()) else pa.py_buffer(_bits(valid))
    packed = _bits(values) if kind == pa.bool_() else np.ascontiguousarray(values)
    return pa.Array.from_buffers(kind, len(values), [mask, pa.py_buffer(packed)])


def texts_to_arrow(values: NDArray[Any]) -> pa.Array:
    """An array of strings from an object array (N,)."""
    texts = values.tolist()
    names = {name: code for code, name in enumerate(dict.fromkeys(texts))}
    encoded = [name.encode() for name in names]
    ends = np.cumsum([0, *(len(word) for word in encoded)]).astype(np.int32)
    data = pa.py_buffer(b"".join(encoded))
    distinct = pa.Array.from_buffers(pa.string(), len(names), [None, pa.py_buffer(ends), data])
    codes = np.fromiter((names[text] for text in texts), dtype=np.int32, count=len(texts))
    return distinct.take(numbers_to_arrow(codes, pa.int32()))


def numbers_from_arrow(array: pa.Array, dtype: Any) -> NDArray[Any]:
    """(N,) numbers; what lies under nulls is anything."""
    validity, data = array.buffers()
    del validity
    if data is None:
        return np.empty(0, dtype=dtype)
    if pa.types.is_boolean(array.type):
        bits = np.frombuffer(data, dtype=np.uint8)
        flags = np.unpackbits(bits, bitorder="little")
        return flags[array.offset : array.offset + len(array)].astype(np.bool_)
    whole = np.frombuffer(data, dtype=dtype, count=array.offset + len(array))
    return whole[array.offset :]


def nulls_from_arrow(array: pa.Array) -> NDArray[np.bool_]:
    """(N,) which entries are null."""
    return numbers_from_arrow(array.is_null(), np.bool_)


def texts_from_arrow(array: pa.Array) -> NDArray[Any]:
    """(N,) object array of strings."""
    coded = array.dictionary_encode()
    names = np.array([*coded.dictionary.to_pylist(), ""], dtype=object)[:-1]
    return names[numbers_from_arrow(coded.indices, np.int32)]


def _bits(flags: NDArray[Any]) -> NDArray[np.uint8]:
    return np.packbits(np.asarray(flags, dtype=np.bool_), bitorder="little")
