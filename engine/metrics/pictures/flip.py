"""FLIP: what a viewer notices when two pictures alternate, 0 (nothing) to 1.

LDR-FLIP at the authors' default viewing distance, 67 pixels per degree (a 0.7 m wide 3840 px screen at 0.7 m), in
compiled kernels: each picture is filtered once (`seen`), pairs are compared from that (`flip_of`). The slow truth is
the authors' own package flip-evaluator, against which the tests compare. Source: Andersson et al. 2020.
Pictures are [H, W, 3], display-encoded sRGB, and are clamped to 0..1 first; masks [H, W] bool.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import get_num_threads
from torch import Tensor

from engine.kernels.jobs import Floats2, Floats3, Workers, read
from engine.kernels.launch import kernel, launch
from engine.kernels.memory import RecycledMemory
from engine.kernels.workspace import WorkspacePool
from engine.metrics.pictures.flip_lanes import (
    N_FILTERED,
    N_SEEN,
    RADIUS,
    difference,
    filter_along,
    filter_down,
    to_opponent,
)
from engine.metrics.pictures.similarity import masked_mean

_POOL, _MEMORY = WorkspacePool(), RecycledMemory()
_MARGIN = 16
"""Floats on both ends of a scratch row; filters reach RADIUS of them."""


class Seen(NamedTuple):
    """The features of a picture that FLIP compares: L, a, b after the eye's blur, edges and points.

    Attributes:
        planes: Rows are padded to whole vectors. [5, H, >= W] float32
        width: W.
    """

    planes: Tensor
    width: int


class AlongJob(NamedTuple):
    """Arguments of `along_rows`.

    Attributes:
        picture: Display-encoded sRGB in 0..1. [H, 3 W]
        scratch: Three rows a worker. [3 workers, padded W + 32]
        filtered: Written from row RADIUS on. [7, H + 20, padded W]
    """

    picture: Floats2
    scratch: Floats2
    filtered: Floats3
    n_workers: Workers = None


class DownJob(NamedTuple):
    """Arguments of `down_columns`.

    Attributes:
        filtered: Of `along_rows`, first and last row repeated beyond the border. [7, H + 20, padded W]
        planes: Written, see Seen. [5, H, padded W]
    """

    filtered: Floats3
    planes: Floats3
    n_workers: Workers = None


class DifferenceJob(NamedTuple):
    """Arguments of `compare`.

    Attributes:
        first, second: See Seen. [5, H, padded W]
        errors: Written. [H, padded W]
    """

    first: Floats3
    second: Floats3
    errors: Floats2
    n_workers: Workers = None


def seen(picture: np.ndarray) -> Seen:
    """Filter a picture as the eye would, for `flip_of`.

    Raises:
        ValueError: It has no pixels, or a value that is not finite.
    """
    height, width, _ = picture.shape
    if not picture.size:
        raise ValueError("FLIP is not defined for pictures without pixels")
    if not np.isfinite(picture).all():
        raise ValueError("FLIP is not defined for pictures with values that are not finite")
    rows = np.ascontiguousarray(np.clip(picture, 0.0, 1.0), np.float32).reshape(height, 3 * width)
    padded = -(-width // 16) * 16
    n_workers = max(1, min(get_num_threads(), height))
    planes = _MEMORY.empty(N_SEEN, height, padded)
    workspace = _POOL.take()
    scratch = workspace.array("scratch", (3 * n_workers, padded + 2 * _MARGIN), np.float32)
    filtered = workspace.array("filtered", (N_FILTERED, height + 2 * RADIUS, padded), np.float32)
    launch(along_rows, AlongJob(rows, scratch, filtered), n_workers)
    filtered[:, :RADIUS] = filtered[:, RADIUS : RADIUS + 1]
    filtered[:, -RADIUS:] = filtered[:, -RADIUS - 1 : -RADIUS]
    launch(down_columns, DownJob(filtered, planes), n_workers)
    _POOL.give_back(workspace)
    return Seen(planes, width)


def flip_of(image: Seen, truth: Seen) -> np.ndarray:
    """FLIP error of each pixel of two pictures of one size. [H, W] float32 in 0..1"""
    _, height, padded = image.planes.shape
    errors = _MEMORY.empty(height, padded)
    launch(compare, DifferenceJob(image.planes, truth.planes, errors))
    return errors.numpy()[:, : image.width]


def flip_map(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """FLIP error of each pixel. [H, W] float32 in 0..1

    Raises:
        ValueError: A picture has no pixels, or a value that is not finite.
    """
    return flip_of(seen(image), seen(truth))


def flip(image: np.ndarray, truth: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Mean of `flip_map` over all pixels or those of a mask [H, W] bool; NaN for an empty one."""
    return masked_mean(flip_map(image, truth), mask)


