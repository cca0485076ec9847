"""Decode: every back end against plain torch in float64, forward and gradient, hard values included."""

import dataclasses
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import torch
from numba import cfunc, get_num_threads, set_num_threads, types

from engine.backends.cpu.decode import activation
from engine.backends.cpu.decode.warm import warm_up
from engine.backends.table import backend_called
from engine.kernels import routines
from engine.kernels.memory import RecycledMemory
from engine.model.decoding import ChosenAnchors, decode_anchors
from engine.raster.gaussians import Gaussians
from tests.decode_scenes import ODD, PAPER, PRESET, SINGLE, Scene, backward


def assert_close(scene: Scene, ours: Gaussians, truth_scene: Scene, truth: Gaussians, tolerance: float) -> None:
    for a, b in zip(ours.tensors(), truth.tensors(), strict=True):
        assert a.shape == b.shape
        if b.numel():
            assert (a - b).abs().max() <= tolerance * max(1.0, b.abs().max().item())
    for (name, a), b in zip(scene.parameters().items(), truth_scene.parameters().values(), strict=True):
        assert (a.grad is None) == (b.grad is None), name
        if a.grad is not None and b.grad is not None:
            assert torch.isfinite(a.grad).all(), name
            # 0.3: a bias may be one number, the small difference of many terms of size 1
            assert (a.grad - b.grad).norm() <= tolerance * max(float(b.grad.norm()), 0.3), name


ONE_KNOT, TWO_KNOTS = [(1, 1.0)], [(1, 0.3), (2, 0.7)]


@pytest.mark.parametrize("sizes", [PRESET, ODD, PAPER, SINGLE], ids=["preset", "odd", "paper", "single"])
@pytest.mark.parametrize("knots", [ONE_KNOT, TWO_KNOTS], ids=["one knot", "two knots"])
@pytest.mark.parametrize("frozen", [(), ("decoder", "static", "moving"), ("field",), ("decoder", "field")])
def test_cpu_matches_float64_reference(sizes, knots, frozen):
    scene = Scene(**sizes)
    for name, parameter in scene.parameters().items():
        parameter.requires_grad_(not name.startswith(frozen) if frozen else True)
    twin = scene.double()
    rows = scene.rows()
    ours, truth = scene.decode(rows, knots, "cpu"), twin.decode(rows, knots, "reference")
    backward(ours)
    backward(truth)
    # float32 sums of up to 128 products, three layers deep; worst seen 4e-7 forward and 1.4e-6 in gradients
    assert_close(scene, ours, twin, truth, 3e-6)


@pytest.mark.parametrize("n", [0, 1, 2, 17, 63, 64, 65, 200])
def test_any_number_of_anchors(n):
    scene = Scene(**ODD, n=n)
    twin, rows = scene.double(), {role: torch.arange(len(anchors)) for role, anchors in scene.sets.items()}
    ours, truth = scene.decode(rows, TWO_KNOTS, "cpu"), twin.decode(rows, TWO_KNOTS, "reference")
    assert len(ours) == len(truth) == 5 * sum(len(anchors) for anchors in scene.sets.values())
    backward(ours)
    backward(truth)
    for named in (scene.parameters(), twin.parameters()):
        for parameter in named.values():  # a set without rows has no gradient in one and zeros in the other
            if parameter.grad is None:
                parameter.grad = torch.zeros_like(parameter)
    assert_close(scene, ours, twin, truth, 3e-6)


@pytest.mark.parametrize("knots", [ONE_KNOT, TWO_KNOTS], ids=["one knot", "two knots"])
@pytest.mark.parametrize(("channels", "is_shared"), [(1, False), (2, False), (5, True), (4, True)])
def test_any_number_of_channels_and_a_table_for_all_knots(channels, is_shared, knots):
    scene = Scene(**ODD, channels=channels, is_shared=is_shared)
    twin, rows = scene.double(), scene.rows()
    ours, truth = scene.decode(rows, knots, "cpu"), twin.decode(rows, knots, "reference")
    backward(ours)
    backward(truth)
    assert_close(scene, ours, twin, truth, 3e-6)


