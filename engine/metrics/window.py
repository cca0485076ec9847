"""The 11 x 11 Gaussian window of SSIM over pictures, and the formula, as two kernels over rows on all threads.

Pictures are rows of interleaved RGB, so that a horizontal neighbour lies 3 values away. Every row is written by one
worker and nothing is summed over rows: the same numbers for any number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import get_num_threads

from engine.kernels.arrays import Floats1, Floats2, Floats3, job_reader, pack
from engine.kernels.lanes import kernel_intrinsic
from engine.kernels.routines import WORKER, routine, run

RADIUS = 5
_TAPS = np.exp(-((np.arange(2 * RADIUS + 1) - RADIUS) ** 2) / (2 * 1.5**2))
WINDOW = (_TAPS / _TAPS.sum()).astype(np.float32)
_MARGIN = 3 * RADIUS
_FASTMATH = {"contract"}


class BlurJob(NamedTuple):
    """Arguments of `blur_rows`.

    Attributes:
        a, b: The pictures. [H, 3 W]
        taps: The window. [11]
        padded: Scratch, five rows a worker, zeros before. [5 workers, 3 W + 30]
        rows: Written: a, b, a^2, b^2, ab blurred along x, from row 5 on. [5, H + 10, 3 W]
        n_workers: How many workers share the rows.
    """

    a: Floats2
    b: Floats2
    taps: Floats1
    padded: Floats2
    rows: Floats3
    n_workers: int


class SimilarityJob(NamedTuple):
    """Arguments of `compare_rows`.

    Attributes:
        rows: Of `blur_rows`. [5, H + 10, 3 W]
        taps: The window. [11]
        means: Scratch, five rows a worker. [5 workers, 3 W]
        c1, c2: Constants of SSIM.
        ssim, structure: Written. [H, 3 W]
        n_workers: How many workers share the rows.
    """

    rows: Floats3
    taps: Floats1
    means: Floats2
    c1: float
    c2: float
    ssim: Floats2
    structure: Floats2
    n_workers: int


def blur_along_rows(a: np.ndarray, b: np.ndarray, rows: np.ndarray) -> None:
    """Blur two pictures, their squares and their product along x. See `BlurJob`; all float32, zeros beyond the edge."""
    height, width3 = a.shape
    n_workers = max(1, min(get_num_threads(), height))
    padded = np.zeros((5 * n_workers, width3 + 2 * _MARGIN), np.float32)
    run(blur_rows, pack(BlurJob(a, b, WINDOW, padded, rows, n_workers)), n_workers)


def similarity_of_rows(rows: np.ndarray, c1: float, c2: float, ssim: np.ndarray, structure: np.ndarray) -> None:
    """Blur along y, and write SSIM and its contrast-structure factor of each value. See `SimilarityJob`."""
    height, width3 = ssim.shape
    n_workers = max(1, min(get_num_threads(), height))
    means = np.empty((5 * n_workers, width3), np.float32)
    run(compare_rows, pack(SimilarityJob(rows, WINDOW, means, c1, c2, ssim, structure, n_workers)), n_workers)


def warm_up() -> None:
    """Compile both kernels, or load them from the cache, by comparing pictures of one pixel."""
    pixel, rows = np.zeros((1, 3), np.float32), np.zeros((5, 1 + 2 * RADIUS, 3), np.float32)
    blur_along_rows(pixel, pixel, rows)
    similarity_of_rows(rows, 1.0, 1.0, pixel.copy(), pixel.copy())


@kernel_intrinsic
def _read_blur_job(typing_context, address):
    """The BlurJob at an address."""
    return job_reader(BlurJob)


@kernel_intrinsic
def _read_similarity_job(typing_context, address):
    """The SimilarityJob at an address."""
    return job_reader(SimilarityJob)


@routine(WORKER, fastmath=_FASTMATH)
def blur_rows(worker, arguments):
    """See BlurJob."""
    job = _read_blur_job(arguments)
    a, b, taps, padded, rows = job.a, job.b, job.taps, job.padded, job.rows
    height, width3 = a.shape
    first = 5 * worker
    for y in range(height * worker // job.n_workers, height * (worker + 1) // job.n_workers):
        for x in range(width3):
            va, vb = a[y, x], b[y, x]
            padded[first, x + 15] = va
            padded[first + 1, x + 15] = vb
            padded[first + 2, x + 15] = va * va
            padded[first + 3, x + 15] = vb * vb
            padded[first + 4, x + 15] = va * vb
        for m in range(5):
            for x in range(width3):
                rows[m, y + 5, x] = taps[5] * padded[first + m, x + 15]
            for j in range(5):
                weight = taps[j]
                for x in range(width3):
                    both = padded[first + m, x + 3 * j] + padded[first + m, x + 30 - 3 * j]
                    rows[m, y + 5, x] += weight * both


@routine(WORKER, fastmath=_FASTMATH)
def compare_rows(worker, arguments):
    """See SimilarityJob."""
    job = _read_similarity_job(arguments)
    rows, taps, means, ssim, structure = job.rows, job.taps, job.means, job.ssim, job.structure
    c1, c2, two = np.float32(job.c1), np.float32(job.c2), np.float32(2)
    height, width3 = ssim.shape
    first = 5 * worker
    for y in range(height * worker // job.n_workers, height * (worker + 1) // job.n_workers):
        for m in range(5):
            for x in range(width3):
                means[first + m, x] = taps[5] * rows[m, y + 5, x]
            for j in range(5):
                weight = taps[j]
                for x in range(width3):
                    means[first + m, x] += weight * (rows[m, y + j, x] + rows[m, y + 10 - j, x])
        for x in range(width3):
            mu_a, mu_b = means[first, x], means[first + 1, x]
            product = mu_a * mu_b
            squares = mu_a * mu_a + mu_b * mu_b
            contrast = two * (means[first + 4, x] - product) + c2
            contrast /= means[first + 2, x] + means[first + 3, x] - squares + c2
            structure[y, x] = contrast
            ssim[y, x] = contrast * (two * product + c1) / (squares + c1)
