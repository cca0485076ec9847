"""L1 + SSIM against a picture, value and gradient in one pass.

A band of rows runs through three stages, four rows at a time, each stage five rows behind the one before: blur along
rows; blur along columns, SSIM, and blur of its derivatives along rows; blur of those along columns and the gradient.
Rings of sixteen rows carry rows from stage to stage, so that nothing but the pictures leaves the core's cache. Each
band belongs to one thread and repeats what it needs of its neighbours. Wide pictures are cut into strips of columns.

The truth is blurred anew at every step. Blurring it once per picture and reading its two planes of moments back was
slower in every comparison on the measured machine, because memory costs more there than arithmetic: one core, loss and
gradient, with and without stored moments 1.3 and 1.2 ms at 320 x 240, 4.2 and 3.3 ms at 640 x 360.

Letters: a is the image after gain and replacement, b the truth; c the first row of the gradient stage; v sixteen
values. Every sum is taken per row and strip in a fixed order, so bits depend neither on bands nor on threads.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from numba import get_num_threads, types
from torch import Tensor

from engine.images.ssim_lanes import (
    N_ROWS,
    RADIUS,
    RING_ROWS,
    blur_along,
    blur_moments,
    clear_lanes,
    gradient_rows,
    ssim_rows,
)
from engine.kernels.fast_math import fast_math
from engine.kernels.jobs import Bytes2, Doubles3, Flags2, Floats1, Floats2, Floats3, Ints1, Ints3, read
from engine.kernels.launch import kernel, launch
from engine.kernels.routines import ints, load_float, routine
from engine.raster.pinhole_view import TILE_PX, n_tiles

_TILE_VALUES = 3 * TILE_PX
_TILE_VECTORS = _TILE_VALUES // 16
_STRIP_TILES = 10
_PAD = 16
"""Zeros on both ends of a row; the window reaches 15 values."""
_MIN_BAND_ROWS = 24
"""A band repeats about 16 rows of work of its neighbours; more bands than this would mostly repeat."""

# rows of the scratch of a band: rings, then single rows
_A, _B = 0, RING_ROWS
_MOMENTS = 2 * RING_ROWS
_PARTIALS = 6 * RING_ROWS
_TERMS = 9 * RING_ROWS
_GRADIENT = _TERMS + 3 * N_ROWS
_INSIDE = _GRADIENT + N_ROWS
_GAIN_SUM = _INSIDE + 1
_N_SCRATCH_ROWS = _GAIN_SUM + 1
_N_SUMS = 4 * N_ROWS
"""Vectors of sums of a band, one a row each: |a - b|, (a - b)^2, 1 - SSIM, and 1 - SSIM that another strip counts."""

_BYTE = np.float32(1.0 / 255.0)
_ZERO, _ONE = np.float32(0), np.float32(1)
_FASTMATH = fast_math("contract", "nsz", "arcp")


class LossJob(NamedTuple):
    """Arguments of `loss_band`: a picture in rows of 3 W values, cut into bands and strips.

    Attributes:
        image: a before gain and replacement. [H, 3 W]
        truth, truth_bytes: b as numbers or as bytes, the other one empty: compiled once for both. [H, 3 W]
        gains: Of the channels, for a row. [3 W]
        has_gain: Whether their gradient is wanted.
        is_counted: Pixels that count; empty for all. [H, W]
        active: Tiles that count. [rows, columns]
        rest: Like the image, what the other tiles hold; empty for the truth. [H, 3 W]
        scales: Weights of |a - b| and of SSIM in the loss. [2]
        band_rows: Rows at which bands start, and the end. [n_bands + 1]
        scratch: [n_bands, rows, floats of a row]
        lane_sums: Sums in vectors. [n_bands, 16 * sums]
        runs: [n_bands, tile columns + 1, 2]
        gradient: By the image, written. [H, 3 W]
        sums: |a - b|, (a - b)^2 and 1 - SSIM by row and strip, written. [H, strips, 3]
        gain_sums: Gradient by the gains of four rows, added to. [ceil(H / 4), strips, 3]
    """

    image: Floats2
    truth: Floats2
    truth_bytes: Bytes2
    gains: Floats1
    has_gain: int
    is_counted: Flags2
    active: Flags2
    rest: Floats2
    scales: Floats1
    band_rows: Ints1
    scratch: Floats3
    lane_sums: Floats2
    runs: Ints3
    gradient: Floats2
    sums: Doubles3
    gain_sums: Doubles3


def _row_floats(width: int) -> int:
    """Floats of a scratch row: padded to whole vectors, zeros on both ends."""
    return 2 * _PAD + -(-3 * width // 16) * 16


@routine(types.int64(*[types.int64] * 7), fastmath=_FASTMATH)
def _find_runs(arguments, band, first_row, last_row, dilation, lower, upper):
    """Runs of vectors to work on: tiles active anywhere in the rows, widened by `dilation` vectors, clipped.

    Fills runs [n, 2] (first, end) of the band and returns their number.
    """
    job = read(LossJob, arguments)
    active, runs, height = job.active, job.runs[band], len(job.image)
    first_row, last_row = max(first_row, 0), min(last_row, height - 1)
    n_runs = 0
    if first_row > last_row:
        return n_runs
    for column in range(active.shape[1]):
        is_active = False
        for row in range(first_row // TILE_PX, last_row // TILE_PX + 1):
            is_active |= active[row, column]
        first = max(column * _TILE_VECTORS - dilation, lower)
        end = min((column + 1) * _TILE_VECTORS + dilation, upper)
        if not is_active or first >= end:
            continue
        if n_runs > 0 and first <= runs[n_runs - 1, 1]:
            runs[n_runs - 1, 1] = end
        else:
            runs[n_runs, 0], runs[n_runs, 1] = first, end
            n_runs += 1
    return n_runs


@routine(ints(5), fastmath=_FASTMATH)
def _load_row(arguments, band, y, first, end):
    """Values first .. end of one row into the rings of a and b. Both limits lie between pixels."""
    job = read(LossJob, arguments)
    truth, truth_bytes, is_counted, active = job.truth, job.truth_bytes, job.is_counted, job.active
    rest, all_gains = job.rest, job.gains
    scratch = job.scratch[band]
    slot = y & (RING_ROWS - 1)
    a, b = scratch[_A + slot, _PAD + first : _PAD + end], scratch[_B + slot, _PAD + first : _PAD + end]
    # numba vectorises loops that start at zero: elsewhere it has to expect negative indices
    if truth_bytes.shape[1]:
        pixels = truth_bytes[y, first:end]
        for x in range(a.shape[0]):
            b[x] = np.float32(pixels[x]) * _BYTE
    else:
        values = truth[y, first:end]
        for x in range(a.shape[0]):
            b[x] = values[x]
    values, factors = job.image[y, first:end], job.gains[first:end]
    for x in range(a.shape[0]):
        a[x] = values[x] * factors[x]
    for column in range(first // _TILE_VALUES, (end - 1) // _TILE_VALUES + 1):
        if not active[y // TILE_PX, column]:
            for x in range(max(column * _TILE_VALUES, first) - first, min((column + 1) * _TILE_VALUES, end) - first):
                a[x] = rest[y, first + x] * all_gains[first + x] if rest.shape[1] else b[x]
    if is_counted.shape[1]:
        counted = is_counted[y, first // 3 : end // 3]
        for pixel in range(counted.shape[0]):
            if not counted[pixel]:
                for x in range(3 * pixel, 3 * pixel + 3):
                    a[x] = b[x]


@routine(ints(5), fastmath=_FASTMATH)
def _finish_row(arguments, band, y, first, end):
    """Gradient by a, in scratch, to that by the image and by the gains, values first .. end of one row."""
    job = read(LossJob, arguments)
    is_counted, scratch = job.is_counted, job.scratch[band]
    by_a = scratch[_GRADIENT + y % N_ROWS, _PAD + first : _PAD + end]
    if is_counted.shape[1]:
        counted = is_counted[y, first // 3 : end // 3]
        for pixel in range(counted.shape[0]):
            if not counted[pixel]:
                for x in range(3 * pixel, 3 * pixel + 3):
                    by_a[x] = _ZERO
    out, factors = job.gradient[y, first:end], job.gains[first:end]
    for x in range(by_a.shape[0]):
        out[x] = by_a[x] * factors[x]
    if job.has_gain:
        gain_total = scratch[_GAIN_SUM, first:end]
        values = job.image[y, first:end]
        for x in range(by_a.shape[0]):
            slope = by_a[x]  # a slope of zero takes nothing from the image, not even NaN
            gain_total[x] += slope * values[x] if slope != _ZERO else _ZERO


@routine(ints(5), fastmath=_FASTMATH)
def _moment_stage(scratch, row_bytes, y, first, end):
    """Stage 1 of one row: products, and blur along the row. `scratch` is the address of a band's."""
    base = scratch + _PAD * 4
    slot = y & (RING_ROWS - 1)
    a, b, target = base + (_A + slot) * row_bytes, base + (_B + slot) * row_bytes, base + (_MOMENTS + slot) * row_bytes
    for v in range(first, end):
        blur_moments(a + v * 64, b + v * 64, target + v * 64, RING_ROWS * row_bytes)


