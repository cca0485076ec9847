"""Interpolation of the hash grid and its gradient. The slow truth is `encode` in engine.model.grid.

Four channels, the usual number, are one vector of four lanes; other numbers take a plain loop.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from engine.kernels.jobs import Counter, FloatsAt, IntsAt, SmallIntsAt, read
from engine.kernels.lanes import FLOAT, INT32, INT64, LaneBuilder, kernel_intrinsic
from engine.kernels.launch import kernel
from engine.kernels.routines import load_float, load_int, load_int32, routine, store_float, take_next

_FOUR = ir.VectorType(FLOAT, 4)
_N_CORNERS = 8


def _load(builder: Any, address: Any, kind: Any) -> Any:
    return builder.load(builder.inttoptr(address, kind.as_pointer()), align=4)


def _spread(builder: Any, scalar: Any) -> Any:
    undefined = ir.Constant(_FOUR, ir.Undefined)
    first = builder.insert_element(undefined, scalar, ir.Constant(INT32, 0))
    return builder.shuffle_vector(first, undefined, ir.Constant(ir.VectorType(INT32, 4), [0] * 4))


def _times_plus(builder: Any, x: Any, factor: Any, summand: Any) -> Any:
    function_type = ir.FunctionType(_FOUR, [_FOUR] * 3)
    function = cgutils.get_or_insert_function(builder.module, function_type, "llvm.fmuladd.v4f32")
    return builder.call(function, [x, factor, summand])


def _corner(build: LaneBuilder, corner: int, indices: Any, weights: Any, key: Any, table: Any) -> tuple[Any, Any]:
    """Address of a corner's four values and its weight, spread."""
    builder = build.ir
    entry = builder.xor(_load(builder, build.address(indices, 4 * corner), INT32), key)
    index = builder.sext(entry, INT64)
    address = builder.add(table, builder.shl(index, build.int64(4)))
    return address, _spread(builder, _load(builder, build.address(weights, 4 * corner), FLOAT))


@kernel_intrinsic
def _interpolate_four(typing_context, indices, weights, key_address, table, scale, out, adds):
    """out[0:4] = scale * sum of weight * table entry over eight corners, added to what was there if `adds`."""
    signature = types.void(*[types.int64] * 4, types.float32, types.int64, types.int64)

    def generate(context, builder, signature, arguments):
        indices, weights, key_address, table, scale, out, adds = arguments
        build = LaneBuilder(builder)
        key = _load(builder, key_address, INT32)
        zeros = ir.Constant(_FOUR, [0.0] * 4)
        sums = [zeros, zeros]  # two chains hide each other's latency
        for corner in range(_N_CORNERS):
            address, weight = _corner(build, corner, indices, weights, key, table)
            sums[corner % 2] = _times_plus(builder, weight, _load(builder, address, _FOUR), sums[corner % 2])
        total = builder.fmul(builder.fadd(*sums), _spread(builder, scale))
        is_adding = builder.icmp_unsigned("!=", adds, build.int64(0))
        with builder.if_else(is_adding) as (then, otherwise):
            with then:
                before = _load(builder, out, _FOUR)
                builder.store(builder.fadd(before, total), builder.inttoptr(out, _FOUR.as_pointer()), align=4)
            with otherwise:
                builder.store(total, builder.inttoptr(out, _FOUR.as_pointer()), align=4)

    return signature, generate


@kernel_intrinsic
def _spread_four(typing_context, indices, weights, key_address, gradient, scale, d_table):
    """d_table[entry] += scale * weight * gradient[0:4] for eight corners, one after the other: entries may repeat."""
    signature = types.void(*[types.int64] * 4, types.float32, types.int64)

    def generate(context, builder, signature, arguments):
        indices, weights, key_address, gradient, scale, d_table = arguments
        build = LaneBuilder(builder)
        key = _load(builder, key_address, INT32)
        scaled = builder.fmul(_load(builder, gradient, _FOUR), _spread(builder, scale))
        for corner in range(_N_CORNERS):
            address, weight = _corner(build, corner, indices, weights, key, d_table)
            total = _times_plus(builder, weight, scaled, _load(builder, address, _FOUR))
            builder.store(total, builder.inttoptr(address, _FOUR.as_pointer()), align=4)

    return signature, generate


