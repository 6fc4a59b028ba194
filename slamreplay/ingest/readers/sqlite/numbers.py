"""Numbers in SQLite's files, decoded at many positions at once (sqlite.org/fileformat2.html)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

MAX_PAYLOAD = 2**31 - 1
_INTEGER_BYTES = np.array([0, 1, 2, 3, 4, 6, 8, 8, 0, 0, 0, 0])  # by serial type, below 12


def unsigned(flat: Bytes, at: Ints, width: int) -> Ints:
    """Big-endian unsigned numbers of `width` bytes at the positions."""
    value = np.zeros(len(at), dtype=np.int64)
    for offset in range(width):
        value = (value << 8) | flat[at + offset]
    return value


def signed(flat: Bytes, at: Ints, types: Ints) -> Ints:
    """Integers of these serial types (1 to 6, 8, 9) at the positions."""
    widths = _INTEGER_BYTES[np.clip(types, 0, 11)]
    value = np.zeros(len(at), dtype=np.int64)
    for offset in range(8):
        more = offset < widths
        if not more.any():
            break
        value = np.where(more, (value << 8) | flat[np.where(more, at + offset, 0)], value)
    unused = np.where(widths > 0, 64 - 8 * widths, 0)
    return np.where(types == 9, 1, (value << unused) >> unused)


def varints(flat: Bytes, at: Ints) -> tuple[Ints, Ints]:
    """Variable-length numbers at the positions, and their lengths in bytes (1 to 9)."""
    value = np.zeros(len(at), dtype=np.int64)
    width = np.zeros(len(at), dtype=np.int64)
    more = np.full(len(at), fill_value=True)
    for offset in range(9):
        byte = flat[at + offset].astype(np.int64)
        grown = (value << 8) | byte if offset == 8 else (value << 7) | (byte & 0x7F)
        value = np.where(more, grown, value)
        width += more
        more &= byte >= 0x80
        if not more.any():
            break
    return value, width


def type_bytes(types: Ints) -> Ints:
    """Bytes of values of these serial types; more than any payload where a type is none."""
    short = _INTEGER_BYTES[np.clip(types, 0, 11)]
    size = np.where(types >= 12, (types - 12) >> 1, short)
    return np.where((types < 0) | (types == 10) | (types == 11), MAX_PAYLOAD + 1, size).clip(
        0, MAX_PAYLOAD + 1
    )


def local_bytes(payload: Ints, usable: int) -> Ints:
    """How many bytes of a table's payload are on its leaf page (fileformat2, section 1.6)."""
    most, least = usable - 35, (usable - 12) * 32 // 255 - 23
    rest = least + (payload - least) % (usable - 4)
    return np.where(payload <= most, payload, np.where(rest <= most, rest, least))
