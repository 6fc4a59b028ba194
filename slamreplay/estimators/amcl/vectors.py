"""Sixteen beams at once: the one loop that a compiler leaves at half a processor's width.

LLVM prefers vectors of 256 bits where those of 512 would do twice as much; written out it takes
them, and cuts them up for a processor that has shorter ones only.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

#: Beams at once.
LANES = 16
_FLOAT, _INT = ir.FloatType(), ir.IntType(32)
_FLOATS, _INTS = ir.VectorType(_FLOAT, LANES), ir.VectorType(_INT, LANES)


@intrinsic
def cells_of_beams(_typing, cells, beam, us, vs, pose, border):  # type: ignore[no-untyped-def]
    """Write the table's cells that 16 beams end in to `cells`, from number `beam` on.

    Args: cells uint32; beam uint64; us and vs float32: ends of all beams; pose: column, cosine and
    sine in cells, then row, cosine and sine in cells times the length of a row; border: last
    column, last row and mask of rows. See `field.score_sums`.
    """
    return types.void(cells, beam, us, vs, pose, border), _write


def _write(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    cells, us, vs = (
        builder.gep(context.make_array(kind)(context, builder, value).data, [args[1]])
        for kind, value in ((signature.args[k], args[k]) for k in (0, 2, 3))
    )
    x, cos, sin, y, row_cos, row_sin = (
        _everywhere(builder, builder.extract_value(args[4], k), _FLOATS) for k in range(6)
    )
    last_col, last_row, rows = (
        _everywhere(builder, builder.extract_value(args[5], k), _INTS) for k in range(3)
    )
    u, v = (_at(builder, ends, _FLOATS) for ends in (us, vs))

    def fused(a: Any, b: Any, c: Any) -> Any:
        return builder.call(_fma(builder.module), [a, b, c])

    def least(a: Any, b: Any) -> Any:
        return builder.select(builder.icmp_unsigned("<", a, b), a, b)

    col = builder.fptosi(fused(cos, u, fused(builder.fneg(sin), v, x)), _INTS)
    row = builder.fptosi(fused(row_sin, u, fused(row_cos, v, y)), _INTS)
    found = builder.or_(builder.and_(least(row, last_row), rows), least(col, last_col))
    builder.store(found, builder.bitcast(cells, _INTS.as_pointer())).align = 4
    return context.get_dummy_value()


def _everywhere(builder: Any, number: Any, kind: Any) -> Any:
    """A vector that is the number in all its lanes."""
    none = ir.Constant(kind, ir.Undefined)
    one = builder.insert_element(none, number, ir.Constant(_INT, 0))
    return builder.shuffle_vector(one, none, ir.Constant(_INTS, [0] * LANES))


def _at(builder: Any, pointer: Any, kind: Any) -> Any:
    """The vector at a pointer, which is aligned for a number only."""
    loaded = builder.load(builder.bitcast(pointer, kind.as_pointer()))
    loaded.align = 4
    return loaded


def _fma(module: Any) -> Any:
    name = f"llvm.fma.v{LANES}f32"
    return module.globals.get(name) or ir.Function(
        module, ir.FunctionType(_FLOATS, [_FLOATS] * 3), name=name
    )
