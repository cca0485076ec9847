"""Frozen Gaussians in front of learning ones: what every back end refuses. Values: tests.engine.backends."""

from __future__ import annotations

import pytest
import torch

from engine.backends.table import BACKENDS, backend_called
from engine.model.joining import join_frozen
from engine.raster.gaussians import Gaussians


def random_gaussians(n: int, seed: int) -> Gaussians:
    generator = torch.Generator().manual_seed(seed)
    columns = (torch.rand(*shape, generator=generator) for shape in ((n, 3), (n, 4), (n, 3), (n,), (n, 3)))
    return Gaussians(*columns)


@pytest.mark.parametrize("name", BACKENDS)
@pytest.mark.parametrize("row", [-1, 10])
def test_a_row_out_of_range_is_an_error(name, row):
    with pytest.raises(ValueError, match=r"0\.\.9"):
        join_frozen(random_gaussians(10, 0), torch.tensor([row]), random_gaussians(2, 1), backend=backend_called(name))


def test_what_kernels_would_misread_is_an_error():
    frozen, learning, cpu = random_gaussians(10, 0), random_gaussians(2, 1), backend_called("cpu")
    row = torch.tensor([1])
    with pytest.raises(TypeError, match=r"rows .* int64 \[n\], got torch\.int32"):
        join_frozen(frozen, row.int(), learning, backend=cpu)
    with pytest.raises(TypeError, match=r"rows .* contiguous"):
        join_frozen(frozen, torch.arange(6)[::2], learning, backend=cpu)
    with pytest.raises(TypeError, match=r"frozen must be float32 .* got torch\.float64"):
        join_frozen(Gaussians(*(tensor.double() for tensor in frozen.tensors())), row, learning, backend=cpu)
    with pytest.raises(TypeError, match="frozen must be contiguous"):
        join_frozen(random_gaussians(20, 0)[slice(None, None, 2)], row, learning, backend=cpu)
