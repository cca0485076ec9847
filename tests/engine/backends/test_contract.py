"""What every back end does, whichever it is: each operation against plain torch in float64, value and gradient.

A back end is under test by its line in the table. The last line here is that of a third one, which these tests alone
know: a folder and a line are all that it takes.
"""

from __future__ import annotations

from typing import Any

import pytest
import torch

from app.lab.synthetic.gaussian_scenes import layered_scene
from engine.backends.backend import Backend
from engine.backends.reference.backend import ReferenceBackend
from engine.backends.table import BACKENDS, BackendEntry, backend_called
from engine.model.decoding import ChosenAnchors, decode_anchors
from engine.model.joining import join_frozen
from engine.raster import Gaussians, rasterize, tile_boxes
from engine.training.step.losses import photometric_loss
from tests.decode_scenes import ODD, Scene, backward, moment

EXACT = ReferenceBackend(dtype=torch.float64)
TABLE = {
    **BACKENDS,
    "counting": BackendEntry("tests.engine.backends.counting.backend:CountingBackend", "counts its calls"),
}
ROUNDING = 1e-4
"""Of values and gradients relative to their largest: float32 sums of some hundred terms, an exponential between."""


@pytest.fixture(params=TABLE)
def backend(request, monkeypatch) -> Backend:
    """Every back end of the table, and the one of these tests."""
    monkeypatch.setitem(BACKENDS, request.param, TABLE[request.param])
    return backend_called(request.param)


def made_for(backend: Backend, tensor: torch.Tensor) -> torch.Tensor:
    """A leaf that learns, on the back end's device and of its dtype."""
    return tensor.detach().to(backend.device, backend.dtype).clone().requires_grad_()


def leaves(backend: Backend, gaussians: Gaussians) -> Gaussians:
    return Gaussians(*(made_for(backend, tensor) for tensor in gaussians.tensors()))


def assert_close(found: torch.Tensor | None, expected: torch.Tensor | None, tolerance: float = ROUNDING) -> None:
    assert found is not None
    assert expected is not None
    assert found.shape == expected.shape
    error = (found.detach().double().cpu() - expected.detach().double()).norm()
    assert error <= tolerance * max(float(expected.detach().norm()), 1e-6)


def test_a_back_end_has_a_name_a_device_and_a_dtype(backend):
    assert backend.name in TABLE
    assert torch.zeros(1, device=backend.device, dtype=backend.dtype).is_floating_point()


@pytest.mark.parametrize("has_mask", [False, True])
def test_rasterize(backend, has_mask):
    scene = layered_scene(40, 70, 40, 3.0)
    mask = torch.tensor([[True, False, True], [False, True, True]]) if has_mask else None
    upstream = torch.randn(1, 40, 70, 3, generator=torch.Generator().manual_seed(0))
    found = []
    for path in (backend, EXACT):
        gaussians = leaves(path, scene.gaussians)
        rendering = rasterize(gaussians, *scene.arguments, backend=path, tile_mask=mask)
        rendering.image.backward(upstream.to(rendering.image))
        found.append([rendering.image, rendering.alpha, *(tensor.grad for tensor in gaussians.tensors())])
    for ours, truth in zip(*found, strict=True):
        assert_close(ours, truth)


def test_tile_boxes(backend):
    scene = layered_scene(60, 150, 90, 5.0)
    viewmats, Ks, width, height = scene.arguments
    boxes, truth = (
        tile_boxes(leaves(path, scene.gaussians), viewmats[0], Ks[0], width, height, backend=path)
        for path in (backend, EXACT)
    )
    wanted = torch.rand(truth.shape, generator=torch.Generator().manual_seed(0)) < 0.2
    rows = torch.arange(100, 160)
    found = boxes.meeting(wanted.to(backend.device), rows.to(backend.device))
    assert 0 < len(found) < 60
    assert found.cpu().tolist() == truth.meeting(wanted, rows).tolist()
    assert boxes.drawn().cpu().tolist() == truth.drawn().tolist()
    assert torch.equal(boxes.mask().cpu(), truth.mask())
    some = boxes[boxes.drawn()[:3]]
    assert some.mask().any()
    assert not (some.mask() & ~boxes.mask()).any()


