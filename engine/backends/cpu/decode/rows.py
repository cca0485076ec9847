"""Copies between anchor-major memory and rows of a block, 16x16 at a time through a transposition in registers."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from engine.backends.cpu.decode.layout import BLOCK, ROW_BYTES
from engine.kernels.jobs import Counter, FloatsAt, IntsAt, read
from engine.kernels.lanes import (
    FLOATS,
    INT32,
    INT64,
    INTS,
    N_LANES,
    LaneBuilder,
    Lanes,
    kernel_intrinsic,
)
from engine.kernels.launch import kernel
from engine.kernels.routines import ints, load_int, routine, take_next

_BOOLS = ir.VectorType(ir.IntType(1), N_LANES)
_POINTER = FLOATS.as_pointer()
_COPY_PIECE = 256
"""Rows that one worker copies at a time."""


def _first_lanes(build: LaneBuilder, n: Any) -> Any:
    """A mask of the first n lanes; n is an int64."""
    builder = build.ir
    narrow = builder.trunc(n, INT32)
    undefined = ir.Constant(INTS, ir.Undefined)
    limit = builder.shuffle_vector(
        builder.insert_element(undefined, narrow, ir.Constant(INT32, 0)), undefined, ir.Constant(INTS, [0] * N_LANES)
    )
    return builder.icmp_signed("<", ir.Constant(INTS, list(range(N_LANES))), limit)


def _row_addresses(build: LaneBuilder, base: Any, row_bytes: Any, indices: Any, n_rows: Any) -> list[tuple[Any, Any]]:
    """Address of each of sixteen indexed rows and whether it exists; rows past n_rows get the address `base`."""
    builder = build.ir
    found = []
    for lane in range(N_LANES):
        is_row = builder.icmp_signed(">", n_rows, build.int64(lane))
        # row 0 of the indices exists whenever there is work, so it stands in for those that do not
        place = builder.select(is_row, build.address(indices, 8 * lane), indices)
        index = builder.load(builder.inttoptr(place, INT64.as_pointer()))
        found.append((builder.add(base, builder.mul(index, row_bytes)), is_row))
    return found


def _masked_load(build: LaneBuilder, address: Any, mask: Any, otherwise: Any) -> Any:
    types_ = [_POINTER, INT32, _BOOLS, FLOATS]
    load = cgutils.get_or_insert_function(
        build.ir.module, ir.FunctionType(FLOATS, types_), "llvm.masked.load.v16f32.p0"
    )
    return build.ir.call(load, [build.ir.inttoptr(address, _POINTER), ir.Constant(INT32, 4), mask, otherwise])


@kernel_intrinsic
def _sixteen_to_lanes(typing_context, source, row_bytes, indices, n_rows, n_columns, out):
    """Sixteen rows of at most sixteen columns to sixteen rows of a block; zeros where there is nothing."""
    signature = types.void(*[types.int64] * 6)

    def generate(context, builder, signature, arguments):
        source, row_bytes, indices, n_rows, n_columns, out = arguments
        build = LaneBuilder(builder)
        columns = _first_lanes(build, n_columns)
        nothing = ir.Constant(_BOOLS, [0] * N_LANES)
        rows = []
        for address, is_row in _row_addresses(build, source, row_bytes, indices, n_rows):
            mask = builder.select(is_row, columns, nothing)
            rows.append(Lanes(build, _masked_load(build, address, mask, build.constant(0.0).value)))
        for column, lanes in enumerate(build.transpose(rows)):
            build.store(lanes, out, column * ROW_BYTES)

    return signature, generate


@kernel_intrinsic
def _sixteen_to_rows(typing_context, source, out, row_bytes, indices, n_rows, n_columns):
    """Sixteen rows of a block to the first columns of n_rows indexed rows; nothing else is touched."""
    signature = types.void(*[types.int64] * 6)

    def generate(context, builder, signature, arguments):
        source, out, row_bytes, indices, n_rows, n_columns = arguments
        build = LaneBuilder(builder)
        columns = _first_lanes(build, n_columns)
        nothing = ir.Constant(_BOOLS, [0] * N_LANES)
        store_type = ir.FunctionType(ir.VoidType(), [FLOATS, _POINTER, INT32, _BOOLS])
        store = cgutils.get_or_insert_function(builder.module, store_type, "llvm.masked.store.v16f32.p0")
        rows = build.transpose([build.load(source, column * ROW_BYTES) for column in range(N_LANES)])
        places = _row_addresses(build, out, row_bytes, indices, n_rows)
        for lanes, (address, is_row) in zip(rows, places, strict=True):
            mask = builder.select(is_row, columns, nothing)
            builder.call(store, [lanes.value, builder.inttoptr(address, _POINTER), ir.Constant(INT32, 4), mask])

    return signature, generate


@kernel_intrinsic
def _transpose_sixteen(typing_context, source, source_row, out, out_row):
    """A 16x16 matrix, transposed. Strides in bytes, 64-byte aligned."""
    signature = types.void(*[types.int64] * 4)

    def generate(context, builder, signature, arguments):
        source, source_row, out, out_row = arguments
        build = LaneBuilder(builder)
        rows = [build.load(builder.add(source, builder.mul(source_row, build.int64(i)))) for i in range(N_LANES)]
        for i, lanes in enumerate(build.transpose(rows)):
            build.store(lanes, builder.add(out, builder.mul(out_row, build.int64(i))))

    return signature, generate


@routine(ints(6))
def to_lanes(source, row_bytes, indices, n_rows, n_columns, out):
    """Indexed rows to a block: out[column, lane] = source[indices[lane], column]; 0 in lanes from n_rows on.

    Args:
        source, row_bytes: Address of row 0 and distance of rows.
        indices: Address of n_rows int64.
        n_rows, n_columns: At most 64 rows, any number of columns.
        out: Address of the block's first row; padded(n_columns) rows are written.
    """
    for group in range(BLOCK // 16):
        left = min(max(n_rows - 16 * group, 0), 16)
        # groups without rows still read one index
        first = indices + 8 * 16 * group if left > 0 else indices
        for column in range(0, n_columns, 16):
            _sixteen_to_lanes(
                source + 4 * column,
                row_bytes,
                first,
                np.int64(left),
                np.int64(n_columns - column),
                out + column * ROW_BYTES + 64 * group,
            )


@routine(ints(6))
def to_rows(source, out, row_bytes, indices, n_rows, n_columns):
    """A block to indexed rows: out[indices[lane], column] = source[column, lane] for lanes below n_rows."""
    for group in range((n_rows + 15) // 16):
        for column in range(0, n_columns, 16):
            _sixteen_to_rows(
                source + column * ROW_BYTES + 64 * group,
                out + 4 * column,
                row_bytes,
                indices + 8 * 16 * group,
                np.int64(n_rows - 16 * group),
                np.int64(n_columns - column),
            )


@routine(ints(3))
def transpose_block(source, n_columns, out):
    """out[lane, column] = source[column, lane]; rows of `out` hold padded(n_columns) floats."""
    out_row = np.int64((n_columns + 15) // 16 * 64)
    for group in range(BLOCK // 16):
        for column in range(0, n_columns, 16):
            _transpose_sixteen(
                source + column * ROW_BYTES + 64 * group,
                np.int64(ROW_BYTES),
                out + 16 * group * out_row + 4 * column,
                out_row,
            )


@kernel_intrinsic
def _sixteen_threes(typing_context, positions, color_logits, log_offset_scales, log_base_scales, indices, n_rows, out):
    """Three columns of four arrays for sixteen indexed anchors to twelve rows of a block; zeros past n_rows."""

    def generate(context, builder, signature, arguments):
        *arrays, indices, n_rows, out = arguments
        build = LaneBuilder(builder)
        nothing = ir.Constant(_BOOLS, [0] * N_LANES)
        rows = [build.constant(0.0).value] * N_LANES
        for place, array in enumerate(arrays):
            # the address is moved back so that column 0 falls on lane 3 * place; lanes out of the mask are not read
            columns = ir.Constant(_BOOLS, [int(lane // 3 == place) for lane in range(N_LANES)])
            for lane, (address, is_row) in enumerate(_row_addresses(build, array, build.int64(12), indices, n_rows)):
                mask = builder.select(is_row, columns, nothing)
                rows[lane] = _masked_load(build, build.address(address, -12 * place), mask, rows[lane])
        for column, lanes in enumerate(build.transpose([Lanes(build, row) for row in rows])[: 3 * len(arrays)]):
            build.store(lanes, out, column * ROW_BYTES)

    return ints(7), generate


@routine(ints(7))
def threes_to_lanes(positions, color_logits, log_offset_scales, log_base_scales, indices, n_rows, out):
    """The four [A, 3] arrays of indexed anchors to twelve rows of a block, in the order of the arguments."""
    for group in range(BLOCK // 16):
        left = min(max(n_rows - 16 * group, 0), 16)
        first = indices + 8 * 16 * group if left > 0 else indices
        _sixteen_threes(
            positions, color_logits, log_offset_scales, log_base_scales, first, np.int64(left), out + 64 * group
        )


class Copy(NamedTuple):
    """Arguments of `copy_rows`.

    Attributes:
        source, target: float32, anchor-major.
        row_bytes: Of both.
        rows, n_rows: Rows of the source. int64
        first: Row of the target that the first one goes to.
        counter: The next piece.
    """

    source: FloatsAt
    target: FloatsAt
    row_bytes: int
    rows: IntsAt
    n_rows: int
    first: int
    counter: Counter = None


@kernel_intrinsic
def _copy_bytes(typing_context, source, target, n_bytes):
    def generate(context, builder, signature, arguments):
        source, target = (builder.inttoptr(value, ir.IntType(8).as_pointer()) for value in arguments[:2])
        cgutils.raw_memcpy(builder, target, source, arguments[2], 1)

    return ints(3), generate


@kernel(Copy)
def copy_rows(worker, arguments):
    """Copy indexed rows one after the other; neighbours in one go. Arguments: `Copy`."""
    job = read(Copy, arguments)
    first = take_next(job.counter) * _COPY_PIECE
    while first < job.n_rows:
        end = min(first + _COPY_PIECE, job.n_rows)
        while first < end:
            row = load_int(job.rows + 8 * first)
            n = 1
            while first + n < end and load_int(job.rows + 8 * (first + n)) == row + n:
                n += 1
            target = job.target + (job.first + first) * job.row_bytes
            _copy_bytes(job.source + row * job.row_bytes, target, n * job.row_bytes)
            first += n
        first = take_next(job.counter) * _COPY_PIECE
