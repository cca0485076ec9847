"""Frozen Gaussians in front of learning ones."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from engine.backends.cpu.decode.joining import join_frozen
from engine.raster.gaussians import Gaussians


def random_gaussians(n: int, seed: int) -> Gaussians:
    generator = torch.Generator().manual_seed(seed)
    columns = (torch.rand(*shape, generator=generator) for shape in ((n, 3), (n, 4), (n, 3), (n,), (n, 3)))
    return Gaussians(*columns)


@pytest.mark.parametrize("rows", [[], [4], [0, 1, 2, 7, 9, 8, 3]])
@pytest.mark.parametrize("n_learning", [0, 3, 5000])
def test_joined_rows_are_the_same_and_only_the_learning_ones_learn(rows, n_learning):
    frozen, learning = random_gaussians(10, 0), random_gaussians(n_learning, 1)
    for tensor in learning.tensors():
        tensor.requires_grad_()
    indices = np.array(rows, np.int64)
    joined = join_frozen(frozen, indices, learning)
    expected = Gaussians.concatenate([frozen[torch.from_numpy(indices)], learning])
    for found, wanted in zip(joined.tensors(), expected.tensors(), strict=True):
        assert torch.equal(found, wanted)
    assert joined.frozen_rows().tolist() == [True] * len(rows) + [False] * n_learning
    weights = [torch.rand(tensor.shape) for tensor in joined.tensors()]
    torch.stack(
        [(tensor * weight).sum() for tensor, weight in zip(joined.tensors(), weights, strict=True)]
    ).sum().backward()
    for tensor, weight in zip(learning.tensors(), weights, strict=True):
        assert tensor.grad is not None
        assert torch.equal(tensor.grad, weight[len(rows) :])


@pytest.mark.parametrize("row", [-1, 10])
def test_a_row_out_of_range_is_an_error(row):
    with pytest.raises(ValueError, match=r"0\.\.9"):
        join_frozen(random_gaussians(10, 0), np.array([row]), random_gaussians(2, 1))


def test_what_kernels_would_misread_is_an_error():
    frozen, learning = random_gaussians(10, 0), random_gaussians(2, 1)
    with pytest.raises(TypeError, match=r"rows .* int64 \[n\], got int32"):
        join_frozen(frozen, np.array([1], np.int32), learning)
    with pytest.raises(TypeError, match=r"rows .* contiguous"):
        join_frozen(frozen, np.arange(6)[::2], learning)
    with pytest.raises(TypeError, match=r"frozen must be float32 .* got torch\.float64"):
        join_frozen(Gaussians(*(tensor.double() for tensor in frozen.tensors())), np.array([1]), learning)
    with pytest.raises(TypeError, match="frozen must be contiguous"):
        join_frozen(random_gaussians(20, 0)[slice(None, None, 2)], np.array([1]), learning)
