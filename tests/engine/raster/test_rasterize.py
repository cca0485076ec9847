"""The public op: both back ends against float64 brute force, arguments, views, gradients, independence of calls."""

from __future__ import annotations

import dataclasses
import threading
from typing import Any

import numpy as np
import pytest
import torch

from app.lab.synthetic.gaussian_scenes import GaussianScene, camera, layered_scene, simple_scene
from engine.backends.cpu.raster import rasterize as cpu_backend
from engine.backends.table import backend_called
from engine.raster import Gaussians, Rendering, rasterize
from tests.engine.raster.gradients import gradient, gradients

BACKENDS = ("cpu", "reference")
NAMES = ("means", "quats", "scales", "opacities", "colors")
# The largest error of float32 against float64 as measured 2026-11, rounded up.
PIXEL_TOLERANCE = 2e-6
GRADIENT_TOLERANCE = 5e-6


def leaves(gaussians: Gaussians, dtype: torch.dtype) -> Gaussians:
    return Gaussians(*(tensor.detach().to(dtype).clone().requires_grad_() for tensor in gaussians.tensors()))


def render(scene: GaussianScene, gaussians: Gaussians, backend: str, **options: Any) -> Rendering:
    background = scene.background.to(gaussians.means)
    return rasterize(
        gaussians,
        *scene.arguments,
        background=background,
        near_plane=scene.near_plane,
        backend=backend_called(backend),
        **options,
    )


def loss_of(rendering: Rendering, seed: int = 5) -> torch.Tensor:
    """A fixed random linear function of image and alpha, so that every pixel's gradient counts."""
    generator = torch.Generator().manual_seed(seed)
    weights = [
        torch.randn(t.shape, generator=generator, dtype=torch.float64) for t in (rendering.image, rendering.alpha)
    ]
    return (rendering.image * weights[0].to(rendering.image)).sum() + (
        rendering.alpha * weights[1].to(rendering.alpha)
    ).sum()


def relative(actual: torch.Tensor, expected: torch.Tensor) -> float:
    return ((actual.double() - expected).norm() / expected.norm()).item()


@pytest.fixture(scope="module")
def truth() -> tuple[GaussianScene, Gaussians, Rendering]:
    """2000 Gaussians at 160x120 with float64 gradients."""
    scene = layered_scene(2000, 160, 120, 3.5)
    gaussians = leaves(scene.gaussians, torch.float64)
    rendering = render(scene, gaussians, "reference", want_means2d=True)
    loss_of(rendering).backward()
    return scene, gaussians, rendering


@pytest.mark.slow
def test_float32_matches_float64_forward_and_backward(truth):
    scene, exact, expected = truth
    gaussians = leaves(scene.gaussians, torch.float32)
    actual = render(scene, gaussians, "cpu", want_means2d=True)
    loss_of(actual).backward()
    assert (actual.image - expected.image).abs().max() <= PIXEL_TOLERANCE
    assert (actual.alpha - expected.alpha).abs().max() <= PIXEL_TOLERANCE
    for name in NAMES:
        error = relative(gradient(getattr(gaussians, name)), gradient(getattr(exact, name)))
        assert error <= GRADIENT_TOLERANCE, f"{name}: {error}"
    assert actual.means2d is not None
    assert expected.means2d is not None
    assert relative(actual.means2d.detach(), expected.means2d.detach()) <= 1e-6  # a few roundings of pixel positions
    assert relative(gradient(actual.means2d), gradient(expected.means2d)) <= GRADIENT_TOLERANCE


@pytest.mark.slow
def test_reference_gradients_match_finite_differences():
    scene = layered_scene(60, 40, 24, 3.0)
    gaussians = leaves(scene.gaussians, torch.float64)
    loss_of(render(scene, gaussians, "reference")).backward()
    step = 1e-6
    generator = torch.Generator().manual_seed(3)
    for name in NAMES:
        tensor = getattr(gaussians, name)
        for index in torch.randint(tensor.numel(), (4,), generator=generator).tolist():
            values = []
            for sign in (1, -1):
                moved = tensor.detach().clone()
                moved.view(-1)[index] += sign * step
                changed = dataclasses.replace(gaussians.detach(), **{name: moved})
                values.append(loss_of(render(scene, changed, "reference")).item())
            slope = (values[0] - values[1]) / (2 * step)
            # central differences: truncation and cancellation are both near 1e-8 here
            assert slope == pytest.approx(gradient(tensor).view(-1)[index].item(), rel=1e-5, abs=1e-5), (
                f"{name}[{index}]"
            )


