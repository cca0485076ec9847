"""SSIM of every value of two pictures: the 11 x 11 Gaussian window and the formula, as one kernel over bands of rows.

Pictures are rows of interleaved RGB, so that a horizontal neighbour lies 3 values away. Nothing is summed over rows and
every row is computed alike: the same numbers for any number of threads. The blur along rows is the training loss's.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import get_num_threads, types

from engine.images.ssim_lanes import RADIUS, WINDOW, blur_moments
from engine.kernels.jobs import Floats2, Floats3, Workers, read
from engine.kernels.lanes import LaneBuilder, Lanes, kernel_intrinsic
from engine.kernels.launch import kernel, launch
from engine.kernels.memory import RecycledMemory
from engine.kernels.workspace import WorkspacePool

K1, K2 = 0.01, 0.03
"""Constants of SSIM, as shares of the data range: C1 = (K1 L)^2, C2 = (K2 L)^2."""
N_MAPS = 3
"""SSIM and its contrast-structure factor with data range 1, SSIM with data range 2."""
_N_MOMENTS = 4
_MARGIN = 16
"""Zeros on both ends of a row; the window reaches 15 values."""
_POOL, _MEMORY = WorkspacePool(), RecycledMemory()


class SimilarityJob(NamedTuple):
    """Arguments of `blur_rows` and `compare_rows`.

    Attributes:
        a, b: The pictures. [H, 3 W]
        padded: Scratch, two rows a worker, zeros before. [2 workers, padded 3 W + 32]
        moments: a, b, a^2 + b^2, a b blurred along rows; RADIUS rows of zeros at both ends. [4, H + 10, padded 3 W]
        maps: Written. [3, H, padded 3 W]
    """

    a: Floats2
    b: Floats2
    padded: Floats2
    moments: Floats3
    maps: Floats3
    n_workers: Workers = None


def similarity_maps(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """SSIM maps of two pictures in 0..1 with zeros beyond their edge. [N_MAPS, H, 3 W] float32

    Args:
        image, truth: [H, W, 3] float32
    """
    height, width, _ = image.shape
    a, b = (np.ascontiguousarray(picture).reshape(height, 3 * width) for picture in (image, truth))
    row = -(-3 * width // 16) * 16
    n_workers = max(1, min(get_num_threads(), height))
    maps = _MEMORY.empty(N_MAPS, height, row)
    workspace = _POOL.take()
    padded = workspace.array("padded", (2 * n_workers, row + 2 * _MARGIN), np.float32)
    moments = workspace.array("moments", (_N_MOMENTS, height + 2 * RADIUS, row), np.float32)
    padded[:], moments[:, :RADIUS], moments[:, -RADIUS:] = 0.0, 0.0, 0.0
    job = SimilarityJob(a, b, padded, moments, maps)
    launch(blur_rows, job, n_workers)
    launch(compare_rows, job, n_workers)
    _POOL.give_back(workspace)
    return maps.numpy()[..., : 3 * width]


def warm_up() -> None:
    """Compile both kernels, or load them from the cache, by comparing pictures of one pixel."""
    similarity_maps(np.zeros((1, 1, 3), np.float32), np.zeros((1, 1, 3), np.float32))


def _blur_down(build: LaneBuilder, center: Any, row_bytes: Any) -> Lanes:
    """Sixteen values under the window along their columns."""
    total: Lanes | None = None
    for tap, weight in enumerate(WINDOW):
        value = build.load(center, build.ir.mul(row_bytes, build.int64(tap - RADIUS)))
        total = value * float(weight) if total is None else value.times_plus(float(weight), total)
    assert total is not None
    return total


@kernel_intrinsic
def _similarity(typing_context, moments, plane_bytes, row_bytes, target, target_plane_bytes):
    """The N_MAPS of sixteen values."""
    signature = types.void(*[types.int64] * 5)

    def generate(context, builder, signature, arguments):
        moments, plane_bytes, row_bytes, target, target_plane_bytes = arguments
        build = LaneBuilder(builder)
        mean_a, mean_b, squares, product = (
            _blur_down(build, build.address(moments, builder.mul(plane_bytes, build.int64(i))), row_bytes)
            for i in range(_N_MOMENTS)
        )
        mean_product = mean_a * mean_b
        mean_squares = mean_a.times_plus(mean_a, mean_b * mean_b)
        covariance, variances = (product - mean_product) * 2.0, squares - mean_squares
        maps = []
        for data_range in (1.0, 2.0):
            c1, c2 = ((k * data_range) ** 2 for k in (K1, K2))
            structure = (covariance + c2) / (variances + c2)
            maps += [structure * (mean_product.times_plus(2.0, c1) / (mean_squares + c1)), structure]
        for index, value in enumerate(maps[:N_MAPS]):
            build.store(value, build.address(target, builder.mul(target_plane_bytes, build.int64(index))))

    return signature, generate


@kernel(SimilarityJob)
def blur_rows(worker, arguments):
    """See SimilarityJob."""
    job = read(SimilarityJob, arguments)
    a, b, padded, moments = job.a, job.b, job.padded, job.moments
    height, width3 = a.shape
    plane_bytes = 4 * moments.shape[1] * moments.shape[2]
    row_a, row_b = padded[2 * worker], padded[2 * worker + 1]
    from_a, from_b = row_a.ctypes.data + 4 * _MARGIN, row_b.ctypes.data + 4 * _MARGIN
    for y in range(height * worker // job.n_workers, height * (worker + 1) // job.n_workers):
        for x in range(width3):
            row_a[_MARGIN + x] = a[y, x]
            row_b[_MARGIN + x] = b[y, x]
        target = moments[0, y + RADIUS].ctypes.data
        for x in range(0, moments.shape[2], 16):
            blur_moments(from_a + 4 * x, from_b + 4 * x, target + 4 * x, plane_bytes)


@kernel(SimilarityJob)
def compare_rows(worker, arguments):
    """See SimilarityJob."""
    job = read(SimilarityJob, arguments)
    moments, maps = job.moments, job.maps
    height, row = maps.shape[1], maps.shape[2]
    for y in range(height * worker // job.n_workers, height * (worker + 1) // job.n_workers):
        source, target = moments[0, y + RADIUS].ctypes.data, maps[0, y].ctypes.data
        for x in range(0, row, 16):
            _similarity(source + 4 * x, 4 * moments.shape[1] * row, 4 * row, target + 4 * x, 4 * height * row)
