"""Which Gaussians touch which tiles: a counting sort that keeps depth order inside every tile.

The sorted records are cut into one chunk per thread. Counts per (chunk, tile) turn into start positions by a prefix
sum over chunks within tiles, so every chunk then fills its own places: no atomics, and the lists are the same for any
number of threads. A Gaussian's span of tiles is exact per tile row where its box covers more than one tile each way.
"""

from __future__ import annotations

import math

from numba import njit, prange

from engine.raster.cpu import record as rec
from engine.raster.cpu.record import f4

_HALF, _ZERO, _ONE = f4(0.5), f4(0.0), f4(1.0)
_PER_TILE = f4(1.0 / rec.TILE)
_TILE = rec.TILE
_TILE_SPAN = f4(rec.TILE - 1)
_SLACK_PX = f4(1e-3)
"""Added to each side of a span, pixels, against float32 rounding of the square roots."""
_CENTER_X, _CENTER_Y, _MAJOR, _SLOPE, _MINOR = rec.CENTER_X, rec.CENTER_Y, rec.MAJOR, rec.SLOPE, rec.MINOR
_REACH, _TILT, _HALF_WIDTH, _HALF_HEIGHT = rec.REACH, rec.TILT, rec.HALF_WIDTH, rec.HALF_HEIGHT
_COLUMNS, _ROWS, _OPACITY = rec.TILE_COLUMNS, rec.TILE_ROWS, rec.OPACITY


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
    minor = records[i, _MINOR]
    reach = records[i, _REACH]
    inverse_major = _ONE / records[i, _MAJOR]
    top = f4(tile_row * _TILE) + _HALF - records[i, _CENTER_Y]
    bottom = min(top + _TILE_SPAN, half_height)
    top = max(top, -half_height)
    # the rim is widest to the right at +tilt * half_width, to the left at the opposite height
    widest = records[i, _TILT] * half_width
    right_y = min(max(widest, top), bottom)
    left_y = min(max(-widest, top), bottom)
    right = -slope * right_y + math.sqrt(max(_ZERO, (reach - minor * right_y * right_y) * inverse_major))
    left = -slope * left_y - math.sqrt(max(_ZERO, (reach - minor * left_y * left_y) * inverse_major))
    center_x = records[i, _CENTER_X]
    first_pixel = math.ceil(center_x + left - _SLACK_PX - _HALF)
    last_pixel = math.floor(center_x + right + _SLACK_PX - _HALF)
    return (
        _clamped(math.floor(first_pixel * _PER_TILE), first, last),
        _clamped(math.floor(last_pixel * _PER_TILE), first - 1, last),
    )


@njit(parallel=True, **rec.KERNEL_OPTIONS)
def count_pairs(records, packed, n_records, n_columns, counts, pairs_of_record):
    """Count tiles.

    Args:
        records: Sorted records; `packed` is the same memory as int32.
        n_columns: Tiles per image row.
        counts: Pairs per chunk and tile, zeroed here. [chunks, tiles] int64
        pairs_of_record: Tiles of each record, written. [n_records] int32
    """
    n_chunks = len(counts)
    for chunk in prange(n_chunks):
        counts[chunk, :] = 0
        for i in range(n_records * chunk // n_chunks, n_records * (chunk + 1) // n_chunks):
            first_column, last_column = packed[i, _COLUMNS] & 0xFFFF, packed[i, _COLUMNS] >> 16
            first_row, last_row = packed[i, _ROWS] & 0xFFFF, packed[i, _ROWS] >> 16
            is_box = first_column == last_column or first_row == last_row
            total = 0
            for tile_row in range(first_row, last_row + 1):
                left, right = first_column, last_column
                if not is_box:
                    left, right = _span_of_row(records, i, tile_row, first_column, last_column)
                for column in range(left, right + 1):
                    counts[chunk, tile_row * n_columns + column] += 1
                total += max(0, right - left + 1)
            pairs_of_record[i] = total


@njit(**rec.KERNEL_OPTIONS)
def place_pairs(records, counts, pairs_of_record, n_records, tile_starts, trained, record_starts):
    """Turn counts into start positions, in place.

    Args:
        tile_starts: First pair of each tile and one past the last. [tiles + 1] int64
        trained: Written: the records that are not frozen, in order. [n_records] int32
        record_starts: Written: first entry of each record in `pairs_by_record`, -1 for frozen ones. [n_records] int64
    Returns:
        The number of pairs, of trained records, and of the pairs of those.
    """
    n_chunks, n_tiles = counts.shape
    total = 0
    for tile in range(n_tiles):
        tile_starts[tile] = total
        for chunk in range(n_chunks):
            count = counts[chunk, tile]
            counts[chunk, tile] = total
            total += count
    tile_starts[n_tiles] = total
    n_trained = 0
    position = 0
    for i in range(n_records):
        if records[i, _OPACITY] < _ZERO:
            record_starts[i] = -1
        else:
            record_starts[i] = position
            position += pairs_of_record[i]
            trained[n_trained] = i
            n_trained += 1
    return total, n_trained, position


@njit(parallel=True, **rec.KERNEL_OPTIONS)
def fill_pairs(records, packed, n_records, n_columns, counts, record_starts, pair_records, pairs_by_record):
    """Write the lists.

    Args:
        counts: Start positions from `place_pairs`; advanced.
        pair_records: Record of each pair, tile by tile in depth order. [pairs] int32
        pairs_by_record: Pairs of each trained record, record by record, for the backward gather. [trained pairs] int32
    """
    n_chunks = len(counts)
    for chunk in prange(n_chunks):
        for i in range(n_records * chunk // n_chunks, n_records * (chunk + 1) // n_chunks):
            first_column, last_column = packed[i, _COLUMNS] & 0xFFFF, packed[i, _COLUMNS] >> 16
            first_row, last_row = packed[i, _ROWS] & 0xFFFF, packed[i, _ROWS] >> 16
            is_box = first_column == last_column or first_row == last_row
            entry = record_starts[i]
            is_trained = entry >= 0
            for tile_row in range(first_row, last_row + 1):
                left, right = first_column, last_column
                if not is_box:
                    left, right = _span_of_row(records, i, tile_row, first_column, last_column)
                for column in range(left, right + 1):
                    tile = tile_row * n_columns + column
                    pair = counts[chunk, tile]
                    counts[chunk, tile] = pair + 1
                    pair_records[pair] = i
                    if is_trained:
                        pairs_by_record[entry] = pair
                        entry += 1
