"""Blocks of the inverse of a sparse information matrix: covariances without the dense inverse.

A block Cholesky factor L is made first, H = L L'. Its inverse Z = H^-1 is then known column by
column from the last one on, as far as L's own pattern reaches (Takahashi, Fagan and Chen, Formation
of a sparse bus impedance matrix, 1973): Z_ij = -sum_k Z_ik L_kj L_jj^-1 over the rows k of column
j, and Z_jj = (L_jj L_jj')^-1 - sum_k (L_kj L_jj^-1)' Z_kj. Every Z_ik that this asks for lies in
the pattern that elimination gives L. So no block may leave that pattern because its numbers happen
to be zero: the next column would take the block it misses for a zero of the inverse.

Variables are poses in the plane: all blocks are 3 by 3.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry.se2 import Array

Index = NDArray[np.int64]


def inverse_blocks(
    diagonal: Array, pairs: Index, blocks: Array, order: Index, wanted: Index
) -> tuple[Array, Array]:
    """Diagonal blocks of H^-1, and some that lie off it.

    Args:
        diagonal: (N, 3, 3) blocks H_ii.
        pairs: (E, 2) variables i, j with i != j; a pair may come several times.
        blocks: (E, 3, 3) what each adds to H_ij.
        order: (N,) variables in the order in which they are eliminated.
        wanted: (M, 2) pairs i, j with i != j whose block is asked for; they need not be among
            `pairs`: a pair that no measurement ties costs fill of the factor only.

    Returns:
        (N, 3, 3) blocks (H^-1)_ii and (M, 3, 3) blocks (H^-1)_ij.

    Raises:
        ValueError: H is not positive definite.
    """
    count = len(diagonal)
    rank = np.empty(count, dtype=np.int64)
    rank[order] = np.arange(count)
    ranked = rank[np.concatenate([pairs, wanted]).reshape(-1, 2)]
    low, high = ranked.min(axis=1), ranked.max(axis=1)
    keys, slot = np.unique(low * count + high, return_inverse=True)
    start, row = np.searchsorted(keys, np.arange(count + 1) * count), keys % count
    lower = np.zeros((len(row), 3, 3))
    _add(lower, slot[: len(pairs)], ranked[: len(pairs)], np.ascontiguousarray(blocks))

    stops, rows = _factor_pattern(start, row)
    L, pivots = np.zeros((len(rows), 3, 3)), np.ascontiguousarray(diagonal[order])
    column = np.full((4, count), -1, dtype=np.int64)
    column[2] = stops[:-1]
    if not _factorise(start, row, lower, stops, rows, L, pivots, column):
        raise ValueError("the information matrix is not positive definite")
    column[:] = -1
    Z, Z_diagonal = np.zeros_like(L), np.zeros_like(pivots)
    _takahashi(stops, rows, L, pivots, Z, Z_diagonal, column[0])
    out = np.empty((len(wanted), 3, 3))
    _pick(stops, rows, Z, ranked[len(pairs) :], out)
    return Z_diagonal[rank], out


@njit(cache=True, nogil=True)
def _add(lower, slot, ranked, blocks):  # type: ignore[no-untyped-def]
    """Add each block H_ij to that of its pair in the lower triangle."""
    for e in range(slot.shape[0]):
        for r in range(3):
            for c in range(3):
                if ranked[e, 0] > ranked[e, 1]:
                    lower[slot[e], r, c] += blocks[e, r, c]
                else:
                    lower[slot[e], c, r] += blocks[e, r, c]


def _factor_pattern(start: Index, row: Index) -> tuple[Index, Index]:
    """Starts and sorted rows of the columns of L under the diagonal."""
    count = len(start) - 1
    stops, found = (
        np.zeros(count + 1, dtype=np.int64),
        np.empty(8 * len(row) + count, dtype=np.int64),
    )
    column, done = np.full((3, count), -1, dtype=np.int64), 0
    while done < count:
        done = _gather(start, row, stops, found, column, done)
        if done < count:
            found = np.append(found, np.empty(len(found) + count, dtype=np.int64))
    rows = np.empty(stops[-1], dtype=np.int64)
    _sort_rows(stops, found, rows, np.zeros(count + 1, dtype=np.int64), np.empty_like(rows))
    return stops, rows


@njit(cache=True, nogil=True)
def _gather(start, row, stops, rows, column, done):  # type: ignore[no-untyped-def]
    """Rows of the columns from `done` on, unsorted; the first one for which there is no room.

    A column's rows are those of H and, of every column whose first row it is, the others.
    """
    count = start.shape[0] - 1
    mark, child, sibling = column[0], column[1], column[2]
    for j in range(done, count):
        end = stops[j]
        if end + count - j > rows.shape[0]:
            return j
        mark[j] = j
        for k in range(start[j], start[j + 1]):
            mark[row[k]] = j
            rows[end] = row[k]
            end += 1
        c = child[j]
        while c != -1:
            for k in range(stops[c], stops[c + 1]):
                if mark[rows[k]] != j:
                    mark[rows[k]] = j
                    rows[end] = rows[k]
                    end += 1
            c = sibling[c]
        stops[j + 1] = end
        parent = count
        for k in range(stops[j], end):
            parent = min(parent, rows[k])
        if parent < count:
            sibling[j] = child[parent]
            child[parent] = j
    return count


@njit(cache=True, nogil=True)
def _sort_rows(stops, found, rows, first, columns):  # type: ignore[no-untyped-def]
    """The rows of each column in ascending order: by way of the columns of each row."""
    count = stops.shape[0] - 1
    for k in range(rows.shape[0]):
        first[found[k] + 1] += 1
    for i in range(count):
        first[i + 1] += first[i]
    for j in range(count):
        for k in range(stops[j], stops[j + 1]):
            columns[first[found[k]]] = j
            first[found[k]] += 1
    begin = 0  # first[i] is now where the columns of row i stop
    for i in range(count):
        for k in range(begin, first[i]):
            j = columns[k]
            rows[stops[j]] = i
            stops[j] += 1
        begin = first[i]
    for j in range(count - 1, 0, -1):
        stops[j] = stops[j - 1]
    stops[0] = 0


@njit(cache=True, nogil=True)
def _factorise(start, row, lower, stops, rows, L, pivots, column):  # type: ignore[no-untyped-def]  # noqa: C901
    """Fill in L under the diagonal and the inverses of its diagonal blocks; False if not definite.

    Column by column, each takes off what the columns left of it have in its row. `pivots` holds the
    diagonal blocks of H and then the lower triangular L_jj^-1.
    """
    count = stops.shape[0] - 1
    # The columns that have something in a row are a list: its first, and what follows on each.
    first, following, at, place = column[0], column[1], column[2], column[3]
    for j in range(count):
        for k in range(stops[j], stops[j + 1]):
            place[rows[k]] = k
        for k in range(start[j], start[j + 1]):
            to = place[row[k]]
            for r in range(3):
                for c in range(3):
                    L[to, r, c] = lower[k, r, c]
        left = first[j]
        while left != -1:
            after = following[left]
            here = at[left]
            b00, b01, b02 = L[here, 0, 0], L[here, 0, 1], L[here, 0, 2]
            b10, b11, b12 = L[here, 1, 0], L[here, 1, 1], L[here, 1, 2]
            b20, b21, b22 = L[here, 2, 0], L[here, 2, 1], L[here, 2, 2]
            for r in range(3):
                x, y, z = L[here, r, 0], L[here, r, 1], L[here, r, 2]
                pivots[j, r, 0] -= x * b00 + y * b01 + z * b02
                pivots[j, r, 1] -= x * b10 + y * b11 + z * b12
                pivots[j, r, 2] -= x * b20 + y * b21 + z * b22
            for k in range(here + 1, stops[left + 1]):
                to = place[rows[k]]
                for r in range(3):
                    x, y, z = L[k, r, 0], L[k, r, 1], L[k, r, 2]
                    L[to, r, 0] -= x * b00 + y * b01 + z * b02
                    L[to, r, 1] -= x * b10 + y * b11 + z * b12
                    L[to, r, 2] -= x * b20 + y * b21 + z * b22
            at[left] = here + 1
            if here + 1 < stops[left + 1]:
                following[left] = first[rows[here + 1]]
                first[rows[here + 1]] = left
            left = after
        p = pivots[j]
        l00 = p[0, 0]
        if not l00 > 0.0:
            return False
        l00 = np.sqrt(l00)
        l10, l20 = p[1, 0] / l00, p[2, 0] / l00
        l11 = p[1, 1] - l10 * l10
        if not l11 > 0.0:
            return False
        l11 = np.sqrt(l11)
        l21 = (p[2, 1] - l20 * l10) / l11
        l22 = p[2, 2] - l20 * l20 - l21 * l21
        if not l22 > 0.0:
            return False
        l22 = np.sqrt(l22)
        i00, i11, i22 = 1.0 / l00, 1.0 / l11, 1.0 / l22
        i10 = -l10 * i00 * i11
        i21 = -l21 * i11 * i22
        i20 = -(l20 * i00 + l21 * i10) * i22
        p[0, 0], p[0, 1], p[0, 2] = i00, 0.0, 0.0
        p[1, 0], p[1, 1], p[1, 2] = i10, i11, 0.0
        p[2, 0], p[2, 1], p[2, 2] = i20, i21, i22
        for k in range(stops[j], stops[j + 1]):
            for r in range(3):
                x, y, z = L[k, r, 0], L[k, r, 1], L[k, r, 2]
                L[k, r, 0] = x * i00
                L[k, r, 1] = x * i10 + y * i11
                L[k, r, 2] = x * i20 + y * i21 + z * i22
        if stops[j + 1] > stops[j]:
            following[j] = first[rows[stops[j]]]
            first[rows[stops[j]]] = j
    return True


@njit(cache=True, nogil=True)
def _takahashi(stops, rows, L, pivots, Z, Z_diagonal, place):  # type: ignore[no-untyped-def]  # noqa: C901
    """Blocks of the inverse where L has blocks into `Z`; those of its diagonal into `Z_diagonal`.

    Turns L into L_ij L_jj^-1 on its way.
    """
    count = stops.shape[0] - 1
    for j in range(count - 1, -1, -1):
        p = pivots[j]
        for k in range(stops[j], stops[j + 1]):
            place[rows[k]] = k
            for r in range(3):
                x, y, z = L[k, r, 0], L[k, r, 1], L[k, r, 2]
                L[k, r, 0] = x * p[0, 0] + y * p[1, 0] + z * p[2, 0]
                L[k, r, 1] = y * p[1, 1] + z * p[2, 1]
                L[k, r, 2] = z * p[2, 2]
        for k in range(stops[j], stops[j + 1]):
            other = rows[k]
            a00, a01, a02 = L[k, 0, 0], L[k, 0, 1], L[k, 0, 2]
            a10, a11, a12 = L[k, 1, 0], L[k, 1, 1], L[k, 1, 2]
            a20, a21, a22 = L[k, 2, 0], L[k, 2, 1], L[k, 2, 2]
            D = Z_diagonal[other]
            for r in range(3):
                Z[k, r, 0] -= D[r, 0] * a00 + D[r, 1] * a10 + D[r, 2] * a20
                Z[k, r, 1] -= D[r, 0] * a01 + D[r, 1] * a11 + D[r, 2] * a21
                Z[k, r, 2] -= D[r, 0] * a02 + D[r, 1] * a12 + D[r, 2] * a22
            for m in range(stops[other], stops[other + 1]):
                to = place[rows[m]]
                if to < 0:
                    continue
                for r in range(3):
                    x, y, z = Z[m, r, 0], Z[m, r, 1], Z[m, r, 2]
                    Z[to, r, 0] -= x * a00 + y * a10 + z * a20
                    Z[to, r, 1] -= x * a01 + y * a11 + z * a21
                    Z[to, r, 2] -= x * a02 + y * a12 + z * a22
                for r in range(3):
                    x, y, z = Z[m, 0, r], Z[m, 1, r], Z[m, 2, r]
                    for c in range(3):
                        Z[k, r, c] -= x * L[to, 0, c] + y * L[to, 1, c] + z * L[to, 2, c]
        D = Z_diagonal[j]
        for r in range(3):
            for c in range(3):
                D[r, c] = p[0, r] * p[0, c] + p[1, r] * p[1, c] + p[2, r] * p[2, c]
        for k in range(stops[j], stops[j + 1]):
            for r in range(3):
                for c in range(3):
                    D[r, c] -= (
                        L[k, 0, r] * Z[k, 0, c] + L[k, 1, r] * Z[k, 1, c] + L[k, 2, r] * Z[k, 2, c]
                    )
            place[rows[k]] = -1


@njit(cache=True, nogil=True)
def _pick(stops, rows, Z, ranked, out):  # type: ignore[no-untyped-def]
    """The blocks Z_ij of pairs of ranks."""
    for m in range(ranked.shape[0]):
        i, j = ranked[m, 0], ranked[m, 1]
        low, high = min(i, j), max(i, j)
        k = stops[low]
        while rows[k] != high:
            k += 1
        for r in range(3):
            for c in range(3):
                out[m, r, c] = Z[k, r, c] if i == high else Z[k, c, r]
