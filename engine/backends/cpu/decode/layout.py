"""Conventions of the decode's kernels: sizes, where things lie in scratch memory, and how weights are numbered.

A block is 64 anchors that go the whole way together. Inside a block a value of all anchors is one row of 64 floats,
so that anchors lie along the lanes: layers of any width need no padding, and what is wrong with one anchor stays in
its lane. Regions hold a multiple of sixteen rows, because copies between anchor-major memory and lanes move 16x16.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from engine.kernels.jobs import Counter, FloatsAt, IntsAt, ManyFloats, SmallIntsAt
from engine.kernels.lanes import N_LANES

BLOCK = 64
"""Anchors per block."""
BLOCK_VECTORS = BLOCK // N_LANES
ROW_BYTES = 4 * BLOCK
"""Bytes from one row of a region to the next."""

HEAD_WIDTHS = (1, 3, 7, 3)
"""Values per Gaussian of each head: opacity, colour, shape, offset."""
OPACITY, COLOR, SHAPE, OFFSET = range(4)
N_HEADS = len(HEAD_WIDTHS)
N_VALUES = sum(HEAD_WIDTHS)

# Order of weights in every list of them. Heads: [inputs, hidden], [hidden], [hidden, K * width], [K * width], each
# four times; then the two layers of the field network, [outputs, inputs] as torch.nn.Linear has them.
FIRST, FIRST_BIAS, SECOND, SECOND_BIAS = (N_HEADS * kind for kind in range(4))
FIELD_HIDDEN, FIELD_OUT = 4 * N_HEADS, 4 * N_HEADS + 1
N_WEIGHTS = FIELD_OUT + 1

MAX_GROUPS = 16
"""Blocks are cut into at most this many runs, each with weight gradients of its own, which are added in order. The
number must not depend on the number of threads: sums would differ in their last bits."""


def padded(n: int) -> int:
    """n rounded up to whole vectors."""
    return (n + N_LANES - 1) // N_LANES * N_LANES


class Sizes(NamedTuple):
    """Widths of a decode.

    Attributes:
        n_gaussians: K, per anchor.
        n_static, n_dynamic: Widths of f_s and f_d.
        n_hidden: Hidden width of a head.
        n_encoded: Values of the grid, levels times channels; 0 without a field.
        n_field_hidden: Hidden width of the field network; 0 without a field.
    """

    n_gaussians: int
    n_static: int
    n_dynamic: int
    n_hidden: int
    n_encoded: int
    n_field_hidden: int


class Regions(NamedTuple):
    """First row of each region of a worker's scratch memory, and the number of rows at the end."""

    encoded: FloatsAt
    field_hidden: int
    inputs: int
    inputs_rows: int
    hidden: int
    hidden_rows: int
    raw: int
    values: int
    d_values: int
    d_raw: int
    d_hidden: int
    d_inputs: int
    d_field_hidden: int
    d_encoded: int
    anchors: int
    n_rows: int


POSITION, COLOR_LOGIT, STEP, BASE = 0, 3, 6, 9
"""Rows of the region `anchors`, three each: position, colour logit, step = exp(log offset scale), base = exp(log base
scale), of which the backward pass has the inverse."""
D_LOG_OFFSET, D_LOG_BASE = 16, 32
"""Rows of the gradients of the log scales, three each, with room for copies of sixteen behind them."""
_ANCHOR_ROWS = 48


