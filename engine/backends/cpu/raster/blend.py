"""Forward blending of tiles, front to back, one 4x4 block of pixels per vector."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types
from numba.core import cgutils

from engine.backends.cpu.raster import record as rec
from engine.backends.cpu.raster import tile as tl
from engine.backends.cpu.raster.pixels import open_block, write_block
from engine.backends.cpu.raster.record import f4
from engine.backends.cpu.raster.tile import prefetch
from engine.conventions import ALPHA_MAX, TRANSMITTANCE_MIN
from engine.kernels.jobs import Counter, Floats1, Floats2, Floats3, Ints1, SmallInts1, read
from engine.kernels.lanes import VECTOR_BYTES, LaneBuilder, kernel_intrinsic
from engine.kernels.launch import kernel
from engine.kernels.routines import take_next

_TILE, _BLOCK, _BLOCKS, _BLOCKS_PER_ROW = rec.TILE, rec.BLOCK, rec.BLOCKS, rec.BLOCKS_PER_ROW
_RECORD_BYTES = rec.RECORD_BYTES
_RECHECK_EVERY = 16
"""Records between two looks for finished blocks. Looking after every record would make each wait for the last."""
_AHEAD = tl.PREFETCH_AHEAD


@kernel_intrinsic
def _find_touched_blocks(typing_context, record, tile_x, tile_y):
    """One bit per block of a tile that a record may touch."""
    signature = types.int64(types.int64, types.float32, types.float32)

    def generate(context, builder, signature, arguments):
        record, tile_x, tile_y = arguments
        build = LaneBuilder(builder)
        return tl.touched_blocks(build, tl.load_record(build, record), tile_x, tile_y)

    return signature, generate


@kernel_intrinsic
def _blend_record(typing_context, scratch, record, tile_x, tile_y, blocks):
    """Blend one record into some blocks of a tile; returns those in which some pixel changed."""
    signature = types.int64(types.int64, types.int64, types.float32, types.float32, types.int64)

    def generate(context, builder, signature, arguments):
        scratch, record, tile_x, tile_y, blocks = arguments
        build = LaneBuilder(builder)
        fields = tl.load_record(build, record)
        footprint = tl.Footprint(build, scratch, fields, tile_x, tile_y)
        channels = [build.broadcast(fields[column]) for column in (rec.RED, rec.GREEN, rec.BLUE)]
        changed_slot = cgutils.alloca_once_value(builder, build.int64(0))

        def blend_block(block):
            _, _, log_alphas = footprint.at(block)
            plane_t = footprint.plane(block, tl.TRANSMITTANCE)
            transmittance = build.load(plane_t)
            is_hit = tl.hits(build, log_alphas, transmittance)
            # no branch around blocks without a hit: predicting it wrongly costs more than blending nothing
            bit = builder.shl(build.some_lane(is_hit), block)
            builder.store(builder.or_(builder.load(changed_slot), bit), changed_slot)
            alpha = tl.exp2_eighth(log_alphas).min(ALPHA_MAX).where(is_hit)
            weight = alpha * transmittance
            build.store(tl.transmitted(alpha, transmittance), plane_t)
            for plane, channel in zip((tl.PLANE_R, tl.PLANE_G, tl.PLANE_B), channels, strict=True):
                address = footprint.plane(block, plane)
                build.store(weight.times_plus(channel, build.load(address)), address)

        build.for_each_bit(blocks, blend_block)
        return builder.load(changed_slot)

    return signature, generate


@kernel_intrinsic
def _find_open_blocks(typing_context, scratch):
    """One bit per block in which some pixel still lets light through."""
    signature = types.int64(types.int64)

    def generate(context, builder, signature, arguments):
        build = LaneBuilder(builder)
        result = cgutils.alloca_once_value(builder, build.int64(0))
        with cgutils.for_range(builder, build.int64(rec.BLOCKS)) as loop:
            plane = builder.add(arguments[0], builder.mul(loop.index, build.int64(VECTOR_BYTES)))
            some = build.some_lane(build.load(plane, tl.TRANSMITTANCE).compare(">=", TRANSMITTANCE_MIN))
            builder.store(builder.or_(builder.load(result), builder.shl(some, loop.index)), result)
        return builder.load(result)

    return signature, generate


class BlendJob(NamedTuple):
    """Arguments of `blend_tiles`, which renders all tiles; one without pairs holds the background.

    Attributes:
        records: Sorted records. [R, 16] 64-byte aligned
        tile_starts, pair_records: Lists of `fill_pairs`.
        n_columns: Tiles per image row.
        background: [3]
        image: Written. [H, W, 3]
        transmittance, alpha: Share of light let through behind the last Gaussian, and one minus it, written. [H, W]
        pair_blocks: Blocks of the tile that each pair changed, one bit each, written. [pairs]
        scratch: One row per worker, 64-byte aligned. [workers, SCRATCH_FLOATS]
        counter: Next tile.
    """

    records: Floats2
    tile_starts: Ints1
    pair_records: SmallInts1
    n_columns: int
    background: Floats1
    image: Floats3
    transmittance: Floats2
    alpha: Floats2
    pair_blocks: Ints1
    scratch: Floats2
    counter: Counter = None


@kernel(BlendJob, fastmath=rec.FASTMATH)
def blend_tiles(worker, arguments):
    """See BlendJob."""
    job = read(BlendJob, arguments)
    records, tile_starts, pair_records, n_columns = job.records, job.tile_starts, job.pair_records, job.n_columns
    background, image, transmittance, alpha = job.background, job.image, job.transmittance, job.alpha
    pair_blocks, scratch, counter = job.pair_blocks, job.scratch, job.counter
    height, width = transmittance.shape
    n_tiles = len(tile_starts) - 1
    address = np.int64(scratch[worker].ctypes.data)
    records_address = np.int64(records.ctypes.data)
    background_address = np.int64(background.ctypes.data)
    image_address = np.int64(image.ctypes.data)
    transmittance_address, alpha_address = np.int64(transmittance.ctypes.data), np.int64(alpha.ctypes.data)
    tile = take_next(counter)
    while tile < n_tiles:
        tile_x = (tile % n_columns) * _TILE
        tile_y = (tile // n_columns) * _TILE
        pair = tile_starts[tile]
        end = tile_starts[tile + 1]
        for block in range(_BLOCKS):
            x = tile_x + _BLOCK * (block % _BLOCKS_PER_ROW)
            y = tile_y + _BLOCK * (block // _BLOCKS_PER_ROW)
            open_block(address + block * VECTOR_BYTES, x, y, width, height)
        open_blocks = _find_open_blocks(address)
        while pair < end and open_blocks != 0:
            stop = min(end, pair + _RECHECK_EVERY)
            # before any of them is blended: the processor looks ahead across records only if their blocks are known
            for soon in range(pair, stop):
                prefetch(records_address + np.int64(pair_records[min(soon + _AHEAD, end - 1)]) * _RECORD_BYTES)
                record_address = records_address + np.int64(pair_records[soon]) * _RECORD_BYTES
                pair_blocks[soon] = _find_touched_blocks(record_address, f4(tile_x), f4(tile_y)) & open_blocks
            while pair < stop:
                blocks = pair_blocks[pair]
                if blocks != 0:
                    record_address = records_address + np.int64(pair_records[pair]) * _RECORD_BYTES
                    pair_blocks[pair] = _blend_record(address, record_address, f4(tile_x), f4(tile_y), blocks)
                pair += 1
            open_blocks = _find_open_blocks(address)
        while pair < end:
            pair_blocks[pair] = 0
            pair += 1
        for block in range(_BLOCKS):
            x = tile_x + _BLOCK * (block % _BLOCKS_PER_ROW)
            y = tile_y + _BLOCK * (block // _BLOCKS_PER_ROW)
            write_block(
                address + block * VECTOR_BYTES,
                x,
                y,
                width,
                height,
                background_address,
                image_address,
                transmittance_address,
                alpha_address,
            )
        tile = take_next(counter)