@pytest.mark.slow
def test_cpu_gradients_match_finite_differences_of_the_reference(truth):
    scene, exact, _ = truth
    gaussians = leaves(scene.gaussians, torch.float32)
    loss_of(render(scene, gaussians, "cpu")).backward()
    for name in NAMES:
        a, b = gradient(getattr(gaussians, name)).double(), gradient(getattr(exact, name))
        worst = (a - b).abs().max() / b.abs().max()
        assert worst <= 1e-4, f"{name}: one entry is off by {worst} of the largest"


@pytest.mark.parametrize("backend", BACKENDS)
def test_background_shows_through_and_gets_its_gradient(backend):
    scene = layered_scene(40, 33, 17, 2.0)
    background = torch.tensor([0.3, 0.5, 0.9], requires_grad=True)
    gaussians = Gaussians(*(t.float() for t in scene.gaussians.tensors()))
    rendering = rasterize(gaussians, *scene.arguments, background=background, backend=backend_called(backend))
    black = rasterize(gaussians, *scene.arguments, backend=backend_called(backend))
    left_over = 1 - rendering.alpha
    torch.testing.assert_close(rendering.image, black.image + left_over * background, rtol=0, atol=1e-6)
    rendering.image.sum().backward()
    torch.testing.assert_close(gradient(background), left_over.detach().sum().expand(3), rtol=1e-5, atol=0)


@pytest.mark.parametrize("backend", BACKENDS)
def test_several_cameras_equal_single_ones_and_add_their_gradients(backend):
    scene = layered_scene(50, 48, 40, 3.0)
    moved = scene.viewmats.clone()
    moved[0, 0, 3] += 0.3
    viewmats, Ks = torch.cat([scene.viewmats, moved]), torch.cat([scene.Ks, camera(48, 40, focal=60.0)])
    together = leaves(scene.gaussians, torch.float32)
    both = rasterize(together, viewmats, Ks, 48, 40, backend=backend_called(backend), want_means2d=True)
    both.image.square().sum().backward()
    apart = leaves(scene.gaussians, torch.float32)
    for i in range(2):
        one = rasterize(
            apart, viewmats[i : i + 1], Ks[i : i + 1], 48, 40, backend=backend_called(backend), want_means2d=True
        )
        one.image.square().sum().backward()
        assert torch.equal(one.image[0], both.image[i])
        torch.testing.assert_close(gradient(one.means2d)[0], gradient(both.means2d)[i], rtol=1e-5, atol=1e-7)
    for name in NAMES:  # the two sums may be added in another order
        torch.testing.assert_close(
            gradient(getattr(together, name)), gradient(getattr(apart, name)), rtol=1e-4, atol=1e-5
        )


def test_runs_are_bit_identical_for_any_number_of_threads():
    import numba

    scene = layered_scene(400, 100, 70, 4.0)

    def outcome() -> list[torch.Tensor]:
        gaussians = leaves(scene.gaussians, torch.float32)
        rendering = render(scene, gaussians, "cpu", want_means2d=True)
        loss_of(rendering).backward()
        return [rendering.image, rendering.alpha, gradient(rendering.means2d), *gradients(gaussians)]

    first = outcome()
    n_threads = numba.get_num_threads()
    try:
        for n in (n_threads, 1):
            numba.set_num_threads(n)
            assert all(torch.equal(a, b) for a, b in zip(first, outcome(), strict=True)), f"{n} threads"
    finally:
        numba.set_num_threads(n_threads)


def test_interleaved_forwards_keep_their_own_state():
    scenes = [layered_scene(n, 64, 48, 3.0, seed=n) for n in (300, 120)]

    alone = []
    for scene in scenes:
        gaussians = leaves(scene.gaussians, torch.float32)
        loss_of(render(scene, gaussians, "cpu")).backward()
        alone.append(gradients(gaussians))
    both = [leaves(scene.gaussians, torch.float32) for scene in scenes]
    losses = [loss_of(render(scene, g, "cpu")) for scene, g in zip(scenes, both, strict=True)]
    with torch.no_grad():
        render(scenes[1], both[1], "cpu")
    for loss in losses:
        loss.backward(retain_graph=True)
    for expected, gaussians in zip(alone, both, strict=True):
        assert all(torch.equal(a, b) for a, b in zip(expected, gradients(gaussians), strict=True))
    losses[0].backward()  # the retained graph still holds its buffers: gradients double exactly
    assert all(torch.equal(2 * a, b) for a, b in zip(alone[0], gradients(both[0]), strict=True))
    with pytest.raises(RuntimeError, match="second time"):
        losses[0].backward()


