"""Buffers that outlive a call: grown when needed, handed from one rendering to the next, never shared by two.

Fresh large arrays cost page faults at every step, so a rendering borrows a `Workspace` and gives it back: at once when
nothing was recorded for autograd, else when autograd drops the graph. Two renderings that are alive at the same time
hold two workspaces; that is what makes interleaved forwards and several threads right.
"""

from __future__ import annotations

import math
import weakref
from collections import deque

import numpy as np
import torch
from torch import Tensor

_ALIGNMENT = 64
_GROWTH = 1.25


class Workspace:
    """Named one-dimensional buffers, aligned to cache lines. Contents are undefined between renderings."""

    def __init__(self) -> None:
        self._buffers: dict[str, np.ndarray] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: type[np.generic]) -> np.ndarray:
        """An uninitialised array of this shape in the buffer of this name; an earlier array there becomes invalid."""
        n_bytes = math.prod(shape) * np.dtype(dtype).itemsize
        buffer = self._buffers.get(name)
        if buffer is None or len(buffer) < n_bytes:
            self._buffers[name] = buffer = _aligned_bytes(int(n_bytes * _GROWTH))
        return buffer[:n_bytes].view(dtype).reshape(shape)

    @property
    def n_bytes(self) -> int:
        """Bytes held."""
        return sum(len(buffer) for buffer in self._buffers.values())


def _aligned_bytes(n_bytes: int) -> np.ndarray:
    raw = np.empty(n_bytes + _ALIGNMENT, np.uint8)
    start = -raw.ctypes.data % _ALIGNMENT
    return raw[start : start + n_bytes]


class WorkspacePool:
    """Workspaces that nobody uses at the moment. deque operations are atomic, so no lock is needed.

    Args:
        max_idle: More than this many idle workspaces are dropped.
        max_idle_bytes: A workspace larger than this is dropped when it comes back.
    """

    def __init__(self, max_idle: int = 4, max_idle_bytes: int = 512 << 20) -> None:
        self._idle: deque[Workspace] = deque(maxlen=max_idle)
        self._max_idle_bytes = max_idle_bytes

    def take(self) -> Workspace:
        """The workspace used last, or a fresh one."""
        try:
            return self._idle.pop()
        except IndexError:
            return Workspace()

    def give_back(self, workspace: Workspace) -> None:
        """Offer it to the next rendering. The caller must no longer touch its arrays."""
        if workspace.n_bytes <= self._max_idle_bytes:
            self._idle.append(workspace)

    def lease(self, workspace: Workspace) -> Tensor:
        """A tensor to save for the backward pass; the workspace comes back when autograd lets go of it.

        That is after a backward pass without retain_graph, or when the graph is collected.
        """
        token = np.zeros(1, np.float32)
        weakref.finalize(token, self.give_back, workspace).atexit = False
        return torch.from_numpy(token)

    def clear(self) -> None:
        """Free all idle workspaces."""
        self._idle.clear()

    def __len__(self) -> int:
        return len(self._idle)
