"""SSIM in lanes: the 11 x 11 Gaussian window along rows and columns, the formula, and its derivatives.

Vector code for `engine.backends.cpu.step.fused_loss`, sixteen values of interleaved RGB rows at a time, so that a
neighbouring pixel lies 3 values away. Four rows are blurred down together: 14 loads serve 44 multiplications.
A ring is a block of 16 rows; row y of the picture lies in slot y mod 16. All arguments are byte addresses and counts.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from engine.kernels.lanes import VECTOR_BYTES, LaneBuilder, Lanes, kernel_intrinsic

RADIUS = 5
_samples = np.exp(-((np.arange(2 * RADIUS + 1) - RADIUS) ** 2) / (2 * 1.5**2))
WINDOW: np.ndarray = _samples / _samples.sum()
"""The 11 taps of the window along one axis, sigma 1.5, sum 1. float64"""
C1, C2 = 0.01**2, 0.03**2
N_ROWS = 4
"""Rows that are handled together."""
RING_ROWS = 16
"""Rows of a ring: the 14 that four blurred rows look at, rounded up to a power of two."""
_PIXEL_BYTES = 12


def _tap(build: LaneBuilder, value: Any, tap: int, total: Lanes | None) -> Lanes:
    weight = build.constant(WINDOW[tap])
    return value * weight if total is None else value.times_plus(weight, total)


def _window_of(build: LaneBuilder, row: Any) -> list[Lanes]:
    """The 11 neighbours of sixteen values along their row."""
    taps = range(2 * RADIUS + 1)
    return [build.load(row, (t - RADIUS) * _PIXEL_BYTES, align=VECTOR_BYTES if t == RADIUS else 4) for t in taps]


@kernel_intrinsic
def blur_moments(typing_context, image, truth, target, ring_bytes):
    """Blur a, b, a^2 + b^2 and a b of sixteen values along their row, into four rings. Reads 15 values on both sides.

    Products are made of the loaded windows: 22 loads serve all four.
    """
    signature = types.void(*[types.int64] * 4)

    def generate(context, builder, signature, arguments):
        image, truth, target, ring_bytes = arguments
        build = LaneBuilder(builder)
        sums = [build.constant(0.0)] * 5
        for weight, a, b in zip(WINDOW, _window_of(build, image), _window_of(build, truth), strict=True):
            weighted_a, weighted_b = a * weight, b * weight
            sums = [
                sums[0] + weighted_a,
                sums[1] + weighted_b,
                weighted_a.times_plus(a, sums[2]),
                weighted_b.times_plus(b, sums[3]),
                weighted_a.times_plus(b, sums[4]),
            ]
        for index, value in enumerate((sums[0], sums[1], sums[2] + sums[3], sums[4])):
            build.store(value, builder.add(target, builder.mul(ring_bytes, build.int64(index))))

    return signature, generate


@kernel_intrinsic
def blur_along(typing_context, source, target):
    """Blur sixteen values along their row. Reads 15 values on both sides."""
    signature = types.void(types.int64, types.int64)

    def generate(context, builder, signature, arguments):
        source, target = arguments
        build = LaneBuilder(builder)
        halves: list[Lanes | None] = [None, None]  # two sums, so that one does not wait for the other
        for tap, value in enumerate(_window_of(build, source)):
            halves[tap % 2] = _tap(build, value, tap, halves[tap % 2])
        even, odd = halves
        assert even is not None
        assert odd is not None
        build.store(even + odd, target)

    return signature, generate


def _slot_offset(build: LaneBuilder, row: Any, row_bytes: Any, offset: Any) -> Any:
    builder = build.ir
    slot = builder.and_(row, build.int64(RING_ROWS - 1))
    return builder.add(builder.mul(slot, row_bytes), offset)


def _blur_down(build: LaneBuilder, ring: Any, row_bytes: Any, first_row: Any, offset: Any) -> list[Lanes]:
    """Rows first_row .. first_row + 3, blurred along columns."""
    totals: list[Lanes | None] = [None] * N_ROWS
    for step in range(N_ROWS + 2 * RADIUS):
        row = build.ir.add(first_row, build.int64(step - RADIUS))
        value = build.load(ring, _slot_offset(build, row, row_bytes, offset))
        for out in range(max(0, step - 2 * RADIUS), min(N_ROWS, step + 1)):
            totals[out] = _tap(build, value, step - out, totals[out])
    return [total for total in totals if total is not None]


def _add_to(build: LaneBuilder, address: Any, index: int, value: Lanes) -> None:
    build.store(build.load(address, index * VECTOR_BYTES) + value, address, index * VECTOR_BYTES)


def _dissimilarity(mean_a: Lanes, mean_b: Lanes, squares: Lanes, product: Lanes) -> tuple[Lanes, Lanes, Lanes, Lanes]:
    """1 - SSIM of blurred a, b, a^2 + b^2 and a b; derivatives of SSIM by a, a^2 + b^2 and a b."""
    mean_product = mean_a * mean_b
    mean_squares = mean_a.times_plus(mean_a, mean_b * mean_b)
    numerator1 = mean_product.times_plus(2.0, C1)
    numerator2 = (product - mean_product).times_plus(2.0, C2)
    denominator1 = mean_squares + C1
    denominator2 = squares - mean_squares + C2
    denominator = denominator1 * denominator2
    inverse = denominator.build.constant(1.0) / denominator
    numerator = numerator1 * numerator2
    ssim = numerator * inverse
    d_square = -(ssim * denominator1 * inverse)
    d_product = 2.0 * (numerator1 * inverse)
    d_mean = 2.0 * inverse * (mean_b * (numerator2 - numerator1) - mean_a * ssim * (denominator2 - denominator1))
    return (denominator - numerator) * inverse, d_mean, d_square, d_product


def _store_terms(build: LaneBuilder, terms: tuple[Lanes, ...], row: int, to: tuple[Any, Any, Any], sums: Any) -> None:
    """Partials of one row to their three temporary rows, 1 - SSIM onto the row's sum; zero outside the picture."""
    partials, row_bytes, inside = to
    builder = build.ir
    _add_to(build, sums, row, terms[0] * inside)
    for index, term in enumerate(terms[1:]):
        offset = builder.mul(row_bytes, build.int64(N_ROWS * index + row))
        build.store(term * inside, builder.add(partials, offset))


