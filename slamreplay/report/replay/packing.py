"""Arrays and a head of plain values as one text: what `data.js` reads in the browser.

A payload is a little-endian uint32, the length of the head; the head as UTF-8 JSON; and the arrays
one after the other. Integers of several bytes are kept as steps from the value before, and every
array as planes of its lowest bytes, next bytes and so on: neighbours are alike in both, so that
DEFLATE halves them. All of it is one zlib stream (RFC 1950), for which browsers have
`DecompressionStream("deflate")`, in base64 (RFC 4648): no text of a log can end the element that
carries it.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

#: Fixed: the same log gives the same bytes. Level 9 saves 4 % and takes ten times as long.
_LEVEL = 6
#: What the browser has a typed array for.
TYPES = ("uint8", "int16", "int32", "float32")


def packed(head: Mapping[str, object], arrays: Mapping[str, NDArray]) -> bytes:
    """The payload, deflated.

    Args:
        head: plain values; floats must be finite.
        arrays: by name; of a type in `TYPES`. They come back flat, in C order, with their shape.

    Raises:
        ValueError: a type the browser does not know, or a float in the head that is not finite.
    """
    body: list[bytes] = []
    listed = []
    for name, array in arrays.items():
        if array.dtype.name not in TYPES:
            raise ValueError(f"{name} is {array.dtype}, not one of {', '.join(TYPES)}")
        listed.append([name, array.dtype.name, *array.shape])
        body.append(_planes(array))
    text = json.dumps({**head, "arrays": listed}, allow_nan=False, separators=(",", ":"))
    first = text.encode()
    return zlib.compress(len(first).to_bytes(4, "little") + first + b"".join(body), _LEVEL)


def as_text(payload: bytes) -> str:
    """The payload as it stands in the page."""
    return base64.b64encode(payload).decode()


def deflated_size(array: NDArray) -> int:
    """Bytes that an array alone would take in a payload; what budgets are weighed by."""
    return len(zlib.compress(_planes(array), _LEVEL))


def _planes(array: NDArray) -> bytes:
    flat = np.ascontiguousarray(array).ravel()
    if flat.dtype.kind in "iu" and flat.dtype.itemsize > 1:
        flat = np.diff(flat, prepend=flat.dtype.type(0))  # wraps, and so does the way back
    little = flat.astype(flat.dtype.newbyteorder("<"), copy=False)
    return little.view(np.uint8).reshape(-1, flat.dtype.itemsize).T.tobytes()


def short_floats(values: NDArray) -> NDArray[np.float32]:
    """Floats of 12 binary digits: wrong by at most 1/8192 of themselves, and half as large.

    What is not known stays NaN.
    """
    single = np.asarray(values, dtype=np.float32)
    bits = (single.view(np.uint32) + np.uint32(0x400)) & np.uint32(0xFFFFF800)
    return np.where(np.isnan(single), np.float32(np.nan), bits.view(np.float32))
