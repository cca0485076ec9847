"""The parts that a tile's forward and backward kernel share: scratch layout, reach, the footprint, scheduling.

A tile is 8x8 blocks of 4x4 pixels; lane l of a block is the pixel (l % 4, l // 4). Both kernels evaluate a Gaussian by
the same `Footprint`, in the same operations, so that the backward pass repeats the decisions of the forward one.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types

from engine.backends.cpu.raster import record as rec
from engine.conventions import TRANSMITTANCE_MIN
from engine.kernels.lanes import INT64, N_LANES, VECTOR_BYTES, LaneBuilder, Lanes, kernel_intrinsic

_PLANE = rec.BLOCKS * VECTOR_BYTES
TRANSMITTANCE, PLANE_R, PLANE_G, PLANE_B, REMAINDER = (plane * _PLANE for plane in range(5))
"""Byte offsets of the per-pixel planes of a scratch row, [64 blocks, 16 lanes] each."""
_BLOCK_U = 5 * _PLANE
_ROW_V = _BLOCK_U + 4 * rec.BLOCKS
"""Byte offsets of a record's u of every block, [64], and v of every row of blocks, [16], at the first pixel."""
SCRATCH_FLOATS = (_ROW_V + VECTOR_BYTES) // 4
"""Length of one scratch row; rows start on cache lines."""