def test_calls_from_two_threads_do_not_disturb_each_other():
    scenes = [layered_scene(n, 64, 48, 3.0, seed=n) for n in (200, 250)]

    def outcome(scene: GaussianScene) -> list[torch.Tensor]:
        gaussians = leaves(scene.gaussians, torch.float32)
        rendering = render(scene, gaussians, "cpu")
        loss_of(rendering).backward()
        return [rendering.image.detach(), *gradients(gaussians)]

    expected = [outcome(scene) for scene in scenes]
    wrong: list[int] = []

    def work(index: int) -> None:
        for _ in range(15):
            if not all(torch.equal(a, b) for a, b in zip(expected[index], outcome(scenes[index]), strict=True)):
                wrong.append(index)

    threads = [threading.Thread(target=work, args=(index,)) for index in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_buffers_come_back_when_nothing_needs_them():
    scene = layered_scene(100, 64, 48, 3.0)
    pool = cpu_backend.POOL
    pool.clear()
    gaussians = leaves(scene.gaussians, torch.float32)
    with torch.no_grad():
        render(scene, gaussians, "cpu")
    assert len(pool) == 1, "a rendering without autograd gives its buffers back at once"
    loss = loss_of(render(scene, gaussians, "cpu"))
    assert len(pool) == 0, "the graph holds them"
    loss.backward()
    assert len(pool) == 1, "the backward pass lets go of them although the loss is still referenced"
    unused = render(scene, gaussians, "cpu")
    assert len(pool) == 0
    del unused
    assert len(pool) == 1, "a graph that is thrown away lets go of them too"


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("size", [(1, 1), (31, 33), (64, 32), (5, 70)])
def test_any_image_size(backend, size):
    width, height = size
    scene = layered_scene(80, 96, 96, 6.0)
    scene = dataclasses.replace(
        scene, width=width, height=height, Ks=camera(width, height, focal=60.0, center=(width * 0.4, height * 0.7))
    )
    exact = leaves(scene.gaussians, torch.float64)
    expected = render(scene, exact, "reference")
    loss_of(expected).backward()
    gaussians = leaves(scene.gaussians, torch.float32)
    actual = render(scene, gaussians, backend)
    loss_of(actual).backward()
    assert actual.image.shape == (1, height, width, 3)
    assert actual.alpha.shape == (1, height, width, 1)
    assert (actual.image - expected.image).abs().max() <= PIXEL_TOLERANCE
    for name in NAMES:  # few pixels average fewer rounding errors
        assert relative(gradient(getattr(gaussians, name)), gradient(getattr(exact, name))) <= 2e-5, name


@pytest.mark.parametrize("backend", BACKENDS)
def test_no_gaussians_leave_the_background(backend):
    scene = simple_scene(Gaussians(*(torch.zeros(0, *s) for s in ((3,), (4,), (3,), (), (3,)))), width=20, height=10)
    gaussians = leaves(scene.gaussians, torch.float32)
    rendering = render(scene, gaussians, backend, want_means2d=True)
    loss_of(rendering).backward()
    torch.testing.assert_close(rendering.image, scene.background.float().expand(1, 10, 20, 3))
    assert not rendering.alpha.any()
    assert rendering.means2d is not None
    assert rendering.means2d.shape == (1, 0, 2)
    assert gradient(gaussians.means).shape == (0, 3)


def test_tensors_that_are_not_contiguous_are_accepted():
    scene = layered_scene(60, 40, 40, 3.0)
    plain = Gaussians(*(t.float() for t in scene.gaussians.tensors()))
    spread = Gaussians(*(torch.stack([t, t + 1], -1)[..., 0] for t in plain.tensors()))
    assert not spread.means.is_contiguous()
    assert torch.equal(render(scene, plain, "cpu").image, render(scene, spread, "cpu").image)


BAD_ARGUMENTS = {
    "means": (ValueError, {"means": torch.zeros(5, 2)}),
    "quats": (ValueError, {"quats": torch.zeros(4, 4)}),
    "scales": (ValueError, {"scales": torch.zeros(5)}),
    "opacities": (ValueError, {"opacities": torch.zeros(5, 1)}),
    "colors": (TypeError, {"colors": torch.zeros(5, 3, dtype=torch.float64)}),
    "viewmats": (ValueError, {"viewmats": torch.eye(4)}),
    "Ks": (ValueError, {"Ks": torch.eye(3)[None].repeat(2, 1, 1)}),
    r"Ks\[0\]": (ValueError, {"Ks": -torch.eye(3)[None]}),
    r"quats must be \[5, 4\] to match means \[5, 3\], got \[5, 3\]": (ValueError, {"quats": torch.zeros(5, 3)}),
    "opacities must hold numbers, got a tensor on device meta": (
        TypeError,
        {"opacities": torch.zeros(5, device="meta")},
    ),
    "means must be floating point": (TypeError, {"means": torch.zeros(5, 3, dtype=torch.int64)}),
    "means .* meta": (TypeError, {"means": torch.zeros(5, 3, device="meta")}),
    "viewmats .* meta": (TypeError, {"viewmats": torch.zeros(1, 4, 4, device="meta")}),
    "Ks .* meta": (TypeError, {"Ks": torch.zeros(1, 3, 3, device="meta")}),
    "background .* meta": (TypeError, {"background": torch.zeros(3, device="meta")}),
    r"Ks must be \[1, 3, 3\] to match viewmats \[1, 4, 4\], got \[2, 3, 3\]": (
        ValueError,
        {"Ks": torch.eye(3).repeat(2, 1, 1)},
    ),
    r"Ks\[0\] holds numbers that are not finite": (ValueError, {"Ks": torch.full((1, 3, 3), float("inf"))}),
    "height must be below 32768|width and height": (ValueError, {"height": 1 << 15}),
    r"viewmats\[0\]": (ValueError, {"viewmats": torch.full((1, 4, 4), float("nan"))}),
    "width": (ValueError, {"width": 0}),
    r"width must be a whole number, got 8.7": (TypeError, {"width": 8.7}),
    r"height must be a whole number, got '8'": (TypeError, {"height": "8"}),
    "near_plane must be a number, got 'a'": (TypeError, {"near_plane": "a"}),
    "near_plane must be a finite": (ValueError, {"near_plane": float("nan")}),
    "viewmats must be a torch tensor, got numpy.ndarray": (TypeError, {"viewmats": np.eye(4)[None]}),
    "Ks must be a torch tensor, got builtins.list": (TypeError, {"Ks": np.eye(3)[None].tolist()}),
    "means must be a torch tensor": (TypeError, {"means": np.zeros((5, 3), np.float32)}),
    "colors must be a torch tensor": (TypeError, {"colors": np.zeros((5, 3), np.float32)}),
    "background must be a torch tensor": (TypeError, {"background": (0.0, 0.0, 0.0)}),
    "background must be finite": (ValueError, {"background": torch.tensor([0.0, float("nan"), 0.0])}),
    "tile_mask .* meta": (TypeError, {"tile_mask": torch.ones(1, 1, dtype=torch.bool, device="meta")}),
    "tile_mask must be a torch tensor": (TypeError, {"tile_mask": np.ones((1, 1), bool)}),
    r"viewmats\[0\] must be a rotation .* got\n\[\[0": (ValueError, {"viewmats": torch.zeros(1, 4, 4)}),
    "bottom row 0 0 0 1": (ValueError, {"viewmats": torch.ones(1, 4, 4)}),
    r"viewmats\[1\] must be a rotation": (
        ValueError,
        {
            "viewmats": torch.stack([torch.eye(4), torch.diag(torch.tensor([1.0, 1.0, 0.0, 1.0]))]),
            "Ks": torch.eye(3).repeat(2, 1, 1),
        },
    ),
    "background": (ValueError, {"background": torch.zeros(4)}),
    "near_plane": (ValueError, {"near_plane": 0.0}),
}


@pytest.mark.parametrize("name", BAD_ARGUMENTS)
def test_a_wrong_argument_is_named(name):
    error, changes = BAD_ARGUMENTS[name]
    shapes = {"means": (5, 3), "quats": (5, 4), "scales": (5, 3), "opacities": (5,), "colors": (5, 3)}
    values = {key: torch.ones(shape) for key, shape in shapes.items()}
    values |= {"viewmats": torch.eye(4)[None], "Ks": torch.eye(3)[None], "width": 8, "height": 8} | changes
    gaussians = Gaussians(*(values.pop(key) for key in shapes))
    with pytest.raises(error, match=name):
        rasterize(gaussians, **values, backend=backend_called("cpu"))


def test_whole_numbers_of_any_kind_are_sizes():
    scene = layered_scene(5, 16, 12, 2.0)
    expected = rasterize(scene.gaussians, scene.viewmats, scene.Ks, 16, 12, backend=backend_called("reference")).image
    sizes: dict[str, Any] = {"width": np.int64(16), "height": np.int32(12), "near_plane": np.float32(0.01)}
    assert torch.equal(
        rasterize(scene.gaussians, scene.viewmats, scene.Ks, **sizes, backend=backend_called("reference")).image,
        expected,
    )


def test_cpu_refuses_float64():
    scene = layered_scene(5, 16, 16, 2.0)
    with pytest.raises(TypeError, match="float32"):
        render(scene, scene.gaussians, "cpu")