@pytest.mark.parametrize("frozen", [(), ("decoder", "static", "moving")], ids=["all learn", "a source clip"])
def test_a_field_that_ends_in_a_relu(frozen):
    scene = Scene(**ODD, is_rectified=True)
    for name, parameter in scene.parameters().items():
        parameter.requires_grad_(not name.startswith(frozen) if frozen else True)
    twin, rows = scene.double(), scene.rows()
    ours, truth = scene.decode(rows, TWO_KNOTS, "cpu"), twin.decode(rows, TWO_KNOTS, "reference")
    plain = Scene(**ODD).decode(rows, TWO_KNOTS, "cpu")
    assert not torch.allclose(ours.means, plain.means), "some of its outputs are below zero"
    backward(ours)
    backward(truth)
    assert_close(scene, ours, twin, truth, 3e-6)


@pytest.mark.parametrize("roles", [("moving",), ("static", "moving", "residual")])
def test_positions_learn_where_they_may(roles):
    scene = Scene(**ODD)
    for role in roles:
        scene.sets[role].learn_positions()
    twin, rows = scene.double(), scene.rows()
    before = Scene(**ODD).decode(rows, ONE_KNOT, "cpu")
    ours, truth = scene.decode(rows, ONE_KNOT, "cpu"), twin.decode(rows, ONE_KNOT, "reference")
    assert torch.equal(ours.means, before.means), "the same values, with a way back"
    backward(ours)
    backward(truth)
    assert_close(scene, ours, twin, truth, 3e-6)
    assert {role for role, anchors in scene.sets.items() if anchors.positions.grad is not None} == set(roles)


def test_reference_gradients_are_finite_differences():
    scene = Scene(features=3, hidden=5, k=2, n=4).double()
    rows = {role: torch.arange(len(anchors)) for role, anchors in scene.sets.items()}
    backward(scene.decode(rows, TWO_KNOTS, "reference"))
    generator = torch.Generator().manual_seed(9)
    weights = [torch.randn(t.shape, generator=generator).double() for t in
               scene.decode(rows, TWO_KNOTS, "reference").tensors()]  # fmt: skip

    def total() -> float:
        with torch.no_grad():
            columns = scene.decode(rows, TWO_KNOTS, "reference").tensors()
            return float(sum((t * w).sum() for t, w in zip(columns, weights, strict=True)))

    step = 1e-6
    for name, parameter in scene.parameters().items():
        if parameter.grad is None or not parameter.grad.any():
            continue
        place = int(parameter.grad.abs().argmax())
        values = parameter.data.view(-1)
        start = float(values[place])
        values[place] = start + step
        above = total()
        values[place] = start - step
        below = total()
        values[place] = start
        # the error of a central difference is of the order of the step squared and of rounding over the step
        assert (above - below) / (2 * step) == pytest.approx(float(parameter.grad.view(-1)[place]), rel=1e-5), name


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 1e30, -1e30])
def test_what_is_wrong_with_one_anchor_stays_with_it(bad):
    scene, clean = Scene(**PRESET), Scene(**PRESET)
    with torch.no_grad():
        scene.sets["moving"].features[7] = bad
        scene.sets["moving"].log_base_scales[8] = bad
    rows = {role: torch.arange(len(anchors)) for role, anchors in scene.sets.items()}
    dirty, good = (s.decode(rows, ONE_KNOT, "cpu").detach() for s in (scene, clean))
    k, first = PRESET["k"], len(scene.sets["static"])
    is_other = torch.ones(len(good), dtype=torch.bool)
    is_other[(first + 7) * k : (first + 9) * k] = False
    for a, b in zip(dirty.tensors(), good.tensors(), strict=True):
        assert torch.equal(a[is_other], b[is_other])
    if bad != bad:  # a NaN must be seen, not turned into something that looks right
        assert torch.isnan(dirty.colors[(first + 7) * k : (first + 8) * k]).all()
        assert torch.isnan(dirty.scales[(first + 8) * k : (first + 9) * k]).all()


