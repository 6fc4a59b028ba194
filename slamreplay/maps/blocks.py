"""Maps too large for a picture, in blocks of cells."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Code = TypeVar("Code", np.bool_, np.uint8)


def highest_in_blocks(cells: NDArray[Code], block: int) -> NDArray[Code]:
    """(ceil(H / block), ceil(W / block)) the highest value in each block of cells (H, W).

    So a thin wall survives a coarse picture. What lies beyond the map counts as zero.
    """
    if block == 1:
        return cells
    height, width = (-(-n // block) * block for n in cells.shape)
    whole = np.zeros((height, width), dtype=cells.dtype)
    whole[: cells.shape[0], : cells.shape[1]] = cells
    return whole.reshape(height // block, block, width // block, block).max(axis=(1, 3))
