"""Numbers of many lines at once."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def table_of_numbers(
    lines: Sequence[bytes], width: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Numbers (N, width) of lines, and the mask (N,) of lines whose fields are all numbers.

    Args:
        lines: N lines of `width` fields each, with blanks between.
        width: fields of a line, 1 or more.

    Returns:
        The numbers, NaN in lines that are not all numbers; "nan" and "inf" are numbers.
    """
    out = np.full((len(lines), width), np.nan)
    sound = np.zeros(len(lines), dtype=bool)
    todo = [(0, len(lines))]
    while todo:  # halved until what is no number stands alone
        first, stop = todo.pop()
        if first == stop:
            continue
        values = _numbers(b" ".join(lines[first:stop]))
        if values is not None and len(values) == (stop - first) * width:
            out[first:stop] = values.reshape(-1, width)
            sound[first:stop] = True
        elif stop - first > 1:
            middle = (first + stop) // 2
            todo += [(first, middle), (middle, stop)]
    return out, sound


def _numbers(text: bytes) -> NDArray[np.float64] | None:
    with warnings.catch_warnings():  # numpy before 2.3 only warns of what is no number
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, dtype=np.float64, sep=" ")
        except (ValueError, DeprecationWarning):
            return None