def regions(sizes: Sizes, *, is_backward: bool) -> Regions:
    """Where things lie in scratch memory. A region may be followed by garbage up to sixteen rows behind its end."""
    n_inputs = sizes.n_static + sizes.n_dynamic
    n_values = N_VALUES * sizes.n_gaussians
    widths = [sizes.n_encoded, sizes.n_field_hidden, n_inputs]
    # anchor-major copies of a hidden layer: of a head, later of the field network
    n_hidden_rows = max(sizes.n_hidden, sizes.n_field_hidden)
    widths += [n_inputs if is_backward else 0, sizes.n_hidden, n_hidden_rows if is_backward else 0]
    widths += [max(HEAD_WIDTHS) * sizes.n_gaussians, n_values]
    backward = [n_values, n_values, sizes.n_hidden, n_inputs, sizes.n_field_hidden, sizes.n_encoded]
    widths += backward if is_backward else [0] * len(backward)
    starts = [0]
    for width in widths:
        starts.append(starts[-1] + (-(-width // N_LANES) + 1) * N_LANES if width else starts[-1])
    return Regions._make([*starts, starts[-1] + _ANCHOR_ROWS])


class DecodeJob(NamedTuple):
    """The inputs of kernels that go through the blocks of one set; None stands for an array that is not there.

    Attributes:
        Sizes: as in `Sizes`. Regions: as in `Regions`, as byte offsets into a worker's scratch memory.
        weights: All N_WEIGHTS of them, None for those that a model without a field lacks.
        features, positions, color_logits, log_offset_scales, log_base_scales: The set. float32
        rows, n_rows: Rows of it to decode. int64
        corner_indices, corner_weights: Of all its anchors, or None for a set without dynamic feature. [A, L, 8]
        table, next_table: Of the one or two knots. [L, T, C] float32
        knot_weights: [2] float32
        knot_keys: The key combined with entries of each knot and level. [2, L] int32
        is_rectified: Whether the field's network ends in a ReLU.
        n_levels, n_entries, n_channels: L, T, C.
        encoded: Grid values, one row of padded width per chosen anchor. [blocks * 64, ..] float32, or one block per
            worker if not `keeps_encoded`.
        first_anchor: Anchors of earlier sets in the output.
        means, quats, scales, opacities, colors: The output. float32
        ordinals: 0 to 63. int64
        scratch, scratch_bytes: Memory of all workers, and bytes of each.
        counter: The next block, or group of blocks.
        d_means, d_quats, d_scales, d_opacities, d_colors: Gradient of the output.
        wants_features, wants_scales, wants_heads, wants_field: The outputs to compute.
        d_features, d_log_offset_scales, d_log_base_scales: Written at the chosen rows, where wanted.
        d_encoded: Written where the field is wanted; laid out like `encoded`.
        places: Starts of `gradient_places`. int64
        sums, sums_bytes: Sums of weight gradients of the groups, added to, and bytes of each.
    """

    n_gaussians: int
    n_static: int
    n_dynamic: int
    n_hidden: int
    n_encoded: int
    n_field_hidden: int
    at_encoded: int
    at_field_hidden: int
    at_inputs: int
    at_inputs_rows: int
    at_hidden: int
    at_hidden_rows: int
    at_raw: int
    at_values: int
    at_d_values: int
    at_d_raw: int
    at_d_hidden: int
    at_d_inputs: int
    at_d_field_hidden: int
    at_d_encoded: int
    at_anchors: int
    weights: ManyFloats
    features: FloatsAt
    positions: FloatsAt
    color_logits: FloatsAt
    log_offset_scales: FloatsAt
    log_base_scales: FloatsAt
    rows: IntsAt
    n_rows: int
    corner_indices: SmallIntsAt
    corner_weights: FloatsAt
    table: FloatsAt
    next_table: FloatsAt
    knot_weights: FloatsAt
    knot_keys: SmallIntsAt
    is_rectified: int
    n_levels: int
    n_entries: int
    n_channels: int
    encoded: FloatsAt
    keeps_encoded: int
    first_anchor: int
    means: FloatsAt
    quats: FloatsAt
    scales: FloatsAt
    opacities: FloatsAt
    colors: FloatsAt
    ordinals: IntsAt
    scratch: FloatsAt
    scratch_bytes: int
    counter: Counter = None
    d_means: FloatsAt = None
    d_quats: FloatsAt = None
    d_scales: FloatsAt = None
    d_opacities: FloatsAt = None
    d_colors: FloatsAt = None
    wants_features: int = 0
    wants_scales: int = 0
    wants_heads: int = 0
    wants_field: int = 0
    d_features: FloatsAt = None
    d_log_offset_scales: FloatsAt = None
    d_log_base_scales: FloatsAt = None
    d_encoded: FloatsAt = None
    places: IntsAt = None
    sums: FloatsAt = None
    sums_bytes: int = 0


class GradientPlaces(NamedTuple):
    """Where sums of weight gradients lie in a group's memory, in floats; the weights in the order of `FIRST` and so on.

    Matrices are kept as [outputs, inputs rounded up to 16], biases as [outputs, 16] of which the lanes are added last.
    """

    starts: tuple[int, ...]
    n_floats: int


def weight_widths(sizes: Sizes) -> tuple[list[int], list[int]]:
    """Outputs and inputs of every weight; a bias has no inputs."""
    hidden, outputs = [sizes.n_hidden] * N_HEADS, [width * sizes.n_gaussians for width in HEAD_WIDTHS]
    n_outputs = hidden + hidden + outputs + outputs + [sizes.n_field_hidden, sizes.n_dynamic]
    no_inputs = [0] * N_HEADS
    n_inputs = [sizes.n_static + sizes.n_dynamic] * N_HEADS + no_inputs + hidden + no_inputs
    return n_outputs, [*n_inputs, sizes.n_encoded, sizes.n_field_hidden]


def gradient_places(sizes: Sizes) -> GradientPlaces:
    """Places for all weights, also those that do not learn."""
    widths = zip(*weight_widths(sizes), strict=True)
    lengths = [n_outputs * max(padded(n_inputs), N_LANES) for n_outputs, n_inputs in widths]
    starts = np.concatenate([[0], np.cumsum(lengths)]).tolist()
    return GradientPlaces(tuple(starts[:-1]), starts[-1])
