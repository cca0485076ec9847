"""Arrays beside pages that may not be touched, and children in which kernels run on nothing but such arrays.

Kernels compute raw addresses, which numba's bounds checking does not see. Here a stray access ends the process with a
segmentation fault instead. Memory is given back as soon as nobody holds it, so an access after that ends it as well.
"""

from __future__ import annotations

import ctypes
import math
import mmap
import multiprocessing
import sys
from collections.abc import Callable, Iterable
from multiprocessing.connection import Connection
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

if TYPE_CHECKING:
    from torch import Tensor

SEGMENTATION_FAULT = -11
"""Exit code of a process that touched a forbidden page."""
needs_page_rights = pytest.mark.skipif(sys.platform != "linux", reason="page rights are set through Linux's mprotect")
_ALLOCATING = ("empty", "zeros", "ones", "full", "tile", "array", "arange", "concatenate", "ascontiguousarray")
"""Functions of numpy with which callers of kernels make arrays."""
_ALLOCATING_TENSORS = ("empty", "empty_like", "zeros", "zeros_like", "ones", "ones_like")


class GuardedMemory:
    """Makes arrays with a forbidden page right behind their last byte, or right in front of their first.

    Args:
        is_behind: Which of the two; there is one on the other side as well, somewhere in the same page.
    """

    def __init__(self, *, is_behind: bool) -> None:
        self.is_behind = is_behind
        self._protect = ctypes.CDLL(None, use_errno=True).mprotect

    def bytes(self, n_bytes: int) -> np.ndarray:
        """Zeros. [n_bytes] uint8"""
        page = mmap.PAGESIZE
        n_pages = -(-n_bytes // page)
        area = mmap.mmap(-1, (n_pages + 2) * page)
        data = np.frombuffer(area, np.uint8)  # holds the area
        first = data.ctypes.data
        for forbidden in (first, first + (n_pages + 1) * page):
            if self._protect(ctypes.c_void_p(forbidden), ctypes.c_size_t(page), 0):
                raise OSError(ctypes.get_errno(), "mprotect")
        start = (n_pages + 1) * page - n_bytes if self.is_behind else page
        return data[start : start + n_bytes]

    def array(self, values: np.ndarray) -> np.ndarray:
        """A copy; an array without values as it is."""
        if not values.size:
            return values
        copy = self.bytes(values.nbytes).view(values.dtype).reshape(values.shape)
        copy[...] = values
        return copy

    def tensor(self, values: Tensor) -> Tensor:
        """A copy without history; a tensor without values as it is."""
        import torch

        values = values.detach()
        return torch.from_numpy(self.array(values.numpy())) if values.numel() else values

    def take_over(self, modules: Iterable[ModuleType], functions: Iterable[str] = ()) -> None:
        """From now on, what these modules make with numpy, and all of this process with torch or a pool, is guarded.

        Their kernels must be compiled: numba would not know what stands in the place of numpy.

        Args:
            modules: Modules that make arrays for kernels.
            functions: Names of functions in them whose results are to be copied, because they come from methods.
        """
        import torch

        from engine.kernels import memory, workspace

        for module in modules:
            values = vars(module)
            values["np"] = _GuardedNumpy(self)
            values.update({name: self._guarded(values[name], self.array) for name in functions if name in values})
        for name in _ALLOCATING_TENSORS:
            setattr(torch, name, self._guarded(getattr(torch, name), self.tensor))
        guarded = self

        def empty(_pool: memory.RecycledMemory, *shape: int) -> Tensor:
            return guarded.tensor(torch.from_numpy(np.empty(shape, np.float32)))

        def workspace_array(
            kept: workspace.Workspace, name: str, shape: tuple[int, ...], dtype: type[np.generic]
        ) -> np.ndarray:
            # exactly what is asked for; buffers that need alignment have rows of whole cache lines, so they keep it
            n_bytes = math.prod(shape) * np.dtype(dtype).itemsize
            buffer = guarded.bytes(n_bytes)
            kept._buffers[name] = buffer
            return buffer.view(dtype).reshape(shape)

        memory.RecycledMemory.empty = empty  # pyright: ignore[reportAttributeAccessIssue]
        workspace.Workspace.array = workspace_array  # pyright: ignore[reportAttributeAccessIssue]

    @staticmethod
    def _guarded(make: Callable[..., Any], guard: Callable[[Any], Any]) -> Callable[..., Any]:
        plain = getattr(make, "unguarded", make)  # not twice

        def made(*arguments: Any, **options: Any) -> Any:
            return guard(plain(*arguments, **options))

        made.unguarded = plain  # pyright: ignore[reportFunctionMemberAccess]
        return made


class _GuardedNumpy:
    """Stands in the place of numpy in one module."""

    def __init__(self, memory: GuardedMemory) -> None:
        self._memory = memory

    def __getattr__(self, name: str) -> Any:
        plain = getattr(np, name)
        return GuardedMemory._guarded(plain, self._memory.array) if name in _ALLOCATING else plain


def run_child(work: Callable[[Callable[[str], None]], None]) -> tuple[int | None, str]:
    """Run `work` in a fresh process. Returns its exit code, and what it said last by the function that it is given."""
    context = multiprocessing.get_context("spawn")
    reports, to_parent = context.Pipe(duplex=False)
    process = context.Process(target=_work_and_report, args=(work, to_parent))
    process.start()
    to_parent.close()
    said = "nothing"
    while True:
        try:
            said = reports.recv()
        except EOFError:
            break
    process.join()
    return process.exitcode, said


def _work_and_report(work: Callable[[Callable[[str], None]], None], to_parent: Connection) -> None:
    work(to_parent.send)
