"""Forward pass of the decode, block by block: grid -> field network -> four heads -> activations -> Gaussians."""

from __future__ import annotations

import numpy as np

from engine.backends.cpu.decode import activation as act
from engine.backends.cpu.decode import layout as lay
from engine.backends.cpu.decode.grid_kernels import interpolate, interpolate_any
from engine.backends.cpu.decode.layout import BLOCK, HEAD_WIDTHS, ROW_BYTES, DecodeJob
from engine.backends.cpu.decode.products import PLAIN, RELU, multiply
from engine.backends.cpu.decode.rows import threes_to_lanes, to_lanes, to_rows
from engine.kernels.jobs import read
from engine.kernels.launch import kernel
from engine.kernels.routines import ints, load_float, load_int, routine, store_float, take_next

_FIRST, _FIRST_BIAS, _SECOND, _SECOND_BIAS = lay.FIRST, lay.FIRST_BIAS, lay.SECOND, lay.SECOND_BIAS
_FIELD_HIDDEN, _FIELD_OUT = lay.FIELD_HIDDEN, lay.FIELD_OUT
_OPACITY, _COLOR, _SHAPE, _OFFSET = lay.OPACITY, lay.COLOR, lay.SHAPE, lay.OFFSET
_POSITION, _COLOR_LOGIT, _STEP, _BASE = lay.POSITION, lay.COLOR_LOGIT, lay.STEP, lay.BASE
_VECTORS, _N_HEADS = lay.BLOCK_VECTORS, lay.N_HEADS


@routine(ints(4))
def encode_block(arguments, first, n_lanes, encoded):
    """Interpolated grid values of one block, one row of padded width per anchor; zeros in rows without anchor."""
    job = read(DecodeJob, arguments)
    width = (job.n_encoded + 15) // 16 * 16
    for lane in range(n_lanes):
        corner = load_int(job.rows + 8 * (first + lane))
        out = encoded + 4 * width * lane
        for knot in range(2):
            table = job.table if knot == 0 else job.next_table
            scale = load_float(job.knot_weights + 4 * knot)
            keys = job.knot_keys + 4 * job.n_levels * knot
            if table != 0 and job.n_channels == 4:
                interpolate(
                    corner, job.corner_indices, job.corner_weights, keys, table, job.n_levels, job.n_entries, scale,
                    knot, out,
                )  # fmt: skip
            elif table != 0:
                interpolate_any(
                    corner, job.corner_indices, job.corner_weights, keys, table, job.n_levels, job.n_entries,
                    job.n_channels, scale, knot, out,
                )  # fmt: skip
        for column in range(job.n_encoded, width):
            store_float(out + 4 * column, np.float32(0))
    for i in range(n_lanes * width, BLOCK * width):
        store_float(encoded + 4 * i, np.float32(0))