_LANE_X = [float(lane % rec.BLOCK) for lane in range(N_LANES)]
_LANE_Y = [float(lane // rec.BLOCK) for lane in range(N_LANES)]
_SIDES = N_LANES // 2
_LOG_BLOCKS_PER_ROW = rec.BLOCKS_PER_ROW.bit_length() - 1
PREFETCH_AHEAD = 6
"""Pairs between asking for a record and blending it."""
_SLACK_PX = 1e-3
_SLACK_PER_PX = 1e-6
"""Slack of a span: fixed, and per pixel of slope * y, against float32 rounding of square roots and products."""


def load_record(build: LaneBuilder, address: Any) -> list[Any]:
    """The fourteen float fields of a record as scalars."""
    return [build.load_scalar(address, 4 * column) for column in range(rec.INVERSE_ROOT + 1)]


def touched_blocks(build: LaneBuilder, fields: list[Any], tile_x: Any, tile_y: Any) -> Any:
    """int64 with one bit per block of a tile that the ellipse alpha = ALPHA_MIN may touch.

    An ellipse cut by a row of blocks is convex, so it touches every block between its leftmost and its rightmost point
    there. The rim is widest to the right at y = tilt * half_width and to the left at minus that, or at the nearest
    height that lies in the row. Lanes 0..7 find the right end of all eight rows, lanes 8..15 the left end, mirrored.

    Args:
        fields: Scalars of `load_record`.
        tile_x, tile_y: First pixel of the tile, float scalars.
    """
    builder = build.ir
    to_left = build.broadcast(builder.fsub(tile_x, fields[rec.CENTER_X]))
    to_top = build.broadcast(builder.fsub(tile_y, fields[rec.CENTER_Y]))
    slope, root_minor, reach, inverse_root, tilt, half_width, half_height = (
        build.broadcast(fields[column])
        for column in (
            rec.SLOPE,
            rec.ROOT_MINOR,
            rec.REACH,
            rec.INVERSE_ROOT,
            rec.TILT,
            rec.HALF_WIDTH,
            rec.HALF_HEIGHT,
        )
    )
    side = build.constants([1.0] * _SIDES + [-1.0] * _SIDES)
    row_top = to_top + build.constants([rec.BLOCK * row + 0.5 for row in range(_SIDES)] * 2)
    row_bottom = row_top + float(rec.BLOCK - 1)
    is_reached = build.all_of([row_top.compare("<=", half_height), row_bottom.compare(">=", -half_height)])
    y = (tilt * half_width * side).max(row_top.max(-half_height)).min(row_bottom.min(half_height))
    lean = slope * y
    v = root_minor * y
    half_span = (reach - v * v).max(0.0).sqrt() * inverse_root
    # distance to the right of the tile's first pixel, or to the left of the last pixel of the first block
    first_pixel = to_left + 0.5
    offset = build.constants([0.0] * _SIDES + [float(rec.BLOCK - 1)] * _SIDES) - side * first_pixel
    slack = lean.abs() * _SLACK_PER_PX + _SLACK_PX
    ends = ((half_span - side * lean + slack + offset) * (1.0 / rec.BLOCK)).floor()
    last = float(rec.BLOCKS_PER_ROW - 1)
    ends = ends.max(build.constants([-1.0] * _SIDES + [-last - 1.0] * _SIDES))
    ends = ends.min(build.constants([last] * _SIDES + [0.0] * _SIDES))
    return _bits_of_spans(build, ends.where(is_reached, -1.0))


def _bits_of_spans(build: LaneBuilder, ends: Lanes) -> Any:
    """Bytes of an int64 from the last block of each row (lanes 0..7) and minus the first one (lanes 8..15)."""
    builder = build.ir
    integers = ends.to_ints()
    eight = ir.VectorType(ir.IntType(32), _SIDES)

    def half(first_lane: int) -> Any:
        lanes = ir.Constant(eight, list(range(first_lane, first_lane + _SIDES)))
        return builder.shuffle_vector(integers, integers, lanes)

    ones, zeros = ir.Constant(eight, [1] * _SIDES), ir.Constant(eight, [0] * _SIDES)
    up_to_last = builder.sub(builder.shl(ones, builder.add(half(0), ones)), ones)
    from_first = builder.shl(ir.Constant(eight, [-1] * _SIDES), builder.sub(zeros, half(_SIDES)))
    in_span = builder.and_(up_to_last, from_first)
    return builder.bitcast(builder.trunc(in_span, ir.VectorType(ir.IntType(8), _SIDES)), INT64)


class Footprint:
    """One Gaussian in the pixels of one tile.

    u and v of a pixel are those of the first pixel of its block plus those of its place in the block. The former are
    written to the scratch row, so that a block costs four operations instead of seven.
    """

    def __init__(self, build: LaneBuilder, scratch: Any, fields: list[Any], tile_x: Any, tile_y: Any) -> None:
        self._build = build
        self._scratch = scratch
        root_major, slope, root_minor, self._log_opacity = (
            build.broadcast(fields[column]) for column in (rec.ROOT_MAJOR, rec.SLOPE, rec.ROOT_MINOR, rec.LOG_OPACITY)
        )
        lane_y = build.constants(_LANE_Y)
        self._u = root_major * slope.times_plus(lane_y, build.constants(_LANE_X))
        self._v = root_minor * lane_y
        first_x = build.broadcast(build.ir.fsub(tile_x, fields[rec.CENTER_X])) + 0.5
        first_y = build.broadcast(build.ir.fsub(tile_y, fields[rec.CENTER_Y])) + 0.5
        lean = root_major * slope
        first_u = root_major * slope.times_plus(first_y, first_x)
        per_row = rec.BLOCKS_PER_ROW
        row_u = root_major.times_plus(
            build.constants([rec.BLOCK * (lane % per_row) for lane in range(N_LANES)]), first_u
        )
        for first in range(0, rec.BLOCKS, N_LANES):
            down = build.constants([rec.BLOCK * (block // per_row) for block in range(first, first + N_LANES)])
            build.store(lean.times_plus(down, row_u), scratch, _BLOCK_U + 4 * first)
        down = build.constants([rec.BLOCK * lane for lane in range(N_LANES)])
        build.store(root_minor * (first_y + down), scratch, _ROW_V)

    def at(self, block: Any) -> tuple[Lanes, Lanes, Lanes]:
        """u, v and log2(alpha) / 8 in the sixteen pixels of a block, an int64."""
        row = self._build.ir.lshr(block, self._build.int64(_LOG_BLOCKS_PER_ROW))
        u, v = self._u + self._entry(_BLOCK_U, block), self._v + self._entry(_ROW_V, row)
        return u, v, (-u).times_plus(u, (-v).times_plus(v, self._log_opacity))

    def plane(self, block: Any, plane: int) -> Any:
        """Address of a block's sixteen pixels in a plane of the scratch row."""
        offset = self._build.ir.shl(block, self._build.int64(6))
        return self._build.address(self._build.address(self._scratch, offset), plane)

    def _entry(self, table: int, index: Any) -> Lanes:
        offset = self._build.ir.shl(index, self._build.int64(2))
        return self._build.broadcast(self._build.load_scalar(self._build.address(self._scratch, offset), table))


def hits(build: LaneBuilder, log_alphas: Lanes, transmittance: Lanes) -> Any:
    """Pixels in which a Gaussian is blended: it is seen there, and light is still let through in front of it."""
    return build.all_of([log_alphas.compare(">=", rec.LOG_ALPHA_MIN), transmittance.compare(">=", TRANSMITTANCE_MIN)])


def transmitted(alpha: Lanes, transmittance: Lanes) -> Lanes:
    """The transmittance behind a Gaussian."""
    return (-alpha).times_plus(transmittance, transmittance)


def exp2_eighth(log_alphas: Lanes) -> Lanes:
    """2^(8 x) for x in [-1, 0]; at least 1 above, so that a clamp may follow."""
    *lower, value = (log_alphas.build.constant(coefficient) for coefficient in rec.EXP2_EIGHTH)
    for coefficient in reversed(lower):
        value = value.times_plus(log_alphas, coefficient)
    for _ in range(3):
        value = value * value
    return value


@kernel_intrinsic
def prefetch(typing_context, address):
    """Ask for the cache line at an address, to be read soon. Any address is allowed."""
    signature = types.void(types.int64)

    def generate(context, builder, signature, arguments):
        LaneBuilder(builder).prefetch(arguments[0])

    return signature, generate
