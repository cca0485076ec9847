"""Tile masks: only what was asked for is rendered and differentiated, and that is the same as without a mask."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from app.lab.synthetic.gaussian_scenes import GaussianScene, layered_scene
from engine.backends.table import backend_called
from engine.raster import TILE_PX, Gaussians, Rendering, rasterize
from tests.engine.raster.gradients import gradient, gradients

BACKENDS = ("cpu", "reference")


def pixels_of(mask: torch.Tensor, scene: GaussianScene) -> torch.Tensor:
    """[rows, columns] tiles as [H, W] pixels."""
    pixels = mask.repeat_interleave(TILE_PX, 0).repeat_interleave(TILE_PX, 1)
    return pixels[: scene.height, : scene.width]


def outcome(
    scene: GaussianScene, backend: str, weights: torch.Tensor, dtype: torch.dtype = torch.float32, **options: Any
) -> tuple[Rendering, list[torch.Tensor]]:
    """The rendering, and the gradients of five parameters, 2D centres and background under weights [C, H, W, 4]."""
    gaussians = Gaussians(
        *(tensor.to(dtype).clone().requires_grad_() for tensor in scene.gaussians.tensors()),
        is_frozen=scene.gaussians.is_frozen,
    )
    background = scene.background.to(dtype).clone().requires_grad_()
    rendering = rasterize(
        gaussians,
        *scene.arguments,
        background=background,
        backend=backend_called(backend),
        want_means2d=True,
        **options,
    )
    weights = weights.to(dtype)
    ((rendering.image * weights[..., :3]).sum() + (rendering.alpha * weights[..., 3:]).sum()).backward()
    return rendering, [*gradients(gaussians), gradient(rendering.means2d), gradient(background)]


def weights_of(scene: GaussianScene) -> torch.Tensor:
    return torch.randn(len(scene.Ks), scene.height, scene.width, 4, generator=torch.Generator().manual_seed(1))


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("frozen", [False, True])
def test_wanted_tiles_are_the_same_and_others_do_not_count(backend, frozen):
    scene = layered_scene(150, 100, 70, 5.0)
    if frozen:
        is_frozen = torch.arange(150) % 2 == 0
        scene = dataclasses.replace(scene, gaussians=dataclasses.replace(scene.gaussians, is_frozen=is_frozen))
    mask = torch.tensor([[True, False, True, False], [False, True, False, True], [False, False, True, True]])
    pixels = pixels_of(mask, scene)
    weights = weights_of(scene)
    full, _ = outcome(scene, backend, weights)
    _, expected = outcome(scene, backend, weights * pixels[..., None])  # no gradient from the pixels of other tiles
    part, grads = outcome(scene, backend, weights, tile_mask=mask)
    assert torch.equal(part.image[0, pixels], full.image[0, pixels])
    assert torch.equal(part.alpha[0, pixels], full.alpha[0, pixels])
    assert torch.equal(part.image[0, ~pixels], scene.background.float().expand(int((~pixels).sum()), 3))
    assert not part.alpha[0, ~pixels].any()
    assert full.means2d is not None
    assert part.means2d is not None
    assert torch.equal(full.means2d, part.means2d), "where a centre lies does not depend on the mask"
    for want, got in zip(expected, grads, strict=True):
        torch.testing.assert_close(got, want, rtol=1e-5, atol=1e-6 * float(want.abs().max()))


@pytest.mark.slow
def test_back_ends_agree_with_one_mask_per_camera():
    scene = layered_scene(120, 75, 90, 5.0)
    scene = dataclasses.replace(scene, viewmats=scene.viewmats.repeat(2, 1, 1), Ks=scene.Ks.repeat(2, 1, 1))
    scene.viewmats[1, 0, 3] += 0.2
    masks = torch.rand(2, 3, 3, generator=torch.Generator().manual_seed(4)) < 0.5
    weights = weights_of(scene)
    exact, expected = outcome(scene, "reference", weights, torch.float64, tile_mask=masks)
    fast, grads = outcome(scene, "cpu", weights, tile_mask=masks)
    assert (fast.image - exact.image).abs().max() <= 2e-6
    assert (fast.alpha - exact.alpha).abs().max() <= 2e-6
    for want, got in zip(expected, grads, strict=True):
        assert (got - want).norm() <= 1e-5 * want.norm()


@pytest.mark.parametrize("backend", BACKENDS)
def test_no_tile_at_all(backend):
    scene = layered_scene(30, 40, 40, 5.0)
    rendering, grads = outcome(scene, backend, weights_of(scene), tile_mask=torch.zeros(2, 2).bool())
    assert torch.equal(rendering.image, scene.background.float().expand(1, 40, 40, 3))
    assert not rendering.alpha.any()
    assert not any(grad.any() for grad in grads)


@settings(max_examples=20, deadline=None)
@given(
    n_rows=st.integers(0, 60),
    size=st.floats(0.3, 30.0),
    seed=st.integers(0, 10_000),
    tiles=st.lists(st.booleans(), min_size=6, max_size=6),
)
def test_wanted_tiles_are_bit_for_bit_those_of_the_full_image(n_rows, size, seed, tiles):
    scene = layered_scene(n_rows, 90, 47, size, seed=seed)
    mask = torch.tensor(tiles).view(2, 3)
    gaussians = Gaussians(*(tensor.float() for tensor in scene.gaussians.tensors()))
    full = rasterize(gaussians, *scene.arguments, want_depth=True, backend=backend_called("cpu"))
    part = rasterize(gaussians, *scene.arguments, want_depth=True, tile_mask=mask, backend=backend_called("cpu"))
    pixels = pixels_of(mask, scene)
    assert part.depth is not None
    assert full.depth is not None
    for want, got in ((full.image, part.image), (full.alpha, part.alpha), (full.depth, part.depth)):
        assert torch.equal(got[0, pixels], want[0, pixels])
        assert not got[0, ~pixels].any()


@pytest.mark.parametrize(
    ("mask", "error", "message"),
    [
        (torch.zeros(3, 2).bool(), ValueError, r"tile_mask .*\[2, 3\].*\[3, 2\]"),
        (torch.zeros(2, 2, 3).bool(), ValueError, r"tile_mask .*\[1, 2, 3\].*\[2, 2, 3\]"),
        (torch.zeros(2, 3), TypeError, r"tile_mask .*float32"),
    ],
)
def test_a_wrong_mask_is_named(mask, error, message):
    scene = layered_scene(6, 80, 50, 2.0)
    with pytest.raises(error, match=message):
        rasterize(scene.gaussians, *scene.arguments, tile_mask=mask, backend=backend_called("cpu"))
