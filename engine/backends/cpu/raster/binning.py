"""Which Gaussians touch which tiles: a counting sort that keeps depth order inside every tile.

The sorted records are cut into one chunk per thread. Counts per (chunk, tile) turn into start positions by a prefix
sum over chunks within tiles, so every chunk then fills its own places: no atomics, and the lists are the same for any
number of threads. A Gaussian's span of tiles is exact per tile row where its box covers more than one tile each way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from engine.backends.cpu.raster import record as rec
from engine.backends.cpu.raster.record import f4
from engine.backends.cpu.raster.tile import prefetch
from engine.kernels.jobs import Flags1, Floats2, Ints2, Rows1, SmallInts1, SmallInts2, read
from engine.kernels.launch import kernel

_HALF, _ZERO = f4(0.5), f4(0.0)
_PER_TILE = f4(1.0 / rec.TILE)
_TILE = rec.TILE
_TILE_SPAN = f4(rec.TILE - 1)
_SLACK_PX = f4(1e-3)
"""Added to each side of a span, pixels, against float32 rounding of the square roots."""
_CENTER_X, _CENTER_Y, _INVERSE_ROOT, _SLOPE, _ROOT_MINOR = (
    rec.CENTER_X,
    rec.CENTER_Y,
    rec.INVERSE_ROOT,
    rec.SLOPE,
    rec.ROOT_MINOR,
)
_REACH, _TILT, _HALF_WIDTH, _HALF_HEIGHT = rec.REACH, rec.TILT, rec.HALF_WIDTH, rec.HALF_HEIGHT
_COLUMNS, _ROWS = rec.TILE_COLUMNS, rec.TILE_ROWS
_RECORD_BYTES = rec.RECORD_BYTES
_AHEAD = 16
"""Records between asking for one and copying it."""


@njit(inline="always")
def _clamped(value, low, high):
    """int(value) within low..high; NaN becomes low, so that no index ever leaves its array."""
    if value >= f4(high):
        return high
    if value > f4(low):
        return int(value)
    return low


@njit(inline="always")
def _span_of_row(records, i, tile_row, first, last):
    """First and last tile column, within first..last, that the ellipse of a record reaches in a tile row."""
    half_width = records[i, _HALF_WIDTH]
    half_height = records[i, _HALF_HEIGHT]
    slope = records[i, _SLOPE]
    root_minor = records[i, _ROOT_MINOR]
    reach = records[i, _REACH]
    inverse_root = records[i, _INVERSE_ROOT]
    top = f4(tile_row * _TILE) + _HALF - records[i, _CENTER_Y]
    bottom = min(top + _TILE_SPAN, half_height)
    top = max(top, -half_height)
    # the rim is widest to the right at +tilt * half_width, to the left at the opposite height
    widest = records[i, _TILT] * half_width
    right_y = min(max(widest, top), bottom)
    left_y = min(max(-widest, top), bottom)
    right_v, left_v = root_minor * right_y, root_minor * left_y
    right = -slope * right_y + math.sqrt(max(_ZERO, reach - right_v * right_v)) * inverse_root
    left = -slope * left_y - math.sqrt(max(_ZERO, reach - left_v * left_v)) * inverse_root
    center_x = records[i, _CENTER_X]
    # np.floor stays in float32, math.floor goes through int64 and float64
    first_pixel = np.ceil(center_x + left - _SLACK_PX - _HALF)
    last_pixel = np.floor(center_x + right + _SLACK_PX - _HALF)
    return (
        _clamped(np.floor(first_pixel * _PER_TILE), first, last),
        _clamped(np.floor(last_pixel * _PER_TILE), first - 1, last),
    )


def mask_sums(tile_mask: np.ndarray) -> np.ndarray:
    """How many tiles above and left of each tile corner are wanted. [rows, columns] bool -> [rows + 1, columns + 1]"""
    return np.pad(tile_mask.cumsum(0, np.int32).cumsum(1, np.int32), ((1, 0), (1, 0)))


class CountJob(NamedTuple):
    """Arguments of `gather_and_count`, one worker a chunk.

    It puts the records into depth order, so that blending reads them almost in order, and counts their tiles.

    Attributes:
        unsorted: Records by row.
        order: Rows by depth. [n_records]
        n_columns: Tiles per image row.
        tile_mask: Tiles that are wanted, empty for all. [tiles]
        records: Sorted records, written.
        packed: The same memory as int32.
        counts: Pairs per chunk and tile, written. [chunks, tiles]
        pairs_of_row: Tiles of each row with a record, written. [N]
    """

    unsorted: Floats2
    order: Rows1
    n_records: int
    n_columns: int
    tile_mask: Flags1
    records: Floats2
    packed: SmallInts2
    counts: Ints2
    pairs_of_row: SmallInts1


@kernel(CountJob, fastmath=rec.FASTMATH)
def gather_and_count(worker, arguments):
    """See CountJob."""
    job = read(CountJob, arguments)
    unsorted, order, n_records, n_columns = job.unsorted, job.order, job.n_records, job.n_columns
    tile_mask, records, packed, counts = job.tile_mask, job.records, job.packed, job.counts
    pairs_of_row = job.pairs_of_row
    chunk, n_chunks = worker, len(counts)
    has_mask = len(tile_mask) > 0
    for tile in range(counts.shape[1]):
        counts[chunk, tile] = 0
    address = np.int64(unsorted.ctypes.data)
    end = n_records * (chunk + 1) // n_chunks
    for i in range(n_records * chunk // n_chunks, end):
        prefetch(address + np.int64(order[min(i + _AHEAD, end - 1)]) * _RECORD_BYTES)
        row = order[i]
        for column in range(rec.RECORD_FLOATS):
            records[i, column] = unsorted[row, column]
        first_column, last_column = packed[i, _COLUMNS] & 0xFFFF, packed[i, _COLUMNS] >> 16
        first_row, last_row = packed[i, _ROWS] & 0xFFFF, packed[i, _ROWS] >> 16
        is_box = first_column == last_column or first_row == last_row
        total = 0
        for tile_row in range(first_row, last_row + 1):
            left, right = first_column, last_column
            if not is_box:
                left, right = _span_of_row(records, i, tile_row, first_column, last_column)
            for tile in range(tile_row * n_columns + left, tile_row * n_columns + right + 1):
                if not has_mask or tile_mask[tile]:
                    counts[chunk, tile] += 1
                    total += 1
        pairs_of_row[row] = total


@njit(**rec.KERNEL_OPTIONS)
def place_pairs(counts, tile_starts):
    """Turn counts into start positions, in place; fill tile_starts [tiles + 1] int64; return the number of pairs."""
    n_chunks, n_tiles = counts.shape
    total = 0
    for tile in range(n_tiles):
        tile_starts[tile] = total
        for chunk in range(n_chunks):
            count = counts[chunk, tile]
            counts[chunk, tile] = total
            total += count
    tile_starts[n_tiles] = total
    return total


@njit(**rec.KERNEL_OPTIONS)
def place_slots(pairs_of_row, is_frozen, trained, row_slots):
    """Give every pair of a row that needs a gradient its row in the buffer of sums: slots of a row are consecutive.

    Args:
        pairs_of_row: [N] int32, 0 where a row is not drawn.
        is_frozen: [N] bool, or empty.
        trained: Written: rows that have slots, ascending. [N] int32
        row_slots: Written: first slot of each row, -1 without. [N] int32
    Returns:
        How many rows have slots, and how many slots there are.
    """
    has_frozen = len(is_frozen) > 0
    n_trained = 0
    n_slots = 0
    for row in range(len(pairs_of_row)):
        n_pairs = pairs_of_row[row]
        if n_pairs == 0 or (has_frozen and is_frozen[row]):
            row_slots[row] = -1
        else:
            row_slots[row] = n_slots
            n_slots += n_pairs
            trained[n_trained] = row
            n_trained += 1
    return n_trained, n_slots


class FillJob(NamedTuple):
    """Arguments of `fill_pairs`, one worker a chunk. It writes the lists.

    Attributes:
        counts: Start positions from `place_pairs`; advanced.
        row_slots: Of `place_slots`; empty where no gradient is wanted.
        pair_records: Record of each pair, tile by tile in depth order. [pairs]
        pair_slots: Row of each pair in the buffer of sums, -1 without; left alone without row_slots. [pairs]
        Others: As in `CountJob`.
    """

    records: Floats2
    packed: SmallInts2
    order: Rows1
    n_records: int
    n_columns: int
    tile_mask: Flags1
    counts: Ints2
    row_slots: SmallInts1
    pair_records: SmallInts1
    pair_slots: SmallInts1


@kernel(FillJob, fastmath=rec.FASTMATH)
def fill_pairs(worker, arguments):
    """See FillJob."""
    job = read(FillJob, arguments)
    records, packed, order, n_records = job.records, job.packed, job.order, job.n_records
    n_columns, tile_mask, counts, row_slots = job.n_columns, job.tile_mask, job.counts, job.row_slots
    pair_records, pair_slots = job.pair_records, job.pair_slots
    chunk, n_chunks = worker, len(counts)
    has_mask = len(tile_mask) > 0
    has_slots = len(row_slots) > 0
    for i in range(n_records * chunk // n_chunks, n_records * (chunk + 1) // n_chunks):
        first_column, last_column = packed[i, _COLUMNS] & 0xFFFF, packed[i, _COLUMNS] >> 16
        first_row, last_row = packed[i, _ROWS] & 0xFFFF, packed[i, _ROWS] >> 16
        is_box = first_column == last_column or first_row == last_row
        slot = np.int32(-1)
        if has_slots:
            slot = row_slots[order[i]]
        for tile_row in range(first_row, last_row + 1):
            left, right = first_column, last_column
            if not is_box:
                left, right = _span_of_row(records, i, tile_row, first_column, last_column)
            for tile in range(tile_row * n_columns + left, tile_row * n_columns + right + 1):
                if has_mask and not tile_mask[tile]:
                    continue
                pair = counts[chunk, tile]
                counts[chunk, tile] = pair + 1
                pair_records[pair] = i
                if has_slots:
                    pair_slots[pair] = slot
                    if slot >= 0:
                        slot += np.int32(1)
