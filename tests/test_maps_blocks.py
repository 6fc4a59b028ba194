"""Blocks of cells keep what is thin."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from slamreplay.maps.blocks import highest_in_blocks


@given(
    st.sampled_from([np.uint8, np.bool_]).flatmap(
        lambda kind: arrays(kind, array_shapes(min_dims=2, max_dims=2, max_side=9))
    ),
    st.integers(1, 5),
)
def test_every_block_has_its_highest_cell(cells, block):
    found = highest_in_blocks(cells, block)

    assert found.dtype == cells.dtype
    assert found.shape == tuple(-(-n // block) for n in cells.shape)
    for row, column in np.ndindex(found.shape):
        rows, columns = (slice(k * block, (k + 1) * block) for k in (row, column))
        assert found[row, column] == cells[rows, columns].max()


@pytest.mark.parametrize("block", [2, 3, 7])
def test_a_wall_of_one_cell_survives(block):
    cells = np.zeros((20, 30), dtype=bool)
    cells[:, 17] = True

    assert highest_in_blocks(cells, block).any(axis=1).all()