@pytest.mark.parametrize("knots", [[(1, 1.0)], [(1, 0.3), (2, 0.7)]], ids=["one knot", "two knots"])
def test_decode(backend, knots):
    scenes = [Scene(**ODD) for _ in range(2)]
    rows = scenes[0].rows()
    found = []
    for path, scene in zip((backend, EXACT), scenes, strict=True):
        for module in scene.modules():
            module.to(path.device, path.dtype)
        chosen = [
            ChosenAnchors(
                anchors,
                rows[role].to(path.device),
                scene.field.corners(anchors.positions) if anchors.is_dynamic else None,
                moved=anchors.positions_at(moment(knots)) if anchors.travels else None,
            )
            for role, anchors in scene.sets.items()
        ]
        gaussians = decode_anchors(chosen, scene.decoder, scene.field, knots, backend=path)
        backward(gaussians)
        found.append([*gaussians.tensors(), *(parameter.grad for parameter in scene.parameters().values())])
    for ours, truth in zip(*found, strict=True):
        if truth is not None:
            assert_close(ours, truth)


@pytest.mark.parametrize("rows", [[], [4], [0, 1, 2, 7, 9, 8, 3]])
@pytest.mark.parametrize("n_learning", [0, 3, 5000])
def test_join(backend, rows, n_learning):
    generator = torch.Generator().manual_seed(0)

    def some(n: int) -> Gaussians:
        columns = (torch.rand(n, *width, generator=generator) for width in ((3,), (4,), (3,), (), (3,)))
        return Gaussians(*(tensor.to(backend.device, backend.dtype) for tensor in columns))

    frozen, learning = some(10), leaves(backend, some(n_learning))
    chosen = torch.tensor(rows, dtype=torch.int64, device=backend.device)
    joined = join_frozen(frozen, chosen, learning, backend=backend)
    expected = Gaussians.concatenate([frozen[chosen], learning])
    assert all(torch.equal(a, b) for a, b in zip(joined.tensors(), expected.tensors(), strict=True))
    assert joined.frozen_rows().tolist() == [True] * len(rows) + [False] * n_learning
    weights = [torch.rand(tensor.shape, generator=generator).to(tensor) for tensor in joined.tensors()]
    sums = [(tensor * weight).sum() for tensor, weight in zip(joined.tensors(), weights, strict=True)]
    torch.stack(sums).sum().backward()
    for tensor, weight in zip(learning.tensors(), weights, strict=True):
        assert tensor.grad is not None
        assert torch.equal(tensor.grad, weight[len(rows) :])


@pytest.mark.parametrize("options", ["plain", "gain", "counted", "tiles", "tiles and rest"])
def test_photometric_loss(backend, options):
    generator = torch.Generator().manual_seed(0)

    def random(*size: int) -> torch.Tensor:
        return torch.rand(*size, generator=generator)

    truth = torch.randint(0, 256, (50, 70, 3), generator=generator, dtype=torch.uint8)
    start, rest, gain = random(50, 70, 3), random(50, 70, 3), torch.tensor([0.9, 1.0, 1.1])
    masks: dict[str, Any] = {
        "counted": {"is_counted": random(50, 70) < 0.7},
        "tiles": {"tile_mask": random(2, 3) < 0.5},
    }
    masks["tiles and rest"] = masks["tiles"]
    found = []
    for path in (backend, EXACT):
        image, factors = made_for(path, start), made_for(path, gain)
        given = {name: mask.to(path.device) for name, mask in masks.get(options, {}).items()}
        if options == "tiles and rest":
            given["rest"] = rest.to(image)
        result = photometric_loss(
            image,
            truth.to(path.device),
            backend=path,
            ssim_weight=0.2,
            gain=factors if options == "gain" else None,
            **given,
        )
        result.loss.backward()
        assert options != "gain" or factors.grad is not None
        found.append([result.loss, result.mean_square, image.grad, factors.grad])
    if options == "tiles and rest":  # values differ by what depends on the rest alone
        found = [found[0][2:3], found[1][2:3]]
    for ours, expected in zip(*found, strict=True):
        if expected is not None:
            assert_close(ours, expected)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (32, 64), (70, 45)])
