"""Adam of contiguous float32 parameters: reads every gradient once for the norm, then updates in one parallel launch.

Both passes take all parameters in fixed chunks. Blocks of 64 values whose gradient was zero at every step so far are
skipped: their moments are zero, so nothing would change. Most entries of a hash table are never looked at. Skipping
what has no gradient in one step alone would be another optimiser: where a gradient is zero Adam still moves a value by
its momentum.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import torch
from llvmlite import ir
from numba import get_num_threads, njit, types
from numba.np.numpy_support import carray
from torch import Tensor

from engine.backends.backend import ADAM_BETAS, ADAM_EPSILON
from engine.kernels.arrays import Doubles1, Floats2, Ints2, job_reader, pack
from engine.kernels.lanes import kernel_intrinsic
from engine.kernels.routines import WORKER, routine, run

BETA1, BETA2 = ADAM_BETAS
_BLOCK = 64
_CHUNK = 1 << 14
_GRADIENT, _TOUCHED, _COUNT = 1, 4, 5
_KEEP1, _KEEP2 = np.float32(BETA1), np.float32(BETA2)
_NEW1, _NEW2 = np.float32(1 - BETA1), np.float32(1 - BETA2)
_EPSILON = np.float32(ADAM_EPSILON)


@kernel_intrinsic
def _pointer(typing_context, address):
    """An int64 address as a pointer."""

    def generate(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.int64), generate


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
    """Arguments of `work_on_chunks`.

    Attributes:
        chunks: Addresses of values, gradient, both moments and touched flags, and number of values. [n, 6]
        is_update: 1 for Adam of the touched blocks; 0 for flags of blocks with a gradient and sums of squares.
        scale: Factor of the gradients.
        factors: step_size and root_scale of `_adam` for each chunk, read for an update. [n, 2]
        sums: Sum of squares of each chunk, written unless it is an update. [n]
        n_workers: How many workers share the chunks.
    """

    chunks: Ints2
    is_update: int
    scale: float
    factors: Floats2
    sums: Doubles1
    n_workers: int


@kernel_intrinsic
def _read_chunk_job(typing_context, address):
    """The ChunkJob at an address."""
    return job_reader(ChunkJob)


@routine(WORKER)
def work_on_chunks(worker, arguments):
    """See ChunkJob."""
    job = _read_chunk_job(arguments)
    chunks, scale = job.chunks, np.float32(job.scale)
    for c in range(len(chunks) * worker // job.n_workers, len(chunks) * (worker + 1) // job.n_workers):
        n = chunks[c, 5]
        n_blocks = (n + 63) // 64
        gradients = carray(_pointer(chunks[c, 1]), (n,), np.float32)
        touched = carray(_pointer(chunks[c, 4]), (n_blocks,), np.uint8)
        values = carray(_pointer(chunks[c, 0]), (n,), np.float32)
        means = carray(_pointer(chunks[c, 2]), (n,), np.float32)
        squares = carray(_pointer(chunks[c, 3]), (n,), np.float32)
        total = 0.0
        for block in range(n_blocks):
            first, end = 64 * block, min(64 * block + 64, n)
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


def _work_on_chunks(chunks: np.ndarray, is_update: bool, scale: float, factors: np.ndarray, sums: np.ndarray) -> None:
    n_workers = max(1, min(get_num_threads(), len(chunks)))
    run(work_on_chunks, pack(ChunkJob(chunks, int(is_update), scale, factors, sums, n_workers)), n_workers)


class CpuAdam:
    """See engine.backends.backend.Adam."""

    def __init__(self, parameters: Mapping[str, Tensor]) -> None:
        unfit = [name for name, p in parameters.items() if not (_is_float32(p) and p.is_contiguous())]
        if unfit:
            raise TypeError(f"back end 'cpu' needs contiguous float32 parameters on the cpu; {', '.join(unfit)} is not")
        self._parameters = dict(parameters)
        self._steps = dict.fromkeys(self._parameters, 0)
        self._means = {name: np.zeros(p.shape, np.float32) for name, p in self._parameters.items()}
        self._squares = {name: np.zeros(p.shape, np.float32) for name, p in self._parameters.items()}
        self._touched = {name: np.zeros(-(-p.numel() // _BLOCK), np.uint8) for name, p in self._parameters.items()}
        self._chunks = {name: self._cut(name) for name in self._parameters}
        self._last: tuple[list[Tensor], np.ndarray] | None = None

    def _cut(self, name: str) -> np.ndarray:
        """Chunks of a parameter, with offsets where the address of the gradient goes."""
        first = np.arange(0, self._parameters[name].numel(), _CHUNK, dtype=np.int64)
        chunks = np.empty((len(first), 6), np.int64)
        bases = (
            self._parameters[name].data_ptr(),
            0,
            self._means[name].ctypes.data,
            self._squares[name].ctypes.data,
        )
        for column, base in enumerate(bases):
            chunks[:, column] = base + 4 * first
        chunks[:, _TOUCHED] = self._touched[name].ctypes.data + first // _BLOCK
        chunks[:, _COUNT] = np.minimum(self._parameters[name].numel() - first, _CHUNK)
        return chunks

    def _table(self, gradients: Mapping[str, Tensor]) -> tuple[list[Tensor], np.ndarray]:
        for name, gradient in gradients.items():
            wanted = self._parameters[name]
            if gradient.shape != wanted.shape or not _is_float32(gradient):
                raise ValueError(
                    f"the gradient of {name} must be {list(wanted.shape)} in float32 on the cpu like the parameter, "
                    f"got {list(gradient.shape)} in {gradient.dtype} on {gradient.device}"
                )
        kept = [gradient.contiguous() for gradient in gradients.values()]  # alive as long as addresses are used
        rows = [self._chunks[name].copy() for name in gradients]
        for chunk, gradient in zip(rows, kept, strict=True):
            chunk[:, _GRADIENT] += gradient.data_ptr()
        return kept, np.concatenate(rows) if rows else np.empty((0, 6), np.int64)

    def norm(self, gradients: Mapping[str, Tensor]) -> float:
        """See Adam. Also notes which blocks have a gradient, so `update` must follow it."""
        _kept, chunks = self._table(gradients)
        sums = np.zeros(len(chunks))
        _work_on_chunks(chunks, False, 1.0, np.empty((0, 2), np.float32), sums)
        total = float(sums.sum())
        return math.sqrt(total) if total >= 0.0 else total  # NaN stays NaN

    def update(self, gradients: Mapping[str, Tensor], rates: Mapping[str, float], scale: float) -> None:
        """See Adam. `norm` of the same gradients has to be asked for before."""
        _kept, chunks = self._table(gradients)
        factors = np.empty((len(chunks), 2), np.float32)
        first = 0
        for name in gradients:
            self._steps[name] += 1
            end = first + len(self._chunks[name])
            factors[first:end, 0] = rates[name] / (1.0 - BETA1 ** self._steps[name])
            factors[first:end, 1] = 1.0 / math.sqrt(1.0 - BETA2 ** self._steps[name])
            first = end
        _work_on_chunks(chunks, True, scale, factors, np.empty(0))

    def state(self) -> dict[str, dict[str, Tensor]]:
        """See Adam."""
        return {
            name: {
                "step": torch.tensor(n_steps, dtype=torch.float32),
                "exp_avg": torch.from_numpy(self._means[name].copy()),
                "exp_avg_sq": torch.from_numpy(self._squares[name].copy()),
            }
            for name, n_steps in self._steps.items()
            if n_steps
        }

    def restore(self, name: str, state: Mapping[str, Tensor]) -> None:
        """See Adam."""
        self._steps[name] = round(state["step"].item())  # a file gives a single number back as [1]
        for moment, kept in (("exp_avg", self._means[name]), ("exp_avg_sq", self._squares[name])):
            if state[moment].shape != kept.shape:
                raise ValueError(f"{moment} of {name} is {list(state[moment].shape)}, not {list(kept.shape)}")
            kept[...] = state[moment].detach().cpu().numpy()
        is_moving = (self._means[name].ravel() != 0) | (self._squares[name].ravel() != 0)
        starts = np.arange(0, is_moving.size, _BLOCK)
        self._touched[name][:] = np.logical_or.reduceat(is_moving, starts) if is_moving.size else 0


def _is_float32(tensor: Tensor) -> bool:
    """float32 in main memory."""
    return tensor.dtype == torch.float32 and tensor.device.type == "cpu"