@routine(ints(7), fastmath=_FASTMATH)
def _ssim_stage(arguments, band, first_row, first, end, lower, upper):
    """Stage 2 of four rows: SSIM, its derivatives in temporary rows, and sums of 1 - SSIM."""
    job = read(LossJob, arguments)
    scratch, lane_sums = job.scratch[band], job.lane_sums[band]
    row_bytes = scratch.shape[1] * 4
    base = np.int64(scratch.ctypes.data) + _PAD * 4
    rings, terms, inside = base + _MOMENTS * row_bytes, base + _TERMS * row_bytes, base + _INSIDE * row_bytes
    sums = np.int64(lane_sums.ctypes.data) + 2 * N_ROWS * 64
    for v in range(first, end):
        to = sums if lower <= v < upper else sums + N_ROWS * 64
        ssim_rows(rings, row_bytes, first_row, v * 64, terms + v * 64, inside + v * 64, to)


@routine(ints(5), fastmath=_FASTMATH)
def _term_stage(scratch, row_bytes, first_row, first, end):
    """End of stage 2 of four rows: derivatives blurred along the row, into their rings."""
    base = scratch + _PAD * 4
    for index in range(3):
        for row in range(N_ROWS):
            source = base + (_TERMS + N_ROWS * index + row) * row_bytes
            slot = (first_row + row) & (RING_ROWS - 1)
            target = base + (_PARTIALS + RING_ROWS * index + slot) * row_bytes
            for v in range(first, end):
                blur_along(source + v * 64, target + v * 64)