def warm_up() -> None:
    """Compile the kernels, or load them from the cache, by comparing pictures of one pixel."""
    flip_map(np.zeros((1, 1, 3), np.float32), np.ones((1, 1, 3), np.float32))


@kernel(AlongJob)
def along_rows(worker, arguments):
    """See AlongJob."""
    job = read(AlongJob, arguments)
    picture, scratch, filtered = job.picture, job.scratch, job.filtered
    height, width = len(picture), picture.shape[1] // 3
    padded = filtered.shape[2]
    plane_bytes = 4 * filtered.shape[1] * padded
    r, g, b = 3 * worker, 3 * worker + 1, 3 * worker + 2
    for y in range(height * worker // job.n_workers, height * (worker + 1) // job.n_workers):
        for x in range(width):
            scratch[r, x + 16] = picture[y, 3 * x]
            scratch[g, x + 16] = picture[y, 3 * x + 1]
            scratch[b, x + 16] = picture[y, 3 * x + 2]
        for x in range(width, padded):  # the last vector is converted whole
            for channel in range(r, b + 1):
                scratch[channel, x + 16] = scratch[channel, width + 15]
        for x in range(0, padded, 16):
            to_opponent(
                scratch[r, x + 16 :].ctypes.data, scratch[g, x + 16 :].ctypes.data, scratch[b, x + 16 :].ctypes.data
            )
        for channel in range(r, b + 1):
            for x in range(RADIUS):
                scratch[channel, 15 - x] = scratch[channel, 16]
                scratch[channel, padded + 16 + x] = scratch[channel, width + 15]
        for x in range(0, padded, 16):
            filter_along(
                scratch[r, x + 16 :].ctypes.data,
                scratch[g, x + 16 :].ctypes.data,
                scratch[b, x + 16 :].ctypes.data,
                filtered[0, y + RADIUS, x:].ctypes.data,
                plane_bytes,
            )


@kernel(DownJob)
def down_columns(worker, arguments):
    """See DownJob."""
    job = read(DownJob, arguments)
    filtered, planes = job.filtered, job.planes
    height, padded = planes.shape[1], planes.shape[2]
    for y in range(height * worker // job.n_workers, height * (worker + 1) // job.n_workers):
        source, target = filtered[0, y + RADIUS].ctypes.data, planes[0, y].ctypes.data
        for x in range(0, padded, 16):
            filter_down(source + 4 * x, 4 * filtered.shape[1] * padded, 4 * padded, target + 4 * x, 4 * height * padded)


@kernel(DifferenceJob)
def compare(worker, arguments):
    """See DifferenceJob."""
    job = read(DifferenceJob, arguments)
    first, second, errors = job.first, job.second, job.errors
    height, padded = errors.shape
    for y in range(height * worker // job.n_workers, height * (worker + 1) // job.n_workers):
        a, b, target = first[0, y].ctypes.data, second[0, y].ctypes.data, errors[y].ctypes.data
        for x in range(0, padded, 16):
            difference(a + 4 * x, b + 4 * x, 4 * height * padded, target + 4 * x)
