"""Pixels of images to the planes of a scratch row and back: one 4x4 block, which is one vector a plane, at a time.

Blocks may be cut by the right and lower border of the image, or lie outside: lanes without a pixel are masked.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types

from engine.backends.cpu.raster import record as rec
from engine.backends.cpu.raster import tile as tl
from engine.kernels.lanes import INT32, INTS, N_LANES, LaneBuilder, Lanes, kernel_intrinsic

_CHANNELS = 3
_PLANES = (tl.PLANE_R, tl.PLANE_G, tl.PLANE_B)


class _Block:
    """Where the pixels of a block are. x, y: its first pixel; all arguments are int64."""

    def __init__(self, build: LaneBuilder, x: Any, y: Any, width: Any, height: Any) -> None:
        builder = build.ir
        self._build = build
        self._width = width
        self._first = builder.add(builder.mul(y, width), x)
        left = builder.sub(width, x)
        block = build.int64(rec.BLOCK)
        self._n_columns = builder.select(builder.icmp_signed("<", left, block), left, block)
        self._n_rows = builder.sub(height, y)

    def inside(self) -> Any:
        """Mask of the lanes that have a pixel."""
        columns = self._below([lane % rec.BLOCK for lane in range(N_LANES)], self._n_columns)
        rows = self._below([lane // rec.BLOCK for lane in range(N_LANES)], self._n_rows)
        return self._build.all_of([columns, rows])

    def load(self, image: Any, n_channels: int) -> list[Lanes]:
        """The block of the image at an address as one vector a channel; 0 in lanes without a pixel."""
        build = self._build
        rows = [build.load_masked(address, mask).value for address, mask in self._rows(image, n_channels)]
        planes = []
        for channel in range(n_channels):
            places = [n_channels * x + channel for x in range(rec.BLOCK)]
            places += [N_LANES + place for place in places]
            upper, lower = (_shuffled(build, rows[first], rows[first + 1], places) for first in (0, 2))
            planes.append(Lanes(build, _shuffled(build, upper, lower, [*range(8), *range(N_LANES, N_LANES + 8)])))
        return planes

    def store(self, planes: list[Lanes], image: Any) -> None:
        """Vectors, one a channel, to the block of the image at an address."""
        build, n_channels = self._build, len(planes)
        first = planes[0].value
        for row, (address, mask) in enumerate(self._rows(image, n_channels)):
            lanes = [rec.BLOCK * row + place // n_channels for place in range(rec.BLOCK * n_channels)]
            values = _shuffled(build, first, first, lanes)
            for channel in range(1, n_channels):
                places = [
                    N_LANES + lane if place % n_channels == channel else place for place, lane in enumerate(lanes)
                ]
                values = _shuffled(build, values, planes[channel].value, places)
            build.store_masked(Lanes(build, values), address, mask)

    def _rows(self, image: Any, n_channels: int) -> list[tuple[Any, Any]]:
        """Address of each row of pixels, and mask of the floats that belong to it."""
        build, builder = self._build, self._build.ir
        n_floats = builder.mul(self._n_columns, build.int64(n_channels))
        stride = builder.mul(self._width, build.int64(4 * n_channels))
        address = builder.add(image, builder.mul(self._first, build.int64(4 * n_channels)))
        rows = []
        for row in range(rec.BLOCK):
            is_inside = builder.icmp_signed(">", self._n_rows, build.int64(row))
            limit = builder.select(is_inside, n_floats, build.int64(0))
            rows.append((address, self._below(list(range(N_LANES)), limit)))
            address = builder.add(address, stride)
        return rows

    def _below(self, numbers: list[int], limit: Any) -> Any:
        """Mask of the lanes whose number is below a limit."""
        builder = self._build.ir
        undefined = ir.Constant(INTS, ir.Undefined)
        narrow = builder.insert_element(undefined, builder.trunc(limit, INT32), ir.Constant(INT32, 0))
        limits = builder.shuffle_vector(narrow, undefined, ir.Constant(INTS, [0] * N_LANES))
        return builder.icmp_signed("<", ir.Constant(INTS, numbers), limits)


def _shuffled(build: LaneBuilder, first: Any, second: Any, lanes: list[int]) -> Any:
    """Chosen lanes of two vectors, 16 and up from the second one; lanes past the end of the list mean nothing."""
    places = ir.Constant(INTS, lanes + [0] * (N_LANES - len(lanes)))
    return build.ir.shuffle_vector(first, second, places)


@kernel_intrinsic
def open_block(typing_context, planes, x, y, width, height):
    """A block before anything is blended: no colour, and all light let through where there is a pixel."""
    signature = types.void(*[types.int64] * 5)

    def generate(context, builder, signature, arguments):
        planes, *place = arguments
        build = LaneBuilder(builder)
        build.store(build.constant(1.0).where(_Block(build, *place).inside()), planes, tl.TRANSMITTANCE)
        for plane in _PLANES:
            build.store(build.constant(0.0), planes, plane)

    return signature, generate


@kernel_intrinsic
def write_block(typing_context, planes, x, y, width, height, background, image, transmittance, alpha):
    """A finished block, from the scratch row at `planes`, to the three images."""
    signature = types.void(*[types.int64] * 9)

    def generate(context, builder, signature, arguments):
        planes, x, y, width, height, background, image, transmittance, alpha = arguments
        build = LaneBuilder(builder)
        block = _Block(build, x, y, width, height)
        left_over = build.load(planes, tl.TRANSMITTANCE)
        colors = [
            left_over.times_plus(build.broadcast(build.load_scalar(background, 4 * channel)), build.load(planes, plane))
            for channel, plane in enumerate(_PLANES)
        ]
        block.store(colors, image)
        block.store([left_over], transmittance)
        block.store([1.0 - left_over], alpha)

    return signature, generate


@kernel_intrinsic
def read_block(typing_context, planes, x, y, width, height, image, grad_image):
    """A block before its replay, to the scratch row at `planes`. The remainder is that of the colours alone."""
    signature = types.void(*[types.int64] * 7)

    def generate(context, builder, signature, arguments):
        planes, x, y, width, height, image, grad_image = arguments
        build = LaneBuilder(builder)
        block = _Block(build, x, y, width, height)
        colors, gradients = block.load(image, _CHANNELS), block.load(grad_image, _CHANNELS)
        for plane, gradient in zip(_PLANES, gradients, strict=True):
            build.store(gradient, planes, plane)
        remainder = gradients[0] * colors[0] + gradients[1] * colors[1] + gradients[2] * colors[2]
        build.store(remainder, planes, tl.REMAINDER)
        build.store(build.constant(1.0).where(block.inside()), planes, tl.TRANSMITTANCE)

    return signature, generate


@kernel_intrinsic
def subtract_alpha(typing_context, planes, x, y, width, height, transmittance, grad_alpha):
    """Take the part of alpha from the remainder of a block that `read_block` has read."""
    signature = types.void(*[types.int64] * 7)

    def generate(context, builder, signature, arguments):
        planes, x, y, width, height, transmittance, grad_alpha = arguments
        build = LaneBuilder(builder)
        block = _Block(build, x, y, width, height)
        (left_over,), (gradient,) = block.load(transmittance, 1), block.load(grad_alpha, 1)
        build.store(build.load(planes, tl.REMAINDER) - gradient * left_over, planes, tl.REMAINDER)

    return signature, generate