def test_huge_values_saturate_and_gradients_stay_finite():
    scene = Scene(**ODD, spread=1e4)
    twin, rows = scene.double(), scene.rows()
    ours, truth = scene.decode(rows, ONE_KNOT, "cpu"), twin.decode(rows, ONE_KNOT, "reference")
    for a, b in zip(ours.tensors(), truth.tensors(), strict=True):
        # raw outputs of thousands, in float32: sigmoids near their middle see the rounding of their argument
        assert (a - b).abs().max() <= 1e-3 * max(1.0, b.abs().max().item())
    backward(ours)
    assert all(torch.isfinite(p.grad).all() for p in scene.parameters().values() if p.grad is not None)


def test_same_bits_for_any_number_of_threads():
    results = []
    n_threads = get_num_threads()
    try:
        for n in (1, n_threads, n_threads):
            set_num_threads(n)
            scene = Scene(**PRESET, n=1500)
            gaussians = scene.decode(scene.rows(), TWO_KNOTS, "cpu")
            backward(gaussians)
            gradients = [p.grad for p in scene.parameters().values() if p.grad is not None]
            results.append([*gaussians.detach().tensors(), *gradients])
    finally:
        set_num_threads(n_threads)
    for first, second in pairwise(results):
        assert all(torch.equal(a, b) for a, b in zip(first, second, strict=True))


def test_entries_that_no_corner_touches_have_no_gradient():
    scene = Scene(**PRESET, n=4)
    twin, rows = scene.double(), {role: torch.arange(len(a)) for role, a in scene.sets.items()}
    for _ in range(3):  # memory of the gradient is used again
        for parameter in scene.parameters().values():
            parameter.grad = None
        backward(scene.decode(rows, ONE_KNOT, "cpu"))
    backward(twin.decode(rows, ONE_KNOT, "reference"))
    ours, truth = scene.field.tables[1].grad, twin.field.tables[1].grad
    assert ours is not None
    assert truth is not None
    is_touched = truth.abs().sum(-1) > 0
    assert 0 < is_touched.float().mean() < 1
    assert not ours[~is_touched].any()
    assert scene.field.tables[0].grad is None


def test_sets_that_never_change_are_copied_and_frozen():
    scene = Scene(**ODD)
    scene.decoder.requires_grad_(False)
    scene.sets["static"].requires_grad_(False)
    everything = ChosenAnchors(anchors=scene.sets["static"], rows=torch.arange(len(scene.sets["static"])))
    decoded = decode_anchors([everything], scene.decoder, None, [(0, 1.0)], backend=backend_called("cpu"))
    assert not decoded.means.requires_grad
    assert decoded.is_frozen is None
    rows = scene.rows()
    rows["static"] = rows["static"].flip(0)  # any order
    plain = scene.decode(rows, ONE_KNOT, "cpu")
    for backend in ("cpu", "reference"):
        copied = scene.decode(rows, ONE_KNOT, backend, decoded)
        assert copied.is_frozen is not None
        assert copied.is_frozen.sum() == 5 * len(rows["static"])
        assert copied.is_frozen[: 5 * len(rows["static"])].all()
        for a, b in zip(copied.tensors(), plain.tensors(), strict=True):
            assert torch.allclose(a, b, atol=1e-6)
        backward(copied)


def test_two_decodes_alive_at_once_keep_their_values():
    scene = Scene(**ODD, n=400)
    rows = scene.rows()
    first = scene.decode(rows, ONE_KNOT, "cpu")
    kept = [tensor.clone() for tensor in first.detach().tensors()]
    second = scene.decode(rows, [(2, 1.0)], "cpu")
    backward(second)
    assert all(torch.equal(a, b) for a, b in zip(first.detach().tensors(), kept, strict=True))
    backward(first)


BAD_ROWS = {
    "0..69": (ValueError, torch.tensor([0, 999])),
    "-1..3": (ValueError, torch.tensor([-1, 3])),
    "1 different of 2": (ValueError, torch.tensor([2, 2])),
    r"int64 \[n\] on cpu like the features, got torch.float32 of shape \[1\]": (ValueError, torch.tensor([0.5])),
    r"rows must be int64 \[n\].*of shape \[1, 2\]": (ValueError, torch.tensor([[0, 1]])),
    "rows must hold numbers": (TypeError, torch.zeros(2, dtype=torch.int64, device="meta")),
    "rows must be a torch tensor, got numpy.ndarray": (TypeError, np.arange(3)),
    "contiguous rows": (TypeError, torch.arange(6)[::2]),
}


