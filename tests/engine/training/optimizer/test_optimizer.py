"""Optimiser of a phase: both back ends of Adam against float64, laziness, clipping, non-finite gradients, resuming."""

from collections.abc import Iterable

import numba
import numpy as np
import pytest
import torch
from torch import nn

from engine.backends.table import backend_called
from engine.training.config import TrainConfig
from engine.training.optimizer.optimizer import PhaseOptimizer, schedule_of

SHAPES = {"one": (1,), "row": (63,), "block": (4, 16), "odd": (5, 1000, 7), "table": (2, 10_000, 4)}
RATES = {"one": 1e-3, "row": 1e-2, "block": 4e-2, "odd": 2e-3, "table": 4e-2}


def make_parameters(dtype: torch.dtype = torch.float32, seed: int = 0) -> dict[str, tuple[nn.Parameter, float]]:
    generator = torch.Generator().manual_seed(seed)
    values = {name: torch.randn(shape, generator=generator) for name, shape in SHAPES.items()}
    return {name: (nn.Parameter(value.to(dtype)), RATES[name]) for name, value in values.items()}


def make_optimizer(parameters, backend: str = "cpu", **config) -> PhaseOptimizer:
    learning = {name: parameter for name, (parameter, _) in parameters.items()}
    schedule = schedule_of(parameters, TrainConfig(**config), n_steps=100)
    return PhaseOptimizer(learning, schedule=schedule, backend=backend_called(backend))


def set_gradients(parameters, step: int) -> None:
    """Gradients of one step: half of the table never has any, "row" has none at every third step."""
    generator = torch.Generator().manual_seed(1000 + step)
    for name, (parameter, _) in parameters.items():
        gradient = torch.randn(parameter.shape, generator=generator) * 10.0 ** -(step % 5)
        if name == "table":
            gradient[:, 5000:] = 0
            gradient[:, step::7] = 0
        parameter.grad = None if name == "row" and step % 3 == 0 else gradient.to(parameter.dtype)


def run(parameters, optimizer: PhaseOptimizer, steps: Iterable[int] = range(100)) -> list[float]:
    norms = []
    for step in steps:
        set_gradients(parameters, step)
        norms.append(float(optimizer.step()))
    return norms


@pytest.mark.slow
@pytest.mark.parametrize("max_gradient_norm", [0.0, 3.0])
def test_fused_follows_the_float64_reference(max_gradient_norm):
    fast, slow = make_parameters(), make_parameters(torch.float64)
    fast_norms = run(fast, make_optimizer(fast, max_gradient_norm=max_gradient_norm))
    slow_norms = run(slow, make_optimizer(slow, "reference", max_gradient_norm=max_gradient_norm))
    assert np.allclose(fast_norms, slow_norms, rtol=1e-6)
    for name, (parameter, rate) in fast.items():
        error = (parameter.detach().double() - slow[name][0].detach()).abs().max()
        # 100 roundings of values up to 4 (1e-7 each), and float32 moments: a few 1e-6 of 100 steps of this rate
        assert error < 100 * 2.5e-7 + 100 * rate * 3e-6


def test_a_limit_that_is_not_reached_changes_no_bit():
    found = []
    for max_gradient_norm in (0.0, 1e6):
        parameters = make_parameters()
        optimizer = make_optimizer(parameters, max_gradient_norm=max_gradient_norm)
        norms = run(parameters, optimizer, range(8))
        assert max(norms) < 1e6
        found.append(parameters)
    assert all(torch.equal(found[0][name][0], found[1][name][0]) for name in SHAPES)


@pytest.mark.parametrize("backend", ["cpu", "reference"])
def test_gradients_above_the_limit_count_as_if_they_had_that_norm(backend):
    found = []
    for length in (10.0, 1e4):  # the same direction, both above
        parameters = {"row": (nn.Parameter(torch.zeros(64)), 1.0)}
        optimizer = make_optimizer(parameters, backend, max_gradient_norm=2.0)
        parameters["row"][0].grad = torch.full((64,), length / 8)
        assert optimizer.step().item() == pytest.approx(length)
        found.append(optimizer.arrays()["optimizer.row.exp_avg"])
        assert np.linalg.norm(found[-1]) == pytest.approx(0.1 * 2.0, rel=1e-6)  # 1 - beta1 of the gradient
    assert np.allclose(found[0], found[1], rtol=1e-6)


def test_entries_without_gradient_keep_their_bits():
    parameters = make_parameters()
    before = parameters["table"][0].detach().clone()
    run(parameters, make_optimizer(parameters), range(5))
    assert torch.equal(parameters["table"][0][:, 5000:], before[:, 5000:])
    assert not torch.equal(parameters["table"][0][:, :5000], before[:, :5000])


def test_entry_goes_on_moving_after_its_gradient_became_zero():
    parameters = {"row": (nn.Parameter(torch.zeros(200)), 0.1)}
    optimizer = make_optimizer(parameters)
    parameter = parameters["row"][0]
    parameter.grad = torch.zeros(200)
    parameter.grad[70] = 1.0
    optimizer.step()
    first = float(parameter[70].detach())
    parameter.grad = torch.zeros(200)
    optimizer.step()
    assert first < 0
    assert float(parameter[70].detach()) < first
    assert parameter.detach().count_nonzero() == 1


