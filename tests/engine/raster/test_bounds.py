"""No kernel reads or writes outside its arrays: every array ends at a page that may not be touched.

The intrinsics compute raw addresses, which numba's bounds checking does not see. A spawned child therefore places
every input, output and workspace buffer directly in front of an inaccessible page and renders; a stray access ends it
with a segmentation fault.
"""

from __future__ import annotations

import multiprocessing
import sys

import pytest

SIZES = ((0, 40, 33), (1, 1, 1), (15, 31, 65), (16, 64, 32), (17, 33, 5), (161, 70, 50))
"""Gaussians, width, height."""


def _render_beside_forbidden_pages() -> None:
    import ctypes
    import mmap

    import numpy as np
    import torch

    from engine.kernels import workspace
    from engine.raster import Gaussians, rasterize
    from engine.raster.cpu import backend
    from engine.raster.cpu.warm import warm_up
    from tests.raster_scenes import layered_scene

    warm_up()
    libc = ctypes.CDLL(None, use_errno=True)
    keep: list[mmap.mmap] = []  # guarded pages stay until the child ends

    def guarded_bytes(n_bytes: int) -> np.ndarray:
        """Bytes that end where a page without any rights begins."""
        page = mmap.PAGESIZE
        n_pages = -(-n_bytes // page) + 1
        area = mmap.mmap(-1, n_pages * page)
        keep.append(area)
        data = np.frombuffer(area, np.uint8)
        last = data.ctypes.data + (n_pages - 1) * page
        if libc.mprotect(ctypes.c_void_p(last), ctypes.c_size_t(page), 0):
            raise OSError(ctypes.get_errno(), "mprotect")
        return data[(n_pages - 1) * page - n_bytes : (n_pages - 1) * page]

    def guarded_tensor(values: torch.Tensor) -> torch.Tensor:
        array = guarded_bytes(values.numel() * values.element_size()).view(values.numpy().dtype)
        result = torch.from_numpy(array).view(values.shape)
        result.copy_(values)
        return result

    class GuardedWorkspace(workspace.Workspace):
        """Exactly what is asked for. Buffers that need alignment have rows of whole cache lines, so they keep it."""

        def array(self, name, shape, dtype):
            found = self._buffers.get(name)
            n_bytes = int(np.prod(shape)) * np.dtype(dtype).itemsize
            if found is None or len(found) != n_bytes:
                self._buffers[name] = found = guarded_bytes(n_bytes)
            return found.view(dtype).reshape(shape)

    def guarded_like(empty):
        def make(*arguments, **options):
            plain = empty(*arguments, **options)
            return guarded_tensor(plain) if plain.numel() and plain.device.type == "cpu" else plain

        return make

    backend.Workspace = workspace.Workspace = GuardedWorkspace
    torch.empty, torch.empty_like = guarded_like(torch.empty), guarded_like(torch.empty_like)
    for n_rows, width, height in SIZES:
        for size in (0.5, 30.0):
            scene = layered_scene(n_rows, width, height, size)
            rows, columns = -(-height // 32), -(-width // 32)
            for mask in (None, guarded_tensor(torch.arange(rows * columns).view(rows, columns) % 2 == 0)):
                for share in (0, 2):
                    backend.POOL.clear()
                    leaves = Gaussians(
                        *(guarded_tensor(tensor.float()).requires_grad_() for tensor in scene.gaussians.tensors()),
                        is_frozen=guarded_tensor(torch.arange(n_rows) % 3 < share),
                    )
                    rendering = rasterize(
                        leaves, *scene.arguments, tile_mask=mask, want_means2d=True, want_depth=True, backend="cpu"
                    )
                    assert rendering.depth is not None
                    gradients = [guarded_tensor(torch.ones_like(t)) for t in (rendering.image, rendering.alpha)]
                    torch.autograd.backward([rendering.image, rendering.alpha], gradients, retain_graph=True)
                    rendering.depth.sum().backward()
                    with torch.no_grad():
                        rasterize(leaves, *scene.arguments, tile_mask=mask, want_depth=True, backend="cpu")


def _touch_a_forbidden_page() -> None:
    import ctypes
    import mmap

    area = mmap.mmap(-1, mmap.PAGESIZE)
    address = ctypes.addressof(ctypes.c_char.from_buffer(area))
    ctypes.CDLL(None).mprotect(ctypes.c_void_p(address), ctypes.c_size_t(mmap.PAGESIZE), 0)
    ctypes.c_char.from_address(address).value = b"x"


def _exit_code(work) -> int | None:
    process = multiprocessing.get_context("spawn").Process(target=work)
    process.start()
    process.join()
    return process.exitcode


@pytest.mark.skipif(sys.platform != "linux", reason="page rights are set through Linux's mprotect")
def test_no_kernel_leaves_its_arrays():
    assert _exit_code(_touch_a_forbidden_page) == -11, "the guard itself must bite"
    assert _exit_code(_render_beside_forbidden_pages) == 0, "-11 is an access outside an array"
