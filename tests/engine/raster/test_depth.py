"""Depth: sum of weights times camera z, and that divided by alpha; both back ends, forward and gradient."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from app.lab.synthetic.gaussian_scenes import GaussianScene, gaussians_of, layered_scene, simple_scene
from engine.backends.cpu.raster import rasterize as cpu_backend
from engine.backends.table import backend_called
from engine.raster import Gaussians, Rendering, rasterize
from tests.engine.raster.gradients import gradients

BACKENDS = ("cpu", "reference")


def maps_of(rendering: Rendering) -> tuple[torch.Tensor, torch.Tensor]:
    assert rendering.depth is not None
    assert rendering.expected_depth is not None
    return rendering.depth, rendering.expected_depth


@pytest.mark.parametrize("backend", BACKENDS)
def test_two_walls(backend):
    walls = gaussians_of(np.array([[0.0, 0, 2], [0, 0, 5]]), np.full((2, 3), 1e3), opacities=np.array([0.25, 0.5]))
    walls = Gaussians(*(tensor.float() for tensor in walls.tensors()))
    scene = simple_scene(walls, width=10, height=8)
    depth, expected = maps_of(rasterize(walls, *scene.arguments, backend=backend_called(backend), want_depth=True))
    weights = (0.25, 0.75 * 0.5)
    want = weights[0] * 2 + weights[1] * 5
    assert depth.shape == (1, 8, 10, 1)
    torch.testing.assert_close(depth, torch.full_like(depth, want), rtol=1e-5, atol=0)
    torch.testing.assert_close(expected, torch.full_like(depth, want / sum(weights)), rtol=1e-5, atol=0)


@pytest.mark.parametrize("backend", BACKENDS)
def test_nothing_is_at_no_depth(backend):
    scene = layered_scene(1, 100, 80, 1.0)
    leaves = Gaussians(*(tensor.float().requires_grad_() for tensor in scene.gaussians.tensors()))
    rendering = rasterize(leaves, *scene.arguments, backend=backend_called(backend), want_depth=True)
    depth, expected = maps_of(rendering)
    is_empty = rendering.alpha == 0
    assert is_empty.any()
    assert not is_empty.all()
    assert not depth[is_empty].any()
    assert not expected[is_empty].any()
    expected.sum().backward()
    assert all(grad.isfinite().all() for grad in gradients(leaves))


def outcome(scene: GaussianScene, backend: str, dtype: torch.dtype) -> tuple[list[torch.Tensor], list[torch.Tensor]]:
    """Image, depth and expected depth, and the gradients under a loss of all three."""
    leaves = Gaussians(*(tensor.to(dtype).clone().requires_grad_() for tensor in scene.gaussians.tensors()))
    rendering = rasterize(leaves, *scene.arguments, backend=backend_called(backend), want_depth=True)
    pictures = [rendering.image, *maps_of(rendering)]
    generator = torch.Generator().manual_seed(3)
    loss = leaves.means.new_zeros(())
    for picture in pictures:
        loss = loss + (picture * torch.randn(picture.shape, generator=generator, dtype=torch.float64).to(dtype)).sum()
    loss.backward()
    return [picture.detach() for picture in pictures], gradients(leaves)


@pytest.mark.slow
def test_the_fast_back_end_matches_float64():
    scene = layered_scene(400, 80, 60, 4.0)
    exact, expected = outcome(scene, "reference", torch.float64)
    fast, grads = outcome(scene, "cpu", torch.float32)
    far = exact[2].max()
    for want, got, size in zip(exact, fast, (1.0, far, far), strict=True):
        assert (got - want).abs().max() <= 4e-6 * size
    for want, got in zip(expected, grads, strict=True):
        # depth / alpha: where alpha is near 1/255 its rounding is divided by its square
        assert (got - want).norm() <= 5e-5 * want.norm()


def test_several_cameras_and_no_gradient():
    scene = layered_scene(50, 64, 40, 4.0)
    gaussians = Gaussians(*(tensor.float() for tensor in scene.gaussians.tensors()))
    viewmats, Ks = scene.viewmats.repeat(2, 1, 1), scene.Ks.repeat(2, 1, 1)
    viewmats[1, 2, 3] += 1.0
    both = maps_of(rasterize(gaussians, viewmats, Ks, 64, 40, want_depth=True, backend=backend_called("cpu")))[0]
    for index in range(2):
        leaves = Gaussians(*(tensor.clone().requires_grad_() for tensor in gaussians.tensors()))
        one = rasterize(
            leaves,
            viewmats[index : index + 1],
            Ks[index : index + 1],
            64,
            40,
            want_depth=True,
            backend=backend_called("cpu"),
        )
        assert torch.equal(maps_of(one)[0][0], both[index])


def test_depth_is_made_only_when_asked_for_and_gives_its_buffers_back():
    scene = layered_scene(50, 64, 40, 4.0)
    pool = cpu_backend.POOL
    pool.clear()
    leaves = Gaussians(*(tensor.float().requires_grad_() for tensor in scene.gaussians.tensors()))
    plain = rasterize(leaves, *scene.arguments, backend=backend_called("cpu"))
    assert plain.depth is None
    assert plain.expected_depth is None
    del plain
    rendering = rasterize(leaves, *scene.arguments, want_depth=True, backend=backend_called("cpu"))
    assert len(pool) == 0, "the first workspace is in use again, by both maps"
    (rendering.image.sum() + maps_of(rendering)[0].sum()).backward()
    assert len(pool) == 1