@kernel_intrinsic
def ssim_rows(typing_context, rings, row_bytes, first_row, offset, partials, inside, sums):
    """SSIM of four rows, sixteen values each.

    `rings` addresses the rings of a, b, a^2 + b^2 and a b, blurred along rows; `offset` is that of the values inside a
    row; `partials` receives 3 x 4 rows of derivatives; `inside` is 1 inside the picture; `sums` [4] vectors
    get 1 - SSIM.
    """
    signature = types.void(*[types.int64] * 7)

    def generate(context, builder, signature, arguments):
        rings, row_bytes, first_row, offset, partials, inside, sums = arguments
        build = LaneBuilder(builder)
        ring_bytes = builder.mul(row_bytes, build.int64(RING_ROWS))
        blurred = []
        for index in range(4):
            ring = builder.add(rings, builder.mul(ring_bytes, build.int64(index)))
            blurred.append(_blur_down(build, ring, row_bytes, first_row, offset))
        to = (partials, row_bytes, build.load(inside))
        for row, values in enumerate(zip(*blurred, strict=True)):
            _store_terms(build, _dissimilarity(*values), row, to, sums)

    return signature, generate


@kernel_intrinsic
def gradient_rows(typing_context, partial_rings, image_ring, row_bytes, first_row, offset, scales, target, sums):
    """Gradient of the loss by a for four rows, sixteen values each.

    `partial_rings` addresses the rings of the three derivatives, `image_ring` that of a and, behind it, of b; `scales`
    [2] float32 are the weights of |a - b| and of SSIM; `sums` [8] vectors get |a - b| and then (a - b)^2 of each row.
    """
    signature = types.void(*[types.int64] * 8)

    def generate(context, builder, signature, arguments):
        partial_rings, image_ring, row_bytes, first_row, offset, scales, target, sums = arguments
        build = LaneBuilder(builder)
        ring_bytes = builder.mul(row_bytes, build.int64(RING_ROWS))
        by_mean, by_square, by_product = (
            _blur_down(
                build, builder.add(partial_rings, builder.mul(ring_bytes, build.int64(i))), row_bytes, first_row, offset
            )
            for i in range(3)
        )
        l1_scale = build.broadcast(build.load_scalar(scales))
        ssim_scale = build.broadcast(build.load_scalar(scales, 4))
        truth_ring = builder.add(image_ring, ring_bytes)
        for row in range(N_ROWS):
            slot = _slot_offset(build, builder.add(first_row, build.int64(row)), row_bytes, offset)
            a, b = build.load(image_ring, slot), build.load(truth_ring, slot)
            difference = a - b
            sign = l1_scale.where(difference.compare(">", 0.0), (-l1_scale).where(difference.compare("<", 0.0)))
            by_a = (2.0 * a).times_plus(by_square[row], b.times_plus(by_product[row], by_mean[row]))
            build.store(
                by_a.times_plus(ssim_scale, sign), builder.add(target, builder.mul(row_bytes, build.int64(row)))
            )
            _add_to(build, sums, row, difference.abs())
            _add_to(build, sums, N_ROWS + row, difference * difference)

    return signature, generate


@kernel_intrinsic
def clear_lanes(typing_context, target):
    """Zeros in sixteen values."""
    signature = types.void(types.int64)

    def generate(context, builder, signature, arguments):
        build = LaneBuilder(builder)
        build.store(build.constant(0.0), arguments[0])

    return signature, generate
