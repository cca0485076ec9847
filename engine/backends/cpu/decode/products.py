"""Matrix products of the decode: out[j, lanes] (+)= sum over i of factor[j, i] * vectors[i, lanes].

Vectors run along the lanes, factors are scalars that are broadcast. With anchors in the lanes the factors are weights:
their two strides make one routine serve the forward product and, swapped, the gradient of its input, without packing
and without padding of the layer widths. With inputs of a layer in the lanes and anchors as the depth it is the
gradient of the weights. Four rows times four vectors of accumulators stay in registers: sixteen chains of multiply-add
hide their latency, and eight loads feed sixteen of them.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from engine.kernels.lanes import FLOATS, INT64, VECTOR_BYTES, LaneBuilder, Lanes, kernel_intrinsic
from engine.kernels.routines import ints, routine

PLAIN, RELU, WHERE_POSITIVE, ADD = range(4)
"""The treatment of a finished product: nothing; max with 0; 0 wherever the mask is not above 0; added to `out`."""

_ROWS = 4
_WIDEST = 4 if llvm.get_host_cpu_features().get("avx512f", False) else 1
"""Vectors side by side. Machines with narrower registers split a vector themselves and have fewer of them."""

_SIGNATURE = types.void(*[types.int64] * 11)


def _tile(n_rows: int, n_vectors: int) -> Any:
    """Code of one register tile; arguments as in `multiply`, addresses moved to the tile's first row and vector."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        out, out_row, vectors, vector_row, factors, factor_row, factor_step, depth, bias, finish, mask = arguments
        build = LaneBuilder(builder)

        def place(base: Any, row_bytes: Any, row: int) -> Any:
            return builder.add(base, builder.mul(row_bytes, build.int64(row)))

        sums = [[cgutils.alloca_once(builder, FLOATS) for _ in range(n_vectors)] for _ in range(n_rows)]
        for row in range(n_rows):
            start = _bias_or_zero(build, bias, 4 * row)
            for slot in sums[row]:
                builder.store(start, slot)
        with cgutils.for_range(builder, depth) as loop:
            address = builder.add(vectors, builder.mul(loop.index, vector_row))
            columns = [build.load(address, VECTOR_BYTES * column) for column in range(n_vectors)]
            step = builder.add(factors, builder.mul(loop.index, factor_step))
            for row in range(n_rows):
                factor = build.broadcast(build.load_scalar(place(step, factor_row, row)))
                for column, slot in zip(columns, sums[row], strict=True):
                    total = factor.times_plus(column, Lanes(build, builder.load(slot)))
                    builder.store(total.value, slot)
        after = builder.append_basic_block("finished")
        cases = {kind: builder.append_basic_block(f"finish{kind}") for kind in (RELU, WHERE_POSITIVE, ADD)}
        plain = builder.append_basic_block("plain")
        choice = builder.switch(finish, plain)
        for kind, block in cases.items():
            choice.add_case(build.int64(kind), block)
        for kind, block in [(PLAIN, plain), *cases.items()]:
            builder.position_at_end(block)
            for row in range(n_rows):
                row_address = place(out, out_row, row)
                for vector, slot in enumerate(sums[row]):
                    offset = VECTOR_BYTES * vector
                    total = Lanes(build, builder.load(slot))
                    if kind == RELU:  # keeps NaN, as torch does
                        total = build.constant(0.0).where(total.compare("<", 0.0), total)
                    elif kind == WHERE_POSITIVE:
                        shown = build.load(place(mask, out_row, row), offset)
                        total = build.constant(0.0).where(shown.compare("<=", 0.0), total)
                    elif kind == ADD:
                        total = build.load(row_address, offset) + total
                    build.store(total, row_address, offset)
            builder.branch(after)
        builder.position_at_end(after)

    return generate


def _bias_or_zero(build: LaneBuilder, bias: Any, offset: int) -> Any:
    """The scalar at `bias` + offset in every lane; 0 when the address is 0."""
    builder = build.ir
    has_bias = builder.icmp_unsigned("!=", bias, build.int64(0))
    zero = cgutils.alloca_once_value(builder, ir.Constant(ir.FloatType(), 0.0))
    address = builder.select(has_bias, build.address(bias, offset), builder.ptrtoint(zero, INT64))
    return build.broadcast(build.load_scalar(address)).value


@kernel_intrinsic
def _tile_4x4(typing_context, a, b, c, d, e, f, g, h, i, j, k):
    return _SIGNATURE, _tile(_ROWS, 4)


@kernel_intrinsic
def _tile_4x2(typing_context, a, b, c, d, e, f, g, h, i, j, k):
    return _SIGNATURE, _tile(_ROWS, 2)


@kernel_intrinsic
def _tile_4x1(typing_context, a, b, c, d, e, f, g, h, i, j, k):
    return _SIGNATURE, _tile(_ROWS, 1)


@kernel_intrinsic
def _tile_1x4(typing_context, a, b, c, d, e, f, g, h, i, j, k):
    return _SIGNATURE, _tile(1, 4)


@kernel_intrinsic
def _tile_1x1(typing_context, a, b, c, d, e, f, g, h, i, j, k):
    return _SIGNATURE, _tile(1, 1)


@routine(ints(13))
def multiply(
    out, out_row, vectors, vector_row, factors, factor_row, factor_step, n_rows, depth, n_vectors, bias, finish, mask
):
    """out[j, :] = finish(bias[j] + sum over i of factors[j, i] * vectors[i, :]). Addresses and strides in bytes.

    Args:
        out, out_row: First vector of the result, distance of its rows. 64-byte aligned
        vectors, vector_row: Likewise for the vectors.
        factors, factor_row, factor_step: First factor, distance from j to j + 1, from i to i + 1.
        n_rows, depth, n_vectors: How many j, i and vectors side by side.
        bias: n_rows consecutive floats, or 0 for none.
        finish: PLAIN, RELU, WHERE_POSITIVE or ADD.
        mask: Laid out like `out`; used by WHERE_POSITIVE only.
    """
    vector = 0
    while vector < n_vectors:
        width = n_vectors - vector
        if width >= 4 and _WIDEST == 4:
            width = 4
        elif width >= 2 and _WIDEST == 4:
            width = 2
        else:
            width = 1
        shift = np.int64(64) * vector
        row = 0
        while row < n_rows:
            height = 4 if n_rows - row >= 4 else 1
            o = out + row * out_row + shift
            v = vectors + shift
            f = factors + row * factor_row
            b = bias + 4 * row if bias != 0 else np.int64(0)
            m = mask + row * out_row + shift
            if height == 4 and width == 4:
                _tile_4x4(o, out_row, v, vector_row, f, factor_row, factor_step, depth, b, finish, m)
            elif height == 4 and width == 2:
                _tile_4x2(o, out_row, v, vector_row, f, factor_row, factor_step, depth, b, finish, m)
            elif height == 4:
                _tile_4x1(o, out_row, v, vector_row, f, factor_row, factor_step, depth, b, finish, m)
            elif width == 4:
                _tile_1x4(o, out_row, v, vector_row, f, factor_row, factor_step, depth, b, finish, m)
            else:
                for single in range(width):
                    at = np.int64(64) * single
                    _tile_1x1(o + at, out_row, v + at, vector_row, f, factor_row, factor_step, depth, b, finish, m + at)
            row += height
        vector += width
