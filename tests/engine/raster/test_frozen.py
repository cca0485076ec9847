"""Frozen rows: drawn like any other, a gradient of zero, and the same gradients for everybody else."""

from __future__ import annotations

import dataclasses

import pytest
import torch

from app.lab.synthetic.gaussian_scenes import GaussianScene, layered_scene
from engine.backends.cpu.raster import blend_backward
from engine.backends.table import backend_called
from engine.raster import Gaussians, Rendering, rasterize
from tests.engine.raster.gradients import gradient, gradients

BACKENDS = ("cpu", "reference")


def outcome(scene: GaussianScene, is_frozen: torch.Tensor | None, backend: str) -> tuple[Rendering, list[torch.Tensor]]:
    """The rendering and the gradients of the five parameters and the 2D centres."""
    tensors = (tensor.float().requires_grad_() for tensor in scene.gaussians.tensors())
    gaussians = Gaussians(*tensors, is_frozen=is_frozen)
    rendering = rasterize(gaussians, *scene.arguments, backend=backend_called(backend), want_means2d=True)
    (rendering.image.square().sum() + rendering.alpha.cos().sum()).backward()
    return rendering, [*gradients(gaussians), gradient(rendering.means2d)[0]]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_frozen_rows_are_drawn_and_have_no_gradient(backend, share):
    scene = layered_scene(150, 70, 50, 4.0, faint=True)
    is_frozen = torch.rand(150, generator=torch.Generator().manual_seed(2)) < share
    free, free_grads = outcome(scene, None, backend)
    some, grads = outcome(scene, is_frozen, backend)
    assert torch.equal(free.image, some.image)
    assert torch.equal(free.alpha, some.alpha)
    for want, got in zip(free_grads, grads, strict=True):
        assert torch.equal(got[~is_frozen], want[~is_frozen]), "freezing a row changes the gradient of no other"
        assert not got[is_frozen].any()
        assert want[is_frozen].any() or not is_frozen.any(), "the scene must give these rows a gradient to lose"


def test_back_ends_agree_on_frozen_rows():
    scene = layered_scene(150, 70, 50, 4.0)
    is_frozen = torch.arange(150) % 3 == 0
    _, slow = outcome(scene, is_frozen, "reference")
    _, fast = outcome(scene, is_frozen, "cpu")
    for want, got in zip(slow, fast, strict=True):
        assert (got - want).norm() <= 1e-5 * want.norm()


def test_nothing_is_replayed_where_nothing_is_trained(monkeypatch):
    scene = layered_scene(30, 40, 40, 3.0)
    gaussians = Gaussians(*(tensor.float() for tensor in scene.gaussians.tensors()))
    background = torch.tensor([0.1, 0.2, 0.3], requires_grad=True)
    rendering = rasterize(gaussians, *scene.arguments, background=background, backend=backend_called("cpu"))
    frozen = dataclasses.replace(
        gaussians, means=gaussians.means.clone().requires_grad_(), is_frozen=torch.ones(30) > 0
    )
    frozen_rendering = rasterize(frozen, *scene.arguments, backend=backend_called("cpu"))
    monkeypatch.setattr(blend_backward, "replay_tiles", None)
    rendering.image.sum().backward()
    torch.testing.assert_close(gradient(background), (1 - rendering.alpha).sum().expand(3))
    frozen_rendering.image.sum().backward()
    assert not gradient(frozen.means).any()


def test_the_mask_follows_its_rows():
    scene = layered_scene(6, 16, 16, 2.0)
    free = scene.gaussians
    mask = torch.tensor([True, False, True, False, False, True])
    part = dataclasses.replace(free, is_frozen=mask)
    for chosen in (slice(1, 4), torch.tensor([5, 0]), mask):
        taken = part[chosen].is_frozen
        assert taken is not None
        assert torch.equal(taken, mask[chosen])
    assert part.detach().is_frozen is mask
    assert Gaussians.concatenate([free, free]).is_frozen is None
    joined = Gaussians.concatenate([free, part, free]).is_frozen
    assert joined is not None
    assert torch.equal(joined, torch.cat([torch.zeros(6).bool(), mask, torch.zeros(6).bool()]))


@pytest.mark.parametrize(
    ("mask", "error"),
    [(torch.zeros(5).bool(), ValueError), (torch.zeros(6, 1).bool(), ValueError), (torch.zeros(6), TypeError)],
)
def test_a_wrong_mask_is_named(mask, error):
    scene = layered_scene(6, 16, 16, 2.0)
    with pytest.raises(error, match="is_frozen"):
        rasterize(dataclasses.replace(scene.gaussians, is_frozen=mask), *scene.arguments, backend=backend_called("cpu"))