@routine(ints(7), fastmath=_FASTMATH)
def _gradient_stage(scratch, row_bytes, first_row, first, end, sums, scales):
    """Stage 3 of four rows: gradient by a in temporary rows, and sums of |a - b| and (a - b)^2."""
    base = scratch + _PAD * 4
    partials, target = base + _PARTIALS * row_bytes, base + _GRADIENT * row_bytes
    for v in range(first, end):
        offset = v * 64
        gradient_rows(partials, base, row_bytes, first_row, offset, scales, target + offset, sums)


@routine(ints(5), fastmath=_FASTMATH)
def _clear_rows(scratch, row_bytes, ring, n_rings, y):
    """Zeros in the slot of row y of rings that follow each other: nothing lies outside the picture."""
    for index in range(n_rings):
        row = scratch + row_bytes * (ring + RING_ROWS * index + (y & (RING_ROWS - 1)))
        for v in range(row_bytes // 64):
            clear_lanes(row + 64 * v)


@routine(types.float64(types.int64, types.int64))
def _sum_lanes(vectors, index):
    """One of the sums, in float64."""
    total = 0.0
    for lane in range(16):
        total += load_float(vectors + 64 * index + 4 * lane)
    return total


@routine(ints(3), fastmath=_FASTMATH)
def _loss_strip(arguments, band, strip):
    """One strip of a band; see the module docstring."""
    job = read(LossJob, arguments)
    sums, gain_sums, runs, gradient = job.sums, job.gain_sums, job.runs[band], job.gradient
    scratch, lane_sums = job.scratch[band], job.lane_sums[band]
    first_row, end_row = job.band_rows[band], job.band_rows[band + 1]
    address, row_bytes = np.int64(scratch.ctypes.data), 4 * scratch.shape[1]
    sums_address, scales_address = np.int64(lane_sums.ctypes.data), np.int64(job.scales.ctypes.data)
    height, n_values = job.image.shape
    n_vectors = (scratch.shape[1] - 2 * _PAD) // 16
    lower = strip * _STRIP_TILES * _TILE_VECTORS
    upper = min(lower + _STRIP_TILES * _TILE_VECTORS, n_vectors)
    first_value, end_value = 16 * lower, min(16 * upper, n_values)
    for c in range(first_row - 5 * N_ROWS, end_row, N_ROWS):
        # stage 1, rows c + 10 .. c + 13: rows up to c + 25 of the picture may look at them
        for dilation in (3, 2):
            near, far = max(lower - dilation, 0), min(upper + dilation, n_vectors)
            n_runs = _find_runs(arguments, band, c, c + 25, dilation, near, far)
            for y in range(c + 2 * RADIUS, c + 2 * RADIUS + N_ROWS):
                if y < 0 or y >= height:
                    _clear_rows(address, row_bytes, _MOMENTS, 4, y)
                    continue
                for index in range(n_runs):
                    first, end = runs[index, 0], runs[index, 1]
                    if dilation == 3:
                        _load_row(arguments, band, y, 16 * first, min(16 * end, n_values))
                    else:
                        _moment_stage(address, row_bytes, y, first, end)
        if c < first_row - 3 * N_ROWS:
            continue
        # stage 2, rows c + 5 .. c + 8
        for index in range(16 * _N_SUMS):
            lane_sums[index] = _ZERO
        near, far = max(lower - 1, 0), min(upper + 1, n_vectors)
        n_runs = _find_runs(arguments, band, c, c + 13, 1, near, far)
        for index in range(n_runs):
            _ssim_stage(arguments, band, c + RADIUS, runs[index, 0], runs[index, 1], lower, upper)
        n_runs = _find_runs(arguments, band, c, c + 13, 0, lower, upper)
        for index in range(n_runs):
            _term_stage(address, row_bytes, c + RADIUS, runs[index, 0], runs[index, 1])
        for row in range(N_ROWS):
            y = c + RADIUS + row
            if y < 0 or y >= height:
                _clear_rows(address, row_bytes, _PARTIALS, 3, y)
            elif first_row <= y < end_row:
                sums[y, strip, 2] = _sum_lanes(sums_address, 2 * N_ROWS + row)
        if c < first_row:
            continue
        # stage 3, rows c .. c + 3
        n_runs = _find_runs(arguments, band, c, c + 3, 0, lower, upper)
        for index in range(n_runs):
            _gradient_stage(address, row_bytes, c, runs[index, 0], runs[index, 1], sums_address, scales_address)
        gain_total = scratch[_GAIN_SUM]
        if job.has_gain:
            for x in range(gain_total.shape[0]):
                gain_total[x] = _ZERO
        is_whole = n_runs == 1 and runs[0, 0] == lower and runs[0, 1] == upper
        for row in range(min(N_ROWS, height - c)):
            y = c + row
            if not is_whole:
                out = gradient[y, first_value:end_value]
                for x in range(out.shape[0]):
                    out[x] = _ZERO
            for index in range(n_runs):
                _finish_row(arguments, band, y, 16 * runs[index, 0], min(16 * runs[index, 1], n_values))
            sums[y, strip, 0] = _sum_lanes(sums_address, row)
            sums[y, strip, 1] = _sum_lanes(sums_address, N_ROWS + row)
        if job.has_gain:
            for pixel in range(first_value // 3, end_value // 3):
                for channel in range(3):
                    gain_sums[c // N_ROWS, strip, channel] += gain_total[3 * pixel + channel]


@kernel(LossJob)
def loss_band(worker, arguments):
    """One band, strip by strip, since strips share its scratch; see LossJob."""
    for strip in range(read(LossJob, arguments).sums.shape[1]):
        _loss_strip(arguments, worker, strip)


class LossWorkspace:
    """Scratch of one picture size, reused from step to step. Not to be shared between threads."""

    def __init__(self, height: int, width: int) -> None:
        self.height, self.width = height, width
        self.n_strips = -(-width // (TILE_PX * _STRIP_TILES))
        self._rows = np.zeros((0, _N_SCRATCH_ROWS, _row_floats(width)), np.float32)
        self._idle: list[np.ndarray] = []

    def gradient(self) -> Tensor:
        """An uninitialised picture; its memory is used again as soon as no tensor refers to it. [H, W, 3] float32"""
        buffer = self._idle.pop() if self._idle else np.empty((self.height, self.width, 3), np.float32)
        lent = buffer.view()
        weakref.finalize(lent, self._idle.append, buffer).atexit = False
        return torch.from_numpy(lent)

    def rows(self, n_bands: int) -> np.ndarray:
        """Scratch rows of every band, aligned to cache lines. [n_bands, rows, floats]"""
        if len(self._rows) < n_bands:
            self._rows = _aligned_zeros((n_bands, *self._rows.shape[1:]))
            self._rows[:, _INSIDE, _PAD : _PAD + 3 * self.width] = _ONE
        return self._rows[:n_bands]


@dataclass(frozen=True, slots=True)
class LossTerms:
    """The results of one pass: sums over all values of the picture, and gradients of the loss.

    Attributes:
        l1, square, dissimilarity: Sums of |a - b|, (a - b)^2 and 1 - SSIM.
        gradient: By the image. [H, W, 3] float32
        gain_gradient: By the gains; zero without gains. [3] float64
    """

    l1: float
    square: float
    dissimilarity: float
    gradient: Tensor
    gain_gradient: np.ndarray


def loss_terms(
    image: np.ndarray,
    truth: np.ndarray,
    *,
    ssim_weight: float,
    gain: np.ndarray | None,
    is_counted: np.ndarray | None,
    tile_mask: np.ndarray | None,
    rest: np.ndarray | None,
    workspace: LossWorkspace,
) -> LossTerms:
    """One pass over contiguous, writable pictures. Arguments as in `engine.training.step.losses.photometric_loss`.

    Args:
        image, rest: float32. [H, W, 3]
        truth: float32 or uint8. [H, W, 3]
    """
    height, width = image.shape[:2]
    n_values = 3 * height * width
    active = np.ones(n_tiles(width, height), bool) if tile_mask is None else tile_mask
    gains = np.ones(3, np.float32) if gain is None else gain
    bands = _bands(height, active)
    n_bands = len(bands) - 1
    gradient = workspace.gradient()
    sums = np.zeros((height, workspace.n_strips, 3))
    gain_sums = np.zeros((-(-height // N_ROWS), workspace.n_strips, 3))
    job = LossJob(
        image.reshape(height, -1),
        *_two_truths(truth),
        np.tile(gains, width),
        int(gain is not None),
        np.empty((height, 0), bool) if is_counted is None else is_counted,
        active,
        np.empty((1, 0), np.float32) if rest is None else rest.reshape(height, -1),
        np.array([(1 - ssim_weight) / n_values, -ssim_weight / n_values], np.float32),
        bands,
        workspace.rows(n_bands),
        _aligned_zeros((n_bands, 16 * _N_SUMS)),
        np.empty((n_bands, active.shape[1] + 1, 2), np.int64),
        gradient.view(height, -1),
        sums,
        gain_sums,
    )
    launch(loss_band, job, n_bands)
    l1, square, dissimilarity = (float(total) for total in sums.sum((0, 1)))
    return LossTerms(l1, square, dissimilarity, gradient, gain_sums.sum((0, 1)))


def _two_truths(truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The truth as float32 rows and as bytes, one of them empty: the kernel is compiled once for both."""
    rows = truth.reshape(len(truth), -1)
    if truth.dtype == np.uint8:
        return np.empty((1, 0), np.float32), rows
    return rows, np.empty((1, 0), np.uint8)


def _aligned_zeros(shape: tuple[int, ...]) -> np.ndarray:
    """float32 zeros whose first element lies on a cache line."""
    n_bytes = 4 * int(np.prod(shape))
    raw = np.zeros(n_bytes + 64, np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + n_bytes].view(np.float32).reshape(shape)


def _bands(height: int, active: np.ndarray) -> np.ndarray:
    """Rows at which bands start, and the end: one band a thread, shared out by active tiles. Multiples of four."""
    n_bands = max(1, min(get_num_threads(), height // _MIN_BAND_ROWS))
    n_blocks = -(-height // N_ROWS)
    if n_bands == 1 or not active.any():
        return np.array([0, height], np.int64)
    work = active.sum(1)[np.arange(n_blocks) * N_ROWS // TILE_PX].cumsum()
    inner = np.searchsorted(work, work[-1] * np.arange(1, n_bands) / n_bands) + 1
    rows = np.unique(np.concatenate([[0], np.minimum(inner, n_blocks) * N_ROWS, [height]]))
    return np.minimum(rows, height).astype(np.int64)
