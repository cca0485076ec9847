"""Adam of contiguous float32 parameters: reads every gradient once for the norm, then updates in one parallel launch.

Both passes take all parameters in fixed chunks. Blocks of 64 values whose gradient was zero at every step so far are
skipped: their moments are zero, so nothing would change. Most entries of a hash table are never looked at. Skipping
what has no gradient in one step alone would be another optimiser: where a gradient is zero Adam still moves a value by
its momentum.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
import torch
from numba import get_num_threads, njit
from torch import Tensor

from engine.backends.backend import ADAM_BETAS, ADAM_EPSILON
from engine.kernels.jobs import Doubles1, Floats2, Ints2, ManyBytes, ManyFloats, Workers, bytes_at, floats_at, read
from engine.kernels.launch import kernel, launch
from engine.kernels.routines import load_int

BETA1, BETA2 = ADAM_BETAS
_BLOCK = 64
_CHUNK = 1 << 14
_KEEP1, _KEEP2 = np.float32(BETA1), np.float32(BETA2)
_NEW1, _NEW2 = np.float32(1 - BETA1), np.float32(1 - BETA2)
_EPSILON = np.float32(ADAM_EPSILON)


@njit(nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _sum_squares(values):
    total = 0.0
    for i in range(values.shape[0]):
        wide = np.float64(values[i])
        total += wide * wide
    return total


@njit(nogil=True, error_model="numpy")
def _adam(values, gradients, means, squares, scale, step_size, root_scale):
    """Adam of one block; step_size is rate / (1 - beta1^t), root_scale is 1 / sqrt(1 - beta2^t)."""
    for i in range(values.shape[0]):
        gradient = gradients[i] * scale
        mean = _KEEP1 * means[i] + _NEW1 * gradient
        square = _KEEP2 * squares[i] + _NEW2 * gradient * gradient
        means[i] = mean
        squares[i] = square
        values[i] -= step_size * (mean / (np.sqrt(square) * root_scale + _EPSILON))


class ChunkJob(NamedTuple):
    """Arguments of `work_on_chunks`. Parameters are cut into chunks, which the workers share.

    Attributes:
        chunks: Number of the parameter, first value and number of values of each chunk. [n, 3]
        values, gradients, means, squares: Of every parameter.
        touched: Flag of every block of every parameter that ever had a gradient.
        is_update: 1 for Adam of the touched blocks; 0 for flags of blocks with a gradient and sums of squares.
        scale: Factor of the gradients.
        factors: step_size and root_scale of `_adam` for each chunk, read for an update. [n, 2]
        sums: Sum of squares of each chunk, written unless it is an update. [n]
    """

    chunks: Ints2
    values: ManyFloats
    gradients: ManyFloats
    means: ManyFloats
    squares: ManyFloats
    touched: ManyBytes
    is_update: int
    scale: float
    factors: Floats2
    sums: Doubles1
    n_workers: Workers = None


@kernel(ChunkJob)
def work_on_chunks(worker, arguments):
    """See ChunkJob."""
    job = read(ChunkJob, arguments)
    chunks, scale = job.chunks, np.float32(job.scale)
    for c in range(len(chunks) * worker // job.n_workers, len(chunks) * (worker + 1) // job.n_workers):
        parameter, start, n = 8 * chunks[c, 0], chunks[c, 1], chunks[c, 2]
        n_blocks = (n + _BLOCK - 1) // _BLOCK
        touched = bytes_at(load_int(job.touched + parameter) + start // _BLOCK, n_blocks)
        values = floats_at(load_int(job.values + parameter) + 4 * start, n)
        gradients = floats_at(load_int(job.gradients + parameter) + 4 * start, n)
        means = floats_at(load_int(job.means + parameter) + 4 * start, n)
        squares = floats_at(load_int(job.squares + parameter) + 4 * start, n)
        total = 0.0
        for block in range(n_blocks):
            first, end = _BLOCK * block, min(_BLOCK * (block + 1), n)
            if not job.is_update:
                part = _sum_squares(gradients[first:end])
                if part != 0.0:
                    touched[block] = 1
                total += part
            elif touched[block]:
                _adam(
                    values[first:end],
                    gradients[first:end],
                    means[first:end],
                    squares[first:end],
                    scale,
                    job.factors[c, 0],
                    job.factors[c, 1],
                )
        if not job.is_update:
            job.sums[c] = total


class CpuAdam:
    """See engine.backends.backend.Adam."""

    def __init__(self, parameters: Mapping[str, Tensor]) -> None:
        unfit = [name for name, p in parameters.items() if not (_is_float32(p) and p.is_contiguous())]
        if unfit:
            raise TypeError(f"back end 'cpu' needs contiguous float32 parameters on the cpu; {', '.join(unfit)} is not")
        self._parameters = dict(parameters)
        self.steps = dict.fromkeys(self._parameters, 0)
        self._means = {name: np.zeros(p.shape, np.float32) for name, p in self._parameters.items()}
        self._squares = {name: np.zeros(p.shape, np.float32) for name, p in self._parameters.items()}
        self._touched = {name: np.zeros(-(-p.numel() // _BLOCK), np.uint8) for name, p in self._parameters.items()}
        self._chunks = {name: _cut(p.numel()) for name, p in self._parameters.items()}

    def _work(
        self, gradients: Mapping[str, Tensor], scale: float, factors: np.ndarray | None, sums: np.ndarray | None
    ) -> None:
        """One launch over the parameters that have a gradient: an update with `factors`, else sums of squares."""
        for name, gradient in gradients.items():
            wanted = self._parameters[name]
            if gradient.shape != wanted.shape or not _is_float32(gradient):
                raise ValueError(
                    f"the gradient of {name} must be {list(wanted.shape)} in float32 on the cpu like the parameter, "
                    f"got {list(gradient.shape)} in {gradient.dtype} on {gradient.device}"
                )
        chunks = self._chunks_of(gradients)
        job = ChunkJob(
            chunks,
            [self._parameters[name].detach() for name in gradients],
            [gradient.contiguous() for gradient in gradients.values()],
            [self._means[name] for name in gradients],
            [self._squares[name] for name in gradients],
            [self._touched[name] for name in gradients],
            int(factors is not None),
            scale,
            np.empty((0, 2), np.float32) if factors is None else factors,
            np.empty(0) if sums is None else sums,
        )
        launch(work_on_chunks, job, max(1, min(get_num_threads(), len(chunks))))

    def _chunks_of(self, names: Iterable[str]) -> np.ndarray:
        """Chunks of some parameters, which are numbered in this order. [n, 3] int64"""
        rows = [self._chunks[name] + (number, 0, 0) for number, name in enumerate(names)]
        return np.concatenate(rows) if rows else np.empty((0, 3), np.int64)

    def step(
        self, gradients: Mapping[str, Tensor], rates: Mapping[str, float], *, max_norm: float, is_sound: Tensor
    ) -> Tensor:
        """See Adam."""
        norm = self._norm(gradients)
        for name in gradients:
            self.steps[name] += 1
        if math.isfinite(norm) and bool(is_sound):
            self._update(gradients, rates, max_norm / norm if 0.0 < max_norm < norm else 1.0)
        return torch.tensor(norm, dtype=torch.float64)

    def _norm(self, gradients: Mapping[str, Tensor]) -> float:
        """Also notes which blocks have a gradient."""
        sums = np.zeros(sum(len(self._chunks[name]) for name in gradients))
        self._work(gradients, 1.0, None, sums)
        total = float(sums.sum())
        return math.sqrt(total) if total >= 0.0 else total  # NaN stays NaN

    def _update(self, gradients: Mapping[str, Tensor], rates: Mapping[str, float], scale: float) -> None:
        factors = np.empty((sum(len(self._chunks[name]) for name in gradients), 2), np.float32)
        first = 0
        for name in gradients:
            end = first + len(self._chunks[name])
            factors[first:end, 0] = rates[name] / (1.0 - BETA1 ** self.steps[name])
            factors[first:end, 1] = 1.0 / math.sqrt(1.0 - BETA2 ** self.steps[name])
            first = end
        self._work(gradients, scale, factors, None)

    def state(self) -> dict[str, dict[str, Tensor]]:
        """See Adam."""
        return {
            name: {
                "step": torch.tensor(n_steps, dtype=torch.float32),
                "exp_avg": torch.from_numpy(self._means[name].copy()),
                "exp_avg_sq": torch.from_numpy(self._squares[name].copy()),
            }
            for name, n_steps in self.steps.items()
            if n_steps
        }

    def restore(self, name: str, state: Mapping[str, Tensor]) -> None:
        """See Adam."""
        self.steps[name] = round(state["step"].item())  # a file gives a single number back as [1]
        for moment, kept in (("exp_avg", self._means[name]), ("exp_avg_sq", self._squares[name])):
            if state[moment].shape != kept.shape:
                raise ValueError(f"{moment} of {name} is {list(state[moment].shape)}, not {list(kept.shape)}")
            kept[...] = state[moment].detach().cpu().numpy()
        is_moving = (self._means[name].ravel() != 0) | (self._squares[name].ravel() != 0)
        starts = np.arange(0, is_moving.size, _BLOCK)
        self._touched[name][:] = np.logical_or.reduceat(is_moving, starts) if is_moving.size else 0


def _cut(n_values: int) -> np.ndarray:
    """Chunks of a parameter: 0 for its number, first value, number of values. [n, 3] int64"""
    first = np.arange(0, n_values, _CHUNK, dtype=np.int64)
    return np.stack([np.zeros_like(first), first, np.minimum(n_values - first, _CHUNK)], 1)


def _is_float32(tensor: Tensor) -> bool:
    """float32 in main memory."""
    return tensor.dtype == torch.float32 and tensor.device.type == "cpu"
