"""Backward blending: the tiles are replayed front to back, so that nothing per pixel and Gaussian is stored.

With F the product of upstream gradient and finished pixel, and P what the Gaussians up to and including this one have
contributed to it, the gradient of a Gaussian's alpha is T (color . gradient) - (F - P) / (1 - alpha). F - P is carried
along per pixel (`REMAINDER`). Nine sums per (Gaussian, tile) go to a buffer row that no one else writes:

    sum g, g u, g v, g u^2, g u v, g v^2 and w gradient_rgb,   g = dL/d(log alpha), u and v of `record`, w = alpha T

which is all the projection backward needs (moments of the Cholesky form: no cancellation for needles).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core import cgutils

from engine.backends.cpu.raster import record as rec
from engine.backends.cpu.raster import tile as tl
from engine.backends.cpu.raster.pixels import read_block, subtract_alpha
from engine.backends.cpu.raster.record import f4
from engine.backends.cpu.raster.tile import prefetch
from engine.conventions import ALPHA_MAX
from engine.kernels.jobs import Counter, Floats2, Floats3, Ints1, SmallInts1, read
from engine.kernels.lanes import VECTOR_BYTES, LaneBuilder, Lanes, kernel_intrinsic
from engine.kernels.launch import kernel
from engine.kernels.routines import take_next

_TILE, _BLOCK, _BLOCKS, _BLOCKS_PER_ROW = rec.TILE, rec.BLOCK, rec.BLOCKS, rec.BLOCKS_PER_ROW
_RECORD_BYTES, _PAIR_BYTES = rec.RECORD_BYTES, 4 * rec.PAIR_FLOATS
_AHEAD = tl.PREFETCH_AHEAD
_N_SUMS = 9


def _channels(build: LaneBuilder, fields: list[Any]) -> list[Lanes]:
    return [build.broadcast(fields[column]) for column in (rec.RED, rec.GREEN, rec.BLUE)]


class _Step:
    """One block of pixels behind one record: values the gradient is made of, and the planes advanced."""

    def __init__(self, build: LaneBuilder, footprint: tl.Footprint, channels: list[Lanes], block: Any) -> None:
        self.u, self.v, log_alphas = footprint.at(block)
        plane_t, plane_e = footprint.plane(block, tl.TRANSMITTANCE), footprint.plane(block, tl.REMAINDER)
        self.transmittance = build.load(plane_t)
        is_hit = tl.hits(build, log_alphas, self.transmittance)
        self.unclamped = tl.exp2_eighth(log_alphas)
        self.alpha = self.unclamped.min(ALPHA_MAX).where(is_hit)
        self.weight = self.alpha * self.transmittance
        build.store(tl.transmitted(self.alpha, self.transmittance), plane_t)
        self.gradients = [build.load(footprint.plane(block, plane)) for plane in (tl.PLANE_R, tl.PLANE_G, tl.PLANE_B)]
        self.gain = channels[0] * self.gradients[0] + channels[1] * self.gradients[1] + channels[2] * self.gradients[2]
        self.remainder = build.load(plane_e) - self.weight * self.gain
        build.store(self.remainder, plane_e)


@kernel_intrinsic
def _pass_record(typing_context, scratch, record, tile_x, tile_y, changed_blocks):
    """Replay a frozen record in the blocks it changed: transmittance and remainder only, no sums."""
    signature = types.void(types.int64, types.int64, types.float32, types.float32, types.int64)

    def generate(context, builder, signature, arguments):
        scratch, record, tile_x, tile_y, changed_blocks = arguments
        build = LaneBuilder(builder)
        fields = tl.load_record(build, record)
        footprint = tl.Footprint(build, scratch, fields, tile_x, tile_y)
        channels = _channels(build, fields)

        def pass_block(block):
            _Step(build, footprint, channels, block)

        build.for_each_bit(changed_blocks, pass_block)

    return signature, generate


@kernel_intrinsic
def _replay_record(typing_context, scratch, record, tile_x, tile_y, changed_blocks, sums_address):
    """Replay one record in the blocks it changed and store its nine sums."""
    signature = types.void(types.int64, types.int64, types.float32, types.float32, types.int64, types.int64)

    def generate(context, builder, signature, arguments):
        scratch, record, tile_x, tile_y, changed_blocks, sums_address = arguments
        build = LaneBuilder(builder)
        fields = tl.load_record(build, record)
        footprint = tl.Footprint(build, scratch, fields, tile_x, tile_y)
        channels = _channels(build, fields)
        sums = [cgutils.alloca_once_value(builder, build.constant(0.0).value) for _ in range(_N_SUMS)]

        def add(index: int, value: Lanes) -> None:
            builder.store((Lanes(build, builder.load(sums[index])) + value).value, sums[index])

        def replay_block(block):
            step = _Step(build, footprint, channels, block)
            for index, gradient in enumerate(step.gradients):
                add(6 + index, step.weight * gradient)
            g = step.alpha * (step.transmittance * step.gain - step.remainder / (1.0 - step.alpha))
            g = g.where(step.unclamped.compare("<", ALPHA_MAX))
            gu, gv = g * step.u, g * step.v
            for index, value in enumerate((g, gu, gv, gu * step.u, gu * step.v, gv * step.v)):
                add(index, value)

        build.for_each_bit(changed_blocks, replay_block)
        totals = build.sum_lanes([Lanes(build, builder.load(slot)) for slot in sums])
        build.store_first(totals, rec.PAIR_FLOATS, sums_address)

    return signature, generate


@kernel_intrinsic
def _clear_sums(typing_context, sums_address):
    """Nine zeros, for a record that changed nothing."""
    signature = types.void(types.int64)

    def generate(context, builder, signature, arguments):
        build = LaneBuilder(builder)
        build.store_first(build.constant(0.0), rec.PAIR_FLOATS, arguments[0])

    return signature, generate


class ReplayJob(NamedTuple):
    """Arguments of `replay_tiles`, which fills `pair_sums` for all tiles.

    Attributes:
        pair_slots: Row of pair_sums of each pair, -1 for pairs of frozen Gaussians. [pairs]
        image, transmittance: Results of `blend_tiles`.
        grad_image: Upstream gradient. [H, W, 3]
        grad_alpha: Upstream gradient, or empty where it is zero. [H, W]
        pair_sums: Written. [slots + 1, PAIR_FLOATS]
        Others: As in `BlendJob`.
    """

    records: Floats2
    tile_starts: Ints1
    pair_records: SmallInts1
    pair_slots: SmallInts1
    n_columns: int
    image: Floats3
    transmittance: Floats2
    grad_image: Floats3
    grad_alpha: Floats2
    pair_blocks: Ints1
    pair_sums: Floats2
    scratch: Floats2
    counter: Counter = None


@kernel(ReplayJob, fastmath=rec.FASTMATH)
def replay_tiles(worker, arguments):
    """See ReplayJob."""
    job = read(ReplayJob, arguments)
    records, tile_starts, pair_records, pair_slots = job.records, job.tile_starts, job.pair_records, job.pair_slots
    n_columns, image, transmittance, grad_image = job.n_columns, job.image, job.transmittance, job.grad_image
    grad_alpha, pair_blocks, pair_sums, scratch = job.grad_alpha, job.pair_blocks, job.pair_sums, job.scratch
    counter = job.counter
    height, width = transmittance.shape
    n_tiles = len(tile_starts) - 1
    has_grad_alpha = len(grad_alpha) > 0
    address = np.int64(scratch[worker].ctypes.data)
    records_address = np.int64(records.ctypes.data)
    sums_address = np.int64(pair_sums.ctypes.data)
    image_address, grad_image_address = np.int64(image.ctypes.data), np.int64(grad_image.ctypes.data)
    transmittance_address, grad_alpha_address = np.int64(transmittance.ctypes.data), np.int64(grad_alpha.ctypes.data)
    tile = take_next(counter)
    while tile < n_tiles:
        tile_x = (tile % n_columns) * _TILE
        tile_y = (tile // n_columns) * _TILE
        first, end = tile_starts[tile], tile_starts[tile + 1]
        if first == end:
            tile = take_next(counter)
            continue
        for block in range(_BLOCKS):
            x = tile_x + _BLOCK * (block % _BLOCKS_PER_ROW)
            y = tile_y + _BLOCK * (block // _BLOCKS_PER_ROW)
            planes = address + block * VECTOR_BYTES
            read_block(planes, x, y, width, height, image_address, grad_image_address)
            if has_grad_alpha:
                subtract_alpha(planes, x, y, width, height, transmittance_address, grad_alpha_address)
        for pair in range(first, end):
            changed = pair_blocks[pair]
            slot = pair_slots[pair]
            sums = sums_address + np.int64(slot) * _PAIR_BYTES
            if changed == 0:
                if slot >= 0:
                    _clear_sums(sums)
                continue
            ahead = min(pair + _AHEAD, end - 1)
            prefetch(records_address + np.int64(pair_records[ahead]) * _RECORD_BYTES)
            record_address = records_address + np.int64(pair_records[pair]) * _RECORD_BYTES
            if slot < 0:
                _pass_record(address, record_address, f4(tile_x), f4(tile_y), changed)
            else:
                _replay_record(address, record_address, f4(tile_x), f4(tile_y), changed, sums)
        tile = take_next(counter)
