"""Tensors whose memory is used again: a fresh large array costs page faults at every step of a training.

A tensor from here owns its memory like any other for as long as anybody holds it, autograd and optimiser included;
when the last holder lets go, the memory waits for the next tensor of about that size.
"""

from __future__ import annotations

import weakref
from collections import deque
from math import prod

import numpy as np
import torch
from torch import Tensor

_ALIGNMENT = 64
_SMALLEST = 1 << 14
"""Bytes below which torch's own allocation is as good."""
_MAX_IDLE = 8
"""Idle buffers kept per size."""
_STEPS_PER_OCTAVE = 4
"""Sizes are rounded up to this many per power of two: at most a quarter more than asked for."""


class RecycledMemory:
    """Idle buffers by size. Safe from several threads: deque operations are atomic."""

    def __init__(self) -> None:
        self._idle: dict[int, deque[np.ndarray]] = {}

    def empty(self, *shape: int) -> Tensor:
        """An uninitialised float32 tensor, aligned to cache lines."""
        n_bytes = 4 * prod(shape)
        if n_bytes < _SMALLEST:
            return torch.empty(shape)
        size = _rounded(n_bytes)
        idle = self._idle.setdefault(size, deque(maxlen=_MAX_IDLE))
        try:
            buffer = idle.pop()
        except IndexError:
            buffer = np.empty(size + _ALIGNMENT, np.uint8)
        start = -buffer.ctypes.data % _ALIGNMENT
        array = buffer[start : start + n_bytes].view(np.float32).reshape(shape)
        # torch holds the array as long as the tensor's memory is in use, and nobody else does
        weakref.finalize(array, idle.append, buffer).atexit = False
        return torch.from_numpy(array)

    def empty_like(self, tensor: Tensor) -> Tensor:
        """`empty` of the same shape."""
        return self.empty(*tensor.shape)

    def zeros_like(self, tensor: Tensor) -> Tensor:
        """Zeros of the same shape."""
        return self.empty(*tensor.shape).zero_()

    def clear(self) -> None:
        """Free all idle buffers."""
        self._idle.clear()


def _rounded(n_bytes: int) -> int:
    step = 1 << max(n_bytes.bit_length() - 1, 0) >> (_STEPS_PER_OCTAVE.bit_length() - 1)
    return -(-n_bytes // step) * step