@pytest.mark.parametrize("message", BAD_ROWS)
def test_rows_that_cannot_be_decoded_are_named(message):
    error, rows = BAD_ROWS[message]
    scene = Scene()
    with pytest.raises(error, match=message):
        decode_anchors(
            [ChosenAnchors(scene.sets["static"], rows)], scene.decoder, None, ONE_KNOT, backend=backend_called("cpu")
        )


def test_tensors_that_do_not_fit_are_named():
    scene, other = Scene(features=5), Scene(features=6)
    static, moving, rows = scene.sets["static"], scene.sets["moving"], torch.arange(3)

    def refuses(error: type[Exception], message: str, chosen: ChosenAnchors, decoder: Any, field: Any) -> None:
        with pytest.raises(error, match=message):
            decode_anchors([chosen], decoder, field, ONE_KNOT, backend=backend_called("cpu"))

    plain = ChosenAnchors(static, rows)
    refuses(ValueError, r"features must be \[70, 6\] for this decoder, got \[70, 5\]", plain, other.decoder, None)
    corners = scene.field.corners(moving.positions)
    wrong = ChosenAnchors(static, rows, corners)
    message = r"indices of corners must be \[70, 3, 8\] .* got \[71, 3, 8\]"
    refuses(ValueError, message, wrong, scene.decoder, scene.field)
    refuses(ValueError, "no field", wrong, scene.decoder, None)
    short = dataclasses.replace(corners, weights=corners.weights[:5])
    message = r"weights of corners must be \[71, 3, 8\] .* got \[5, 3, 8\]"
    refuses(ValueError, message, ChosenAnchors(moving, rows, short), scene.decoder, scene.field)
    right = ChosenAnchors(moving, rows, corners)
    message = r"the field gives \[n, 6\], the decoder takes \[n, 5\]"
    refuses(ValueError, message, right, scene.decoder, other.field)
    with torch.no_grad():
        decoded = decode_anchors([plain], scene.decoder, None, ONE_KNOT, backend=backend_called("cpu"))
    message = r"means of decoded must be \[350, 3\] for 70 anchors, got \[15, 3\]"
    refuses(ValueError, message, ChosenAnchors(static, rows, decoded=decoded), scene.decoder, None)
    message = "float32 tensors on the cpu; features is torch.float64"
    static.features.data = static.features.data.double()
    refuses(TypeError, message, plain, scene.decoder, None)
    static.features = torch.nn.Parameter(torch.zeros(70, 5, device="meta"))
    refuses(TypeError, "features must hold numbers", plain, scene.decoder, None)


def _exp_all(source, out, n):
    for i in range(n):
        activation.exp_row(source + 256 * i, out + 256 * i)


def test_exp_is_accurate_over_its_range():
    values = np.linspace(-87, 88, 320 * 64).astype(np.float32)
    values[-5:] = [0.0, -0.0, 1e-30, np.nan, -1e30]
    buffers = [np.zeros(len(values) + 16, np.float32) for _ in range(2)]
    source, out = (b[-b.ctypes.data % 64 // 4 :][: len(values)] for b in buffers)
    source[:] = values
    compiled = cfunc(types.void(types.int64, types.int64, types.int64))(_exp_all)
    compiled.ctypes(source.ctypes.data, out.ctypes.data, 320)
    truth = np.exp(np.maximum(values, -87.0).astype(np.float64))
    assert np.isnan(out[-2])
    is_number = ~np.isnan(values)
    assert np.abs(out[is_number] / truth[is_number] - 1).max() < 2e-7


def test_recycled_memory_is_used_again_only_when_nobody_holds_it():
    memory = RecycledMemory()
    first = memory.empty(100, 100)
    address = first.data_ptr()
    assert address % 64 == 0
    view = first[10:]
    del first
    second = memory.empty(100, 100)
    assert second.data_ptr() != address
    del view
    assert memory.empty(100, 99).data_ptr() == address  # about the same size


def test_warm_up_runs_and_leaves_random_numbers_alone():
    before = torch.get_rng_state()
    warm_up()
    defined = {name for name in routines._defined if name.startswith("engine.backends.cpu.decode.")}
    assert defined <= set(routines._compiled)
    assert torch.equal(torch.get_rng_state(), before)
