"""FLIP in lanes: colours to opponent space, filters of contrast, edges and points, and the difference of two pixels.

Vector code for `engine.metrics.pictures.flip`, sixteen pixels at a time. All arguments are byte addresses and counts.
Source: Andersson et al. 2020, with the constants and the separated filters of the authors' code, version 1.7.
Letters: Y, Cx, Cz opponent colours; L, a, b CIELAB after Hunt's adjustment; g a Gaussian, dg and ddg its derivatives.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from engine.kernels.lanes import FLOATS, INTS, N_LANES, LaneBuilder, Lanes, kernel_intrinsic

PIXELS_PER_DEGREE = 0.7 * (3840 / 0.7) * (math.pi / 180)
"""A screen 3840 px and 0.7 m wide, seen from 0.7 m: 67.02."""
COLOR_EXPONENT, COLOR_KNEE, COLOR_KNEE_ERROR = 0.7, 0.4, 0.95
"""Exponent of colour differences; share of the largest one up to which errors rise steeply; the error there."""
FEATURE_WIDTH_DEG = 0.082
"""Width of the edges and points that are looked for."""

RADIUS = 10
"""Pixels that the widest filter reaches."""
N_FILTERED, N_SEEN = 7, 5
"""Planes filtered along rows (Y, Cx, Cz twice; g, dg, ddg of Y), and planes that pictures are compared by."""

_TO_XYZ = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
"""Linear sRGB to CIE XYZ."""
_WHITE = _TO_XYZ.sum(1)
_TO_RELATIVE = _TO_XYZ / _WHITE[:, None]
"""Linear sRGB to XYZ relative to white."""
_TO_LINEAR = np.linalg.inv(_TO_RELATIVE)
_OPPONENT = np.array([[0.0, 116.0, 0.0], [500.0, -500.0, 0.0], [0.0, 200.0, -200.0]])
"""XYZ relative to white, or its cube roots, to Y + 16, Cx, Cz or L + 16, a, b."""
_CUBE_ROOT_FROM = (6 / 29) ** 3


def _contrast_taps(a: float, b: float) -> np.ndarray:
    """The Gaussian a sqrt(pi / b) exp(-pi^2 x^2 / b) of a contrast sensitivity, square root of its height. [21]"""
    x = np.arange(-RADIUS, RADIUS + 1) / PIXELS_PER_DEGREE
    return math.sqrt(a * math.sqrt(math.pi / b)) * np.exp(-(math.pi**2) * x**2 / b)


def _feature_taps() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """g with sum 1, dg and ddg whose positive and negative parts each have sum 1. Three times [19]"""
    sigma_px = 0.5 * FEATURE_WIDTH_DEG * PIXELS_PER_DEGREE
    radius = math.ceil(3 * sigma_px)
    x = np.arange(-radius, radius + 1)
    g = np.exp(-(x**2) / (2 * sigma_px**2))
    derivatives = []
    for taps in (-x * g, (x**2 / sigma_px**2 - 1) * g):
        derivatives.append(np.where(taps > 0, taps / taps[taps > 0].sum(), taps / -taps[taps < 0].sum()))
    return g / g.sum(), derivatives[0], derivatives[1]


def _trimmed(taps: np.ndarray) -> np.ndarray:
    """Without the ends that single precision cannot distinguish from 0."""
    n = int((np.abs(taps) < 1e-9 * np.abs(taps).max()).sum()) // 2
    return taps[n : len(taps) - n]


_Y_TAPS, _CX_TAPS = (_trimmed(taps / taps.sum()) for taps in (_contrast_taps(1, 0.0047), _contrast_taps(1, 0.0053)))
_CZ_TAPS = np.stack([_contrast_taps(34.1, 0.04), _contrast_taps(13.5, 0.025)])
_CZ_TAPS /= math.hypot(*_CZ_TAPS.sum(1))  # the sum over both of the products along x and y is 1
_G_TAPS, _DG_TAPS, _DDG_TAPS = _feature_taps()


def _largest_difference() -> float:
    """Colour difference of pure green and pure blue, which FLIP calls an error of 1."""
    lab = []
    for color in ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        relative = _TO_RELATIVE @ color
        roots = np.where(
            relative > _CUBE_ROOT_FROM, np.cbrt(relative), relative / (3 * _CUBE_ROOT_FROM ** (2 / 3)) + 4 / 29
        )
        lightness, a, b = _OPPONENT @ roots - [16, 0, 0]
        lab.append((lightness, 0.01 * lightness * a, 0.01 * lightness * b))
    (l0, a0, b0), (l1, a1, b1) = lab
    return (abs(l0 - l1) + math.hypot(a0 - a1, b0 - b1)) ** COLOR_EXPONENT


_LARGEST = _largest_difference()

# ---------------------------------------------------------------- arithmetic

_LOG2 = [2 / math.log(2) / n for n in (1, 3, 5, 7, 9)]
_EXP2 = [math.log(2) ** n / math.factorial(n) for n in range(8)]
_MANTISSA_FROM = int(np.float32(math.sqrt(0.5)).view(np.int32))


def _int_lanes(value: int) -> Any:
    return ir.Constant(INTS, [value] * N_LANES)


def _polynomial(x: Lanes, coefficients: list[float]) -> Lanes:
    """Lowest power first."""
    total = x.build.constant(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = total.times_plus(x, coefficient)
    return total


def _power(x: Lanes, exponent: Lanes | float) -> Lanes:
    """x to a power, x and the result in what float32 holds without subnormals; 0 counts as 2^-127. About 1e-6 exact."""
    build, builder = x.build, x.build.ir
    bits = builder.bitcast(x.value, INTS)
    power_of_two = builder.ashr(builder.sub(bits, _int_lanes(_MANTISSA_FROM)), _int_lanes(23))
    mantissa = Lanes(build, builder.bitcast(builder.sub(bits, builder.shl(power_of_two, _int_lanes(23))), FLOATS))
    ratio = (mantissa - 1.0) / (mantissa + 1.0)
    log2 = Lanes(build, builder.sitofp(power_of_two, FLOATS)) + ratio * _polynomial(ratio * ratio, _LOG2)
    wanted = (log2 * exponent).max(-126.0).min(127.0)
    whole = (wanted + 0.5).floor()
    scale = builder.shl(builder.add(whole.to_ints(), _int_lanes(127)), _int_lanes(23))
    return _polynomial(wanted - whole, _EXP2) * Lanes(build, builder.bitcast(scale, FLOATS))


def _matrix(matrix: np.ndarray, values: list[Lanes]) -> list[Lanes]:
    rows = []
    for row in matrix:
        total = values[0] * float(row[0])
        for value, weight in zip(values[1:], row[1:], strict=True):
            total = value.times_plus(float(weight), total)
        rows.append(total)
    return rows


def _weigh(build: LaneBuilder, center: Any, step_bytes: Any, filters: list[np.ndarray]) -> list[Lanes]:
    """Sixteen pixels under filters centred on them; neighbours lie `step_bytes` apart. Each pixel is loaded once."""
    radius = max(len(taps) for taps in filters) // 2
    totals: list[Lanes | None] = [None] * len(filters)
    for tap in range(-radius, radius + 1):
        value = build.load(center, build.ir.mul(step_bytes, build.int64(tap)), align=4)
        for index, taps in enumerate(filters):
            place = tap + len(taps) // 2
            if 0 <= place < len(taps):
                total, weight = totals[index], float(taps[place])
                totals[index] = value * weight if total is None else value.times_plus(weight, total)
    return [total for total in totals if total is not None]


# ---------------------------------------------------------------- stages


@kernel_intrinsic
def to_opponent(typing_context, red, green, blue):
    """Display-encoded sRGB of sixteen pixels to Y + 16, Cx and Cz, in place."""
    signature = types.void(*[types.int64] * 3)

    def generate(context, builder, signature, arguments):
        build = LaneBuilder(builder)
        linear = []
        for address in arguments:
            value = build.load(address)
            curve = _power((value + 0.055) * (1 / 1.055), 2.4)
            linear.append(curve.where(value.compare(">", 0.04045), value * (1 / 12.92)))
        for address, value in zip(arguments, _matrix(_OPPONENT @ _TO_RELATIVE, linear), strict=True):
            build.store(value, address)

    return signature, generate


@kernel_intrinsic
def filter_along(typing_context, y, cx, cz, target, plane_bytes):
    """Filter sixteen pixels of three rows along them, into N_FILTERED planes. Reads RADIUS pixels on both sides."""
    signature = types.void(*[types.int64] * 5)

    def generate(context, builder, signature, arguments):
        y, cx, cz, target, plane_bytes = arguments
        build = LaneBuilder(builder)
        step = build.int64(4)
        of_y = _weigh(build, y, step, [_Y_TAPS, _G_TAPS, _DG_TAPS, _DDG_TAPS])
        of_cx, of_cz = _weigh(build, cx, step, [_CX_TAPS]), _weigh(build, cz, step, list(_CZ_TAPS))
        for index, value in enumerate((of_y[0], *of_cx, *of_cz, *of_y[1:])):
            build.store(value, build.address(target, builder.mul(plane_bytes, build.int64(index))))

    return signature, generate


@kernel_intrinsic
def filter_down(typing_context, source, plane_bytes, row_bytes, target, target_plane_bytes):
    """Filter sixteen pixels of the planes of `filter_along` down columns, into N_SEEN planes: L, a, b, edge, point."""
    signature = types.void(*[types.int64] * 5)

    def generate(context, builder, signature, arguments):
        source, plane_bytes, row_bytes, target, target_plane_bytes = arguments
        build = LaneBuilder(builder)

        def under(plane: int, *filters: np.ndarray) -> list[Lanes]:
            center = build.address(source, builder.mul(plane_bytes, build.int64(plane)))
            return _weigh(build, center, row_bytes, list(filters))

        y, cx = under(0, _Y_TAPS)[0], under(1, _CX_TAPS)[0]
        cz = under(2, _CZ_TAPS[0])[0] + under(3, _CZ_TAPS[1])[0]
        linear = _matrix(_TO_LINEAR @ np.linalg.inv(_OPPONENT), [y, cx, cz])
        relative = _matrix(_TO_RELATIVE, [value.max(0.0).min(1.0) for value in linear])
        roots = []
        for value in relative:
            low = value.times_plus(1 / (3 * _CUBE_ROOT_FROM ** (2 / 3)), 4 / 29)
            roots.append(_power(value, 1 / 3).where(value.compare(">", _CUBE_ROOT_FROM), low))
        lightness, a, b = _matrix(_OPPONENT, roots)
        lightness = lightness - 16.0
        hunt = lightness * 0.01
        down_y, down_yy = under(4, _DG_TAPS, _DDG_TAPS)
        along_x, along_xx = under(5, _G_TAPS)[0], under(6, _G_TAPS)[0]
        edge = along_x.times_plus(along_x, down_y * down_y).sqrt() * (1 / 116)
        point = along_xx.times_plus(along_xx, down_yy * down_yy).sqrt() * (1 / 116)
        for index, value in enumerate((lightness, hunt * a, hunt * b, edge, point)):
            place = build.address(target, builder.mul(target_plane_bytes, build.int64(index)))
            build.store(value, place)

    return signature, generate


@kernel_intrinsic
def difference(typing_context, first, second, plane_bytes, target):
    """FLIP of sixteen pixels of two pictures as `filter_down` leaves them."""
    signature = types.void(*[types.int64] * 4)

    def generate(context, builder, signature, arguments):
        first, second, plane_bytes, target = arguments
        build = LaneBuilder(builder)
        apart = []
        for plane in range(N_SEEN):
            offset = builder.mul(plane_bytes, build.int64(plane))
            apart.append(build.load(first, offset) - build.load(second, offset))
        lightness, a, b, edge, point = apart
        distance = lightness.abs() + a.times_plus(a, b * b).sqrt()
        color = _power(distance, COLOR_EXPONENT)
        knee = COLOR_KNEE * _LARGEST
        steep, flat = COLOR_KNEE_ERROR / knee, (1 - COLOR_KNEE_ERROR) / (_LARGEST - knee)
        color = (color * steep).where(color.compare("<", knee), (color - knee).times_plus(flat, COLOR_KNEE_ERROR))
        feature = (edge.abs().max(point.abs()) * math.sqrt(0.5)).sqrt()
        error = _power(color, 1.0 - feature)
        build.store(error.where(distance.compare(">", 0.0)), target)

    return signature, generate