@routine(ints(5))
def load_inputs(arguments, first, n_lanes, encoded, scratch):
    """Static and dynamic features of one block to region `inputs`, with the field network applied on the way.

    Args:
        encoded: The output of `encode_block`; 0 for a set without dynamic feature, whose inputs are the static ones.
        scratch: The worker's scratch memory.
    """
    job = read(DecodeJob, arguments)
    inputs = scratch + job.at_inputs
    to_lanes(job.features, 4 * job.n_static, job.rows + 8 * first, n_lanes, job.n_static, inputs)
    if encoded == 0:
        return
    lanes, hidden = scratch + job.at_encoded, scratch + job.at_field_hidden
    to_lanes(encoded, (job.n_encoded + 15) // 16 * 64, job.ordinals, BLOCK, job.n_encoded, lanes)
    multiply(
        hidden, ROW_BYTES, lanes, ROW_BYTES, load_int(job.weights + 8 * _FIELD_HIDDEN), 4 * job.n_encoded, 4,
        job.n_field_hidden, job.n_encoded, _VECTORS, 0, RELU, 0,
    )  # fmt: skip
    multiply(
        inputs + job.n_static * ROW_BYTES, ROW_BYTES, hidden, ROW_BYTES,
        load_int(job.weights + 8 * _FIELD_OUT), 4 * job.n_field_hidden, 4,
        job.n_dynamic, job.n_field_hidden, _VECTORS, 0, RELU if job.is_rectified != 0 else PLAIN, 0,
    )  # fmt: skip


@routine(ints(4))
def first_layer(arguments, head, n_inputs, scratch):
    """Hidden layer of one head to region `hidden`."""
    job = read(DecodeJob, arguments)
    multiply(
        scratch + job.at_hidden, ROW_BYTES, scratch + job.at_inputs, ROW_BYTES,
        load_int(job.weights + 8 * (_FIRST + head)), 4, 4 * job.n_hidden,
        job.n_hidden, n_inputs, _VECTORS, load_int(job.weights + 8 * (_FIRST_BIAS + head)), RELU, 0,
    )  # fmt: skip


@routine(ints(3))
def second_layer(arguments, head, scratch):
    """Raw outputs of one head to region `raw`."""
    job = read(DecodeJob, arguments)
    n_outputs = HEAD_WIDTHS[head] * job.n_gaussians
    multiply(
        scratch + job.at_raw, ROW_BYTES, scratch + job.at_hidden, ROW_BYTES,
        load_int(job.weights + 8 * (_SECOND + head)), 4, 4 * n_outputs,
        n_outputs, job.n_hidden, _VECTORS, load_int(job.weights + 8 * (_SECOND_BIAS + head)), PLAIN, 0,
    )  # fmt: skip


@routine(ints(5))
def _activate(head, k, raw, values, anchor):
    """Raw outputs of one head to its rows of `values`: opacities, colours, scales, quats, means."""
    if head == _OPACITY:
        for g in range(k):
            act.sigmoid_row(raw + g * ROW_BYTES, values + g * ROW_BYTES)
    elif head == _COLOR:
        for i in range(3 * k):
            shift = anchor + (_COLOR_LOGIT + i % 3) * ROW_BYTES
            act.shifted_sigmoid_row(raw + i * ROW_BYTES, shift, values + (k + i) * ROW_BYTES)
    elif head == _SHAPE:
        for g in range(k):
            for axis in range(3):
                base = anchor + (_BASE + axis) * ROW_BYTES
                out = values + (4 * k + 3 * g + axis) * ROW_BYTES
                act.scaled_sigmoid_row(raw + (7 * g + axis) * ROW_BYTES, base, out)
            for axis in range(4):
                act.copy_row(raw + (7 * g + 3 + axis) * ROW_BYTES, values + (7 * k + 4 * g + axis) * ROW_BYTES)
    else:
        for i in range(3 * k):
            position = anchor + (_POSITION + i % 3) * ROW_BYTES
            step = anchor + (_STEP + i % 3) * ROW_BYTES
            act.times_plus_row(raw + i * ROW_BYTES, step, position, values + (11 * k + i) * ROW_BYTES)


@routine(ints(5))
def _decode_block(arguments, first, n_lanes, encoded, scratch):
    job = read(DecodeJob, arguments)
    load_inputs(arguments, first, n_lanes, encoded, scratch)
    anchor = scratch + job.at_anchors
    threes_to_lanes(
        job.positions, job.color_logits, job.log_offset_scales, job.log_base_scales, job.rows + 8 * first, n_lanes,
        anchor,
    )  # fmt: skip
    for row in range(_STEP, _BASE + 3):
        act.exp_row(anchor + row * ROW_BYTES, anchor + row * ROW_BYTES)
    n_inputs = job.n_static + (job.n_dynamic if encoded != 0 else 0)
    values = scratch + job.at_values
    for head in range(_N_HEADS):
        first_layer(arguments, head, n_inputs, scratch)
        second_layer(arguments, head, scratch)
        _activate(head, job.n_gaussians, scratch + job.at_raw, values, anchor)
    k = job.n_gaussians
    start = 4 * k * (job.first_anchor + first)
    to_rows(values, job.opacities + start, 4 * k, job.ordinals, n_lanes, k)
    to_rows(values + k * ROW_BYTES, job.colors + 3 * start, 12 * k, job.ordinals, n_lanes, 3 * k)
    to_rows(values + 4 * k * ROW_BYTES, job.scales + 3 * start, 12 * k, job.ordinals, n_lanes, 3 * k)
    to_rows(values + 7 * k * ROW_BYTES, job.quats + 4 * start, 16 * k, job.ordinals, n_lanes, 4 * k)
    to_rows(values + 11 * k * ROW_BYTES, job.means + 3 * start, 12 * k, job.ordinals, n_lanes, 3 * k)


@kernel(DecodeJob)
def decode_blocks(worker, arguments):
    """Decode the chosen rows of one set; see `DecodeJob`. Which thread decodes a block does not change its result."""
    job = read(DecodeJob, arguments)
    n_blocks = (job.n_rows + BLOCK - 1) // BLOCK
    scratch = job.scratch + worker * job.scratch_bytes
    block_bytes = (job.n_encoded + 15) // 16 * 64 * BLOCK
    block = take_next(job.counter)
    while block < n_blocks:
        first = block * BLOCK
        n_lanes = min(BLOCK, job.n_rows - first)
        encoded = 0
        if job.corner_indices != 0:
            encoded = job.encoded + (block if job.keeps_encoded != 0 else worker) * block_bytes
            encode_block(arguments, first, n_lanes, encoded)
        _decode_block(arguments, first, n_lanes, encoded, scratch)
        block = take_next(job.counter)