def test_tile_squares(backend, height, width):
    generator = torch.Generator().manual_seed(0)
    image = torch.rand(height, width, 3, generator=generator)
    truth = torch.randint(0, 256, (height, width, 3), generator=generator, dtype=torch.uint8)
    gain = torch.tensor([0.9, 1.0, 1.1])
    squares = (image.double() * gain.double() - truth.double() / 255) ** 2
    expected = [[squares[y : y + 32, x : x + 32].sum() for x in range(0, width, 32)] for y in range(0, height, 32)]
    found = backend.tile_squares(*(made_for(backend, t).detach() if t.is_floating_point() else t.to(backend.device)
                                   for t in (image, truth, gain)))  # fmt: skip
    assert found.dtype == torch.float64
    assert_close(found, torch.tensor(expected, dtype=torch.float64), 1e-5)


@pytest.mark.parametrize("n", [0, 1, 500])
def test_volume_sum(backend, n):
    scales = 0.1 * torch.rand(n, 3, generator=torch.Generator().manual_seed(0))
    found = []
    for path in (backend, EXACT):
        leaf = made_for(path, scales)
        total = path.volume_sum(leaf, 0.02)
        (0.5 * total).backward()
        found.append([total, leaf.grad])
    for ours, truth in zip(*found, strict=True):
        assert_close(ours, truth, 1e-5)


def test_adam(backend):
    generator = torch.Generator().manual_seed(0)
    start = {"wide": torch.randn(300, 70, generator=generator), "rare": torch.randn(130, generator=generator)}
    steps = [{name: torch.randn(value.shape, generator=generator) for name, value in start.items()} for _ in range(6)]
    steps[2] = {"wide": steps[2]["wide"]}  # a parameter without a gradient is left alone
    steps[4]["rare"][:] = 0.0  # one with a gradient of zero goes on moving
    found = []
    for path in (backend, EXACT):
        parameters = {name: made_for(path, value).detach() for name, value in start.items()}
        adam = path.adam(parameters)
        for index, gradients in enumerate(steps):
            given = {name: value.to(path.device, path.dtype) for name, value in gradients.items()}
            rates, max_norm = {"wide": 0.01, "rare": 0.1}, 30.0 if index == 1 else 0.0
            norm = adam.step(
                given, rates, max_norm=max_norm, is_sound=torch.ones((), dtype=torch.bool, device=path.device)
            )
            expected = float(torch.cat([g.flatten() for g in gradients.values()]).norm())
            assert norm.item() == pytest.approx(expected, rel=1e-5)
            if index == 3:  # as a checkpoint does
                state = adam.state()
                adam = path.adam(parameters)
                for name, values in state.items():
                    adam.restore(name, {key: torch.atleast_1d(value) for key, value in values.items()})
        state = adam.state()
        assert state["rare"]["step"] == 5
        found.append([*parameters.values(), state["wide"]["exp_avg"], state["rare"]["exp_avg_sq"]])
    for ours, truth in zip(*found, strict=True):
        assert_close(ours, truth, 1e-5)


def test_adam_of_nothing(backend):
    adam = backend.adam({})
    is_sound = torch.ones((), dtype=torch.bool, device=backend.device)
    assert adam.step({}, {}, max_norm=1.0, is_sound=is_sound).item() == 0.0
    assert adam.state() == {}


@pytest.mark.parametrize("value", [1.0, float("nan"), float("inf")])
def test_a_step_of_adam_that_is_not_sound_changes_nothing(backend, value):
    parameters = {"wide": torch.ones(300, device=backend.device, dtype=backend.dtype)}
    adam = backend.adam(parameters)
    sound = torch.ones((), dtype=torch.bool, device=backend.device)
    adam.step({"wide": 0.5 * torch.ones_like(parameters["wide"])}, {"wide": 0.1}, max_norm=0.0, is_sound=sound)
    before = parameters["wide"].clone(), adam.state()["wide"], dict(adam.steps)
    gradient = torch.ones_like(parameters["wide"])
    gradient[7] = value
    norm = adam.step({"wide": gradient}, {"wide": 0.1}, max_norm=2.0, is_sound=sound & (value != 1.0))
    assert norm.isfinite() == (value == 1.0)
    assert adam.steps["wide"] == before[2]["wide"] + 1
    adam.steps = before[2]
    assert torch.equal(parameters["wide"], before[0])
    assert all(torch.equal(kept, before[1][name]) for name, kept in adam.state()["wide"].items())
