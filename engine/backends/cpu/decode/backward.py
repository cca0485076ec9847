"""Backward pass of the decode, block by block: hidden layers are computed again instead of stored."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from engine.backends.cpu.decode import activation as act
from engine.backends.cpu.decode import layout as lay
from engine.backends.cpu.decode.forward import first_layer, load_inputs, second_layer
from engine.backends.cpu.decode.layout import BLOCK, HEAD_WIDTHS, ROW_BYTES, DecodeJob
from engine.backends.cpu.decode.products import ADD, PLAIN, WHERE_POSITIVE, multiply
from engine.backends.cpu.decode.rows import threes_to_lanes, to_lanes, to_rows, transpose_block
from engine.kernels.jobs import Counter, FloatsAt, IntsAt, ManyFloats, read
from engine.kernels.launch import kernel
from engine.kernels.routines import ints, load_float, load_int, routine, store_float, take_next

_FIRST, _FIRST_BIAS, _SECOND, _SECOND_BIAS = lay.FIRST, lay.FIRST_BIAS, lay.SECOND, lay.SECOND_BIAS
_FIELD_HIDDEN, _FIELD_OUT, _N_WEIGHTS = lay.FIELD_HIDDEN, lay.FIELD_OUT, lay.N_WEIGHTS
_OPACITY, _COLOR, _SHAPE, _OFFSET = lay.OPACITY, lay.COLOR, lay.SHAPE, lay.OFFSET
_STEP, _BASE, _D_OFFSET, _D_BASE = lay.STEP, lay.BASE, lay.D_LOG_OFFSET, lay.D_LOG_BASE
_VECTORS, _N_HEADS, _MAX_GROUPS = lay.BLOCK_VECTORS, lay.N_HEADS, lay.MAX_GROUPS


@routine(ints(4))
def _load_gradients(arguments, first, n_lanes, scratch):
    """Gradients of the Gaussians of one block to `d_values`, and the values that their derivatives need to `values`."""
    job = read(DecodeJob, arguments)
    k, ordinals = job.n_gaussians, job.ordinals
    start = 4 * k * (job.first_anchor + first)
    d_values, values = scratch + job.at_d_values, scratch + job.at_values
    to_lanes(job.d_opacities + start, 4 * k, ordinals, n_lanes, k, d_values)
    to_lanes(job.opacities + start, 4 * k, ordinals, n_lanes, k, values)
    to_lanes(job.d_colors + 3 * start, 12 * k, ordinals, n_lanes, 3 * k, d_values + k * ROW_BYTES)
    to_lanes(job.colors + 3 * start, 12 * k, ordinals, n_lanes, 3 * k, values + k * ROW_BYTES)
    to_lanes(job.d_scales + 3 * start, 12 * k, ordinals, n_lanes, 3 * k, d_values + 4 * k * ROW_BYTES)
    to_lanes(job.scales + 3 * start, 12 * k, ordinals, n_lanes, 3 * k, values + 4 * k * ROW_BYTES)
    to_lanes(job.d_quats + 4 * start, 16 * k, ordinals, n_lanes, 4 * k, d_values + 7 * k * ROW_BYTES)
    to_lanes(job.d_means + 3 * start, 12 * k, ordinals, n_lanes, 3 * k, d_values + 11 * k * ROW_BYTES)
    anchor = scratch + job.at_anchors
    threes_to_lanes(
        job.positions, job.color_logits, job.log_offset_scales, job.log_base_scales, job.rows + 8 * first, n_lanes,
        anchor,
    )  # fmt: skip
    for axis in range(3):
        act.exp_row(anchor + (_STEP + axis) * ROW_BYTES, anchor + (_STEP + axis) * ROW_BYTES)
        act.exp_negated_row(anchor + (_BASE + axis) * ROW_BYTES, anchor + (_BASE + axis) * ROW_BYTES)
        act.zero_row(anchor + (_D_OFFSET + axis) * ROW_BYTES)
        act.zero_row(anchor + (_D_BASE + axis) * ROW_BYTES)


@routine(ints(7))
def _activate_backward(head, k, values, d_values, raw, d_raw, anchor):
    """Gradient of one head's raw outputs to `d_raw`, and its part of the gradients of the log scales.

    Reads `raw` for the offset head, unless it is 0.
    """
    if head == _OPACITY:
        for g in range(k):
            act.d_sigmoid_row(d_values + g * ROW_BYTES, values + g * ROW_BYTES, d_raw + g * ROW_BYTES)
    elif head == _COLOR:
        for i in range(3 * k):
            place = (k + i) * ROW_BYTES
            act.d_sigmoid_row(d_values + place, values + place, d_raw + i * ROW_BYTES)
    elif head == _SHAPE:
        for g in range(k):
            for axis in range(3):
                place = (4 * k + 3 * g + axis) * ROW_BYTES
                inverse = anchor + (_BASE + axis) * ROW_BYTES
                out = d_raw + (7 * g + axis) * ROW_BYTES
                act.d_scaled_sigmoid_row(d_values + place, values + place, inverse, out)
                act.add_product_row(d_values + place, values + place, anchor + (_D_BASE + axis) * ROW_BYTES)
            for axis in range(4):
                act.copy_row(d_values + (7 * k + 4 * g + axis) * ROW_BYTES, d_raw + (7 * g + 3 + axis) * ROW_BYTES)
    else:
        for i in range(3 * k):
            out = d_raw + i * ROW_BYTES
            act.times_row(d_values + (11 * k + i) * ROW_BYTES, anchor + (_STEP + i % 3) * ROW_BYTES, out)
            if raw != 0:
                act.add_product_row(out, raw + i * ROW_BYTES, anchor + (_D_OFFSET + i % 3) * ROW_BYTES)


@routine(ints(5))
def _add_weight_gradient(n_inputs, inputs_by_anchor, n_outputs, d_outputs, sums):
    """sums[output, input] += sum over anchors of d_outputs[output, anchor] * inputs_by_anchor[anchor, input]."""
    n_vectors = (n_inputs + 15) // 16
    multiply(
        sums, 64 * n_vectors, inputs_by_anchor, 64 * n_vectors, d_outputs, ROW_BYTES, 4,
        n_outputs, BLOCK, n_vectors, 0, ADD, 0,
    )  # fmt: skip


@routine(ints(3))
def _add_bias_gradient(n_outputs, d_outputs, sums):
    for row in range(n_outputs):
        act.add_row_sum(d_outputs + row * ROW_BYTES, sums + row * 64)


@routine(ints(4))
def _heads_backward(arguments, is_dynamic, sums, scratch):
    """From `d_values` to `d_inputs`, and to sums of weight gradients if the heads learn."""
    job = read(DecodeJob, arguments)
    inputs, inputs_by_anchor = scratch + job.at_inputs, scratch + job.at_inputs_rows
    hidden, hidden_by_anchor = scratch + job.at_hidden, scratch + job.at_hidden_rows
    d_raw, d_hidden = scratch + job.at_d_raw, scratch + job.at_d_hidden
    n_all_inputs = job.n_static + job.n_dynamic
    n_inputs = n_all_inputs if is_dynamic != 0 else job.n_static
    # inputs whose gradient is wanted are one range: static ones, dynamic ones, or both
    first_input = 0 if job.wants_features != 0 else job.n_static
    end_input = n_inputs if job.wants_field != 0 else job.n_static
    if job.wants_heads != 0:
        for row in range(n_inputs, (n_all_inputs + 15) // 16 * 16):
            act.zero_row(inputs + row * ROW_BYTES)
        transpose_block(inputs, n_all_inputs, inputs_by_anchor)
    for head in range(_N_HEADS):
        first_layer(arguments, head, n_inputs, scratch)
        raw = 0
        if head == _OFFSET and job.wants_scales != 0:
            second_layer(arguments, head, scratch)
            raw = scratch + job.at_raw
        values, d_values = scratch + job.at_values, scratch + job.at_d_values
        _activate_backward(head, job.n_gaussians, values, d_values, raw, d_raw, scratch + job.at_anchors)
        n_outputs = HEAD_WIDTHS[head] * job.n_gaussians
        multiply(
            d_hidden, ROW_BYTES, d_raw, ROW_BYTES, load_int(job.weights + 8 * (_SECOND + head)), 4 * n_outputs, 4,
            job.n_hidden, n_outputs, _VECTORS, 0, WHERE_POSITIVE, hidden,
        )  # fmt: skip
        if job.wants_heads != 0:
            transpose_block(hidden, job.n_hidden, hidden_by_anchor)
            second = sums + 4 * load_int(job.places + 8 * (_SECOND + head))
            _add_weight_gradient(job.n_hidden, hidden_by_anchor, n_outputs, d_raw, second)
            _add_bias_gradient(n_outputs, d_raw, sums + 4 * load_int(job.places + 8 * (_SECOND_BIAS + head)))
            first = sums + 4 * load_int(job.places + 8 * (_FIRST + head))
            _add_weight_gradient(n_all_inputs, inputs_by_anchor, job.n_hidden, d_hidden, first)
            _add_bias_gradient(job.n_hidden, d_hidden, sums + 4 * load_int(job.places + 8 * (_FIRST_BIAS + head)))
        if end_input > first_input:
            multiply(
                scratch + job.at_d_inputs + first_input * ROW_BYTES, ROW_BYTES, d_hidden, ROW_BYTES,
                load_int(job.weights + 8 * (_FIRST + head)) + first_input * 4 * job.n_hidden, 4 * job.n_hidden, 4,
                end_input - first_input, job.n_hidden, _VECTORS, 0, PLAIN if head == 0 else ADD, 0,
            )  # fmt: skip


@routine(ints(6))
def _field_backward(arguments, n_lanes, encoded, d_encoded, sums, scratch):
    """From the dynamic rows of `d_inputs` to the gradient of the grid values, and sums of weight gradients."""
    job = read(DecodeJob, arguments)
    hidden, d_hidden = scratch + job.at_field_hidden, scratch + job.at_d_field_hidden
    hidden_by_anchor = scratch + job.at_hidden_rows
    d_out = scratch + job.at_d_inputs + job.n_static * ROW_BYTES
    n_hidden, n_encoded, n_dynamic = job.n_field_hidden, job.n_encoded, job.n_dynamic
    if job.is_rectified != 0:
        features = scratch + job.at_inputs + job.n_static * ROW_BYTES
        for row in range(n_dynamic):
            act.where_positive_row(features + row * ROW_BYTES, d_out + row * ROW_BYTES)
    multiply(
        d_hidden, ROW_BYTES, d_out, ROW_BYTES, load_int(job.weights + 8 * _FIELD_OUT), 4, 4 * n_hidden,
        n_hidden, n_dynamic, _VECTORS, 0, WHERE_POSITIVE, hidden,
    )  # fmt: skip
    transpose_block(hidden, n_hidden, hidden_by_anchor)
    out_sums = sums + 4 * load_int(job.places + 8 * _FIELD_OUT)
    _add_weight_gradient(n_hidden, hidden_by_anchor, n_dynamic, d_out, out_sums)
    hidden_sums = sums + 4 * load_int(job.places + 8 * _FIELD_HIDDEN)
    _add_weight_gradient(n_encoded, encoded, n_hidden, d_hidden, hidden_sums)
    lanes = scratch + job.at_d_encoded
    multiply(
        lanes, ROW_BYTES, d_hidden, ROW_BYTES, load_int(job.weights + 8 * _FIELD_HIDDEN), 4, 4 * n_encoded,
        n_encoded, n_hidden, _VECTORS, 0, PLAIN, 0,
    )  # fmt: skip
    to_rows(lanes, d_encoded, (n_encoded + 15) // 16 * 64, job.ordinals, n_lanes, n_encoded)


@kernel(DecodeJob)
def differentiate_blocks(worker, arguments):
    """Gradients of the chosen rows of one set. Arguments: `DecodeJob`.

    Blocks are worked on in a fixed number of runs, whose weight gradients are summed apart; which thread does a run
    does not change its result.
    """
    job = read(DecodeJob, arguments)
    n_blocks = (job.n_rows + BLOCK - 1) // BLOCK
    n_in_group = (n_blocks + _MAX_GROUPS - 1) // _MAX_GROUPS
    scratch = job.scratch + worker * job.scratch_bytes
    block_bytes = (job.n_encoded + 15) // 16 * 64 * BLOCK
    is_dynamic = 1 if job.corner_indices != 0 else 0
    group = take_next(job.counter)
    while group < _MAX_GROUPS:
        sums = job.sums + group * job.sums_bytes
        for block in range(group * n_in_group, min((group + 1) * n_in_group, n_blocks)):
            first = block * BLOCK
            n_lanes = min(BLOCK, job.n_rows - first)
            rows = job.rows + 8 * first
            encoded = job.encoded + block * block_bytes if is_dynamic else 0
            load_inputs(arguments, first, n_lanes, encoded, scratch)
            _load_gradients(arguments, first, n_lanes, scratch)
            _heads_backward(arguments, is_dynamic, sums, scratch)
            if job.wants_features != 0:
                to_rows(scratch + job.at_d_inputs, job.d_features, 4 * job.n_static, rows, n_lanes, job.n_static)
            if job.wants_scales != 0:
                anchor = scratch + job.at_anchors
                to_rows(anchor + _D_OFFSET * ROW_BYTES, job.d_log_offset_scales, 12, rows, n_lanes, 3)
                to_rows(anchor + _D_BASE * ROW_BYTES, job.d_log_base_scales, 12, rows, n_lanes, 3)
            if job.wants_field != 0:
                d_encoded = job.d_encoded + block * block_bytes
                _field_backward(arguments, n_lanes, encoded, d_encoded, sums, scratch)
        group = take_next(job.counter)


class WeightSums(NamedTuple):
    """Arguments of `write_weight_gradients`; one value per weight.

    Attributes:
        sums, sums_bytes, places: As in `DecodeJob`.
        gradients: To write, each laid out like its weight; None for those that are not wanted.
        n_outputs, n_inputs: Widths of each layer; no inputs for a bias. int64
        counter: The next weight.
    """

    sums: FloatsAt
    sums_bytes: int
    places: IntsAt
    gradients: ManyFloats
    n_outputs: IntsAt
    n_inputs: IntsAt
    counter: Counter = None


@kernel(WeightSums)
def write_weight_gradients(worker, arguments):
    """Add the groups' sums in order and write them as gradients. Arguments: `WeightSums`."""
    job = read(WeightSums, arguments)
    kind = take_next(job.counter)
    while kind < _N_WEIGHTS:
        gradient = load_int(job.gradients + 8 * kind)
        if gradient != 0:
            n_outputs, n_inputs = load_int(job.n_outputs + 8 * kind), load_int(job.n_inputs + 8 * kind)
            width = max((n_inputs + 15) // 16 * 16, 16)
            sums = job.sums + 4 * load_int(job.places + 8 * kind)
            for vector in range(n_outputs * width // 16):
                act.add_others(sums + 64 * vector, job.sums_bytes, _MAX_GROUPS)
            for output in range(n_outputs):
                row = sums + 4 * width * output
                if n_inputs == 0:
                    total = np.float32(0)
                    for lane in range(16):
                        total += load_float(row + 4 * lane)
                    store_float(gradient + 4 * output, total)
                for i in range(n_inputs):  # heads keep [inputs, outputs], the field network [outputs, inputs]
                    place = output * n_inputs + i if kind >= _FIELD_HIDDEN else i * n_outputs + output
                    store_float(gradient + 4 * place, load_float(row + 4 * i))
        kind = take_next(job.counter)