class SpreadJob(NamedTuple):
    """Arguments of `spread_gradient`.

    Attributes:
        rows, n_rows: Rows of the corner table. [n] int64
        corner_indices, corner_weights: Of the corner table. [A, L, 8]
        keys: Of the knot. [L] int32
        d_encoded, row_bytes: Gradient of what `interpolate` wrote, one row per chosen anchor.
        scale: Weight of the knot. [1] float32
        d_table: Added to, or written if `is_first`: 0 where no corner lies. [L, T, C] float32
        n_levels, n_entries, n_channels: L, T, C.
        counter: The next level.
    """

    rows: IntsAt
    n_rows: int
    corner_indices: SmallIntsAt
    corner_weights: FloatsAt
    keys: SmallIntsAt
    d_encoded: FloatsAt
    row_bytes: int
    scale: FloatsAt
    d_table: FloatsAt
    is_first: int
    n_levels: int
    n_entries: int
    n_channels: int
    counter: Counter = None


@routine(types.void(*[types.int64] * 7, types.float32, types.int64, types.int64))
def interpolate(corner, indices, weights, keys, table, n_levels, n_entries, scale, adds, out):
    """Encode one anchor, four channels: out[level * 4 + channel] = scale * interpolated value, or added if `adds`.

    Args:
        corner: Row of the corner table.
        indices, weights: Addresses of the corner table. [A, L, 8] int32 and float32
        keys: Address of what entries are combined with by XOR. [L] int32
        table: Address of one knot's table. [L, T, 4] float32
    """
    for level in range(n_levels):
        place = (corner * n_levels + level) * (4 * _N_CORNERS)
        entries = table + level * n_entries * 16
        _interpolate_four(indices + place, weights + place, keys + 4 * level, entries, scale, out + level * 16, adds)


@routine(types.void(*[types.int64] * 8, types.float32, types.int64, types.int64))
def interpolate_any(corner, indices, weights, keys, table, n_levels, n_entries, n_channels, scale, adds, out):
    """`interpolate` for any number of channels, scalar by scalar."""
    for level in range(n_levels):
        for channel in range(n_channels):
            total = np.float32(0)
            for i in range(_N_CORNERS):
                place = 4 * ((corner * n_levels + level) * _N_CORNERS + i)
                entry = level * n_entries + (load_int32(indices + place) ^ load_int32(keys + 4 * level))
                total += load_float(weights + place) * load_float(table + 4 * (entry * n_channels + channel))
            address = out + 4 * (level * n_channels + channel)
            before = load_float(address) if adds != 0 else np.float32(0)
            store_float(address, before + scale * total)


@kernel(SpreadJob)
def spread_gradient(worker, arguments):
    """Gradient of one knot's table. Arguments: the fields of `SpreadJob`.

    Levels are taken in turn by whichever thread is free; each owns its part of the gradient, so there are no atomics
    on floats and one fixed order of additions.
    """
    job = read(SpreadJob, arguments)
    scale = load_float(job.scale)
    n_levels, n_channels = job.n_levels, job.n_channels
    level = take_next(job.counter)
    while level < n_levels:
        base = job.d_table + level * job.n_entries * n_channels * 4
        key = job.keys + 4 * level
        if job.is_first != 0:
            for i in range(job.n_entries * n_channels):
                store_float(base + 4 * i, np.float32(0))
        for i in range(job.n_rows):
            corner = (load_int(job.rows + 8 * i) * n_levels + level) * (4 * _N_CORNERS)
            indices, weights = job.corner_indices + corner, job.corner_weights + corner
            gradient = job.d_encoded + i * job.row_bytes + 4 * level * n_channels
            if n_channels == 4:
                _spread_four(indices, weights, key, gradient, scale, base)
            else:
                for c in range(_N_CORNERS):
                    weight = scale * load_float(weights + 4 * c)
                    entry = base + 4 * n_channels * (load_int32(indices + 4 * c) ^ load_int32(key))
                    for channel in range(n_channels):
                        before = load_float(entry + 4 * channel)
                        store_float(entry + 4 * channel, before + weight * load_float(gradient + 4 * channel))
        level = take_next(job.counter)
