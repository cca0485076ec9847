"""Squared differences of two pictures, summed tile by tile."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from engine.kernels.jobs import Bytes2, Doubles2, Floats1, Floats2, read
from engine.kernels.launch import kernel, launch
from engine.raster.pinhole_view import TILE_PX, n_tiles

_BYTE = np.float32(1 / 255)


class SquareJob(NamedTuple):
    """Arguments of `sum_squares`, one worker a row of tiles.

    Attributes:
        image: [H, 3 W]
        truth: [H, 3 W]
        gains: Multiplied onto a row of the image. [3 W]
        sums: Zeros, added to. [rows, columns]
    """

    image: Floats2
    truth: Bytes2
    gains: Floats1
    sums: Doubles2


@kernel(SquareJob, fastmath={"contract", "reassoc", "nsz"})
def sum_squares(worker, arguments):
    """See SquareJob."""
    job = read(SquareJob, arguments)
    image, truth, gains, sums = job.image, job.truth, job.gains, job.sums
    height, n_values = image.shape
    for y in range(worker * TILE_PX, min((worker + 1) * TILE_PX, height)):
        for column in range(sums.shape[1]):
            first, end = 3 * TILE_PX * column, min(3 * TILE_PX * (column + 1), n_values)
            values, factors, pixels = image[y, first:end], gains[first:end], truth[y, first:end]
            total = np.float32(0)
            for x in range(values.shape[0]):
                difference = values[x] * factors[x] - np.float32(pixels[x]) * _BYTE
                total += difference * difference
            sums[worker, column] += total


def tile_squares_cpu(image: Tensor, truth: Tensor, gain: Tensor) -> Tensor:
    """Sums of (image * gain - truth / 255)^2 over tiles of 32 px. [rows, columns] float64

    Args:
        image: [H, W, 3] float32
        truth: [H, W, 3] uint8
        gain: [3] float32
    """
    height, width = image.shape[:2]
    sums = np.zeros(n_tiles(width, height))
    first, second = (picture.detach().contiguous().reshape(height, -1) for picture in (image, truth))
    job = SquareJob(first, second, np.tile(gain.detach().numpy(), width), sums)
    launch(sum_squares, job, len(sums))
    return torch.from_numpy(sums)
