"""What the forward and the backward kernel of a tile share: scratch layout, block terms, the exponential, scheduling.

A tile is 8x8 blocks of 4x4 pixels; lane l of a block is the pixel (l % 4, l // 4). Inside a block the quadratic form
of a Gaussian is expanded around the block's first pixel,

    log2(alpha) / 8 = start + x * step_x + y * step_y - (major * (x + slope * y)^2 + minor * y^2),   x, y in 0..3,

so that a block costs three fused operations; the last bracket is the same for all blocks.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types

from engine.raster.cpu import record as rec
from engine.raster.cpu.lanes import INT64, N_LANES, VECTOR_BYTES, LaneBuilder, Lanes, kernel_intrinsic

LANE_X = [float(lane % rec.BLOCK) for lane in range(N_LANES)]
LANE_Y = [float(lane // rec.BLOCK) for lane in range(N_LANES)]

_GROUPS = rec.BLOCKS // N_LANES
_PLANE = rec.BLOCKS * VECTOR_BYTES
TRANSMITTANCE, PLANE_R, PLANE_G, PLANE_B, REMAINDER = (plane * _PLANE for plane in range(5))
"""Byte offsets of the per-pixel planes of a scratch row, [64 blocks, 16 lanes] each."""
START, STEP_X, STEP_Y = (5 * _PLANE + term * 4 * rec.BLOCKS for term in range(3))
"""Byte offsets of the per-block terms, [64] each."""
SCRATCH_FLOATS = (5 * _PLANE + 3 * 4 * rec.BLOCKS) // 4
"""Length of one scratch row; rows start on cache lines."""
PLANE_FLOATS = _PLANE // 4

_CULL_SLACK = 1e-5
"""Added to the rim when blocks are culled, against float32 rounding of the test itself."""


def load_record(build: LaneBuilder, address: Any) -> list[Any]:
    """The fourteen float fields of a record as scalars."""
    return [build.load_scalar(address, 4 * column) for column in range(rec.OPACITY + 1)]


def store_block_terms(build: LaneBuilder, scratch: Any, fields: list[Any], tile_x: Any, tile_y: Any, cull: bool) -> Any:
    """Write start, step_x and step_y of all blocks to the scratch row.

    Args:
        fields: Scalars of `load_record`.
        tile_x, tile_y: First pixel of the tile, float scalars.
        cull: Also find the blocks that the Gaussian can reach.
    Returns:
        int64 with one bit per block that the ellipse alpha = ALPHA_MIN may touch; 0 when not culling. The least value
        of a convex quadratic form over a rectangle lies on the vertical or horizontal side facing the centre, where
        it is a clamped parabola: two candidates, no square root.
    """
    to_left = build.broadcast(build.ir.fsub(tile_x, fields[rec.CENTER_X]))
    to_top = build.broadcast(build.ir.fsub(tile_y, fields[rec.CENTER_Y]))
    major, slope, minor, tilt, log_opacity, reach = (
        build.broadcast(fields[column])
        for column in (rec.MAJOR, rec.SLOPE, rec.MINOR, rec.TILT, rec.LOG_OPACITY, rec.REACH)
    )
    rim = reach + _CULL_SLACK
    touched = build.int64(0)
    for group in range(_GROUPS):
        blocks = range(group * N_LANES, (group + 1) * N_LANES)
        left = to_left + build.constants([rec.BLOCK * (block % rec.BLOCKS_PER_ROW) + 0.5 for block in blocks])
        top = to_top + build.constants([rec.BLOCK * (block // rec.BLOCKS_PER_ROW) + 0.5 for block in blocks])
        if cull:
            right, bottom = left + float(rec.BLOCK - 1), top + float(rec.BLOCK - 1)
            near_x, near_y = left.max(0.0).min(right), top.max(0.0).min(bottom)
            best_y = (near_x * tilt).max(top).min(bottom)
            best_x = (-(slope * near_y)).max(left).min(right)
            u_side, u_edge = slope * best_y + near_x, slope * near_y + best_x
            on_side = major * u_side * u_side + minor * best_y * best_y
            on_edge = major * u_edge * u_edge + minor * near_y * near_y
            bits = build.mask_bits(on_side.min(on_edge).compare("<=", rim))
            touched = build.ir.or_(touched, build.ir.shl(bits, build.int64(group * N_LANES)))
        u = slope.times_plus(top, left)
        major_u = major * u
        minor_y = minor * top
        step_x = major_u * -2.0
        start = (-minor_y).times_plus(top, (-major_u).times_plus(u, log_opacity))
        step_y = minor_y.times_plus(-2.0, slope * step_x)
        for term, value in ((START, start), (STEP_X, step_x), (STEP_Y, step_y)):
            build.store(value, scratch, term + group * VECTOR_BYTES)
    return touched


class BlockEvaluator:
    """log2(alpha) / 8 of one Gaussian in any block of the tile, after `store_block_terms`."""

    def __init__(self, build: LaneBuilder, scratch: Any, fields: list[Any]) -> None:
        self.build = build
        self.scratch = scratch
        self.x, self.y = build.constants(LANE_X), build.constants(LANE_Y)
        major, slope, minor = (build.broadcast(fields[column]) for column in (rec.MAJOR, rec.SLOPE, rec.MINOR))
        self.u = slope.times_plus(self.y, self.x)
        self.curvature = (-(major * self.u)).times_plus(self.u, -(minor * self.y * self.y))

    def log_alphas(self, block: Any) -> Lanes:
        """Sixteen values; `block` is an int64."""
        start, step_x, step_y = (self.build.broadcast(self._term(block, term)) for term in (START, STEP_X, STEP_Y))
        return self.x.times_plus(step_x, self.y.times_plus(step_y, self.curvature + start))

    def plane(self, block: Any, plane: int) -> Any:
        """Address of a block's sixteen pixels in a plane of the scratch row."""
        offset = self.build.ir.shl(block, self.build.int64(6))
        return self.build.address(self.build.address(self.scratch, offset), plane)

    def _term(self, block: Any, term: int) -> Any:
        offset = self.build.ir.shl(block, self.build.int64(2))
        return self.build.load_scalar(self.build.address(self.scratch, offset), term)


def exp2_eighth(log_alphas: Lanes) -> Lanes:
    """2^(8 x) for x in [-1, 0]; at least 1 above, so that a clamp may follow."""
    *lower, value = (log_alphas.build.constant(coefficient) for coefficient in rec.EXP2_EIGHTH)
    for coefficient in reversed(lower):
        value = value.times_plus(log_alphas, coefficient)
    for _ in range(3):
        value = value * value
    return value


@kernel_intrinsic
def take_next(typing_context, counter_address):
    """Atomically add one to the int64 at an address and return its old value: tiles for whichever thread is free."""
    signature = types.int64(types.int64)

    def generate(context, builder, signature, arguments):
        pointer = builder.inttoptr(arguments[0], INT64.as_pointer())
        return builder.atomic_rmw("add", pointer, ir.Constant(INT64, 1), "monotonic")

    return signature, generate