def test_gradients_are_cleared():
    parameters = make_parameters()
    run(parameters, make_optimizer(parameters), [1])
    assert all(parameter.grad is None for parameter, _ in parameters.values())


@pytest.mark.parametrize("backend", ["cpu", "reference"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_gradient_that_is_not_finite_is_named_and_changes_nothing(backend, value):
    parameters = make_parameters()
    optimizer = make_optimizer(parameters, backend)
    run(parameters, optimizer, range(3))
    before = {name: parameter.detach().clone() for name, (parameter, _) in parameters.items()}
    state = optimizer.arrays()
    set_gradients(parameters, 4)
    gradient = parameters["odd"][0].grad
    assert gradient is not None
    gradient[2, 500, 3] = value
    assert optimizer.not_finite() == ("odd",)
    mark = optimizer.mark()
    assert not optimizer.step().isfinite()
    optimizer.step(torch.tensor(False))
    optimizer.go_back(mark)
    assert all(torch.equal(parameters[name][0], value) for name, value in before.items())
    after = optimizer.arrays()
    assert all(np.array_equal(after[name], value) for name, value in state.items())
    assert optimizer.steps_done == 3


@pytest.mark.parametrize("backend", ["cpu", "reference"])
@pytest.mark.parametrize("resumed_backend", ["cpu", "reference"])
def test_going_on_from_arrays_is_going_on(backend, resumed_backend):
    straight = make_parameters()
    optimizer = make_optimizer(straight, backend)
    run(straight, optimizer, range(10))
    resumed = {name: (nn.Parameter(parameter.detach().clone()), rate) for name, (parameter, rate) in straight.items()}
    other = make_optimizer(resumed, resumed_backend)
    other.restore({name: np.atleast_1d(value) for name, value in optimizer.arrays().items()}, 10)  # as files give them
    run(straight, optimizer, range(10, 20))
    run(resumed, other, range(10, 20))
    for name, (parameter, rate) in straight.items():
        if backend == resumed_backend:
            assert torch.equal(parameter, resumed[name][0])
        # two float32 back ends round differently: ten steps of this rate, a few 1e-6 each
        assert (parameter - resumed[name][0]).abs().max() < 10 * 5e-7 + 10 * rate * 1e-5


def test_same_bits_for_any_number_of_threads():
    before, found = numba.get_num_threads(), []
    try:
        for n_threads in (1, before):
            numba.set_num_threads(n_threads)
            parameters = make_parameters()
            norms = run(parameters, make_optimizer(parameters, max_gradient_norm=2.0), range(8))
            found.append((norms, parameters))
    finally:
        numba.set_num_threads(before)
    assert found[0][0] == found[1][0]
    assert all(torch.equal(found[0][1][name][0], found[1][1][name][0]) for name in SHAPES)


def test_rates_fall_to_their_final_ratio():
    moved = []
    for steps_done in (0, 100):
        parameters = {"one": (nn.Parameter(torch.zeros(1)), 1.0)}
        optimizer = make_optimizer(parameters, final_lr_ratio=0.1)
        optimizer.steps_done = steps_done
        parameters["one"][0].grad = torch.ones(1)
        optimizer.step()
        moved.append(float(parameters["one"][0].detach()))
    assert moved == pytest.approx([-1.0, -0.1])


def test_a_schedule_that_is_over_stays_where_it_ended():
    parameters = {name: (nn.Parameter(torch.zeros(1)), 2.0) for name in ("one", "other")}
    config = TrainConfig(final_lr_ratio=0.1)
    schedule = schedule_of(parameters, config, n_steps=100, final_ratios={"other": 0.5}, is_over=True)
    assert schedule.rates == {"one": pytest.approx(0.2), "other": 1.0}
    assert schedule.final_ratios == {"one": 1.0, "other": 1.0}


def test_strided_gradient_is_taken():
    parameters = {"block": (nn.Parameter(torch.zeros(6, 4)), 0.1)}
    parameters["block"][0].grad = torch.arange(24.0).reshape(4, 6).T - 11.5
    make_optimizer(parameters).step()
    expected = -0.1 * torch.sign(torch.arange(24.0).reshape(4, 6).T - 11.5)
    assert torch.allclose(parameters["block"][0].detach(), expected)


@pytest.mark.parametrize("backend", ["cpu", "reference"])
def test_phase_with_nothing_to_learn_steps(backend):
    assert make_optimizer({}, backend).step() == 0.0


def test_parameters_that_the_kernels_would_misread_are_refused():
    with pytest.raises(TypeError, match="one, row"):
        make_optimizer(make_parameters(torch.float64))


@pytest.mark.parametrize("gradient", [torch.ones(3), torch.ones(4, dtype=torch.float64)])
def test_a_gradient_unlike_its_parameter_is_an_error(gradient):
    adam = backend_called("cpu").adam({"weights": torch.zeros(4)})
    with pytest.raises(ValueError, match=r"gradient of weights must be \[4\] in float32"):
        adam.step({"weights": gradient}, {"weights": 0.1}, max_norm=0.0, is_sound=torch.tensor(True))
