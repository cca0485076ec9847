"""Orders of pictures: each picture once a pass, or by loss without bias; the state goes on exactly."""

from __future__ import annotations

import json

import numpy as np
import pytest

from engine.training.step.order import ErrorOrder, ShuffledOrder

N = 40


def losses() -> np.ndarray:
    return np.random.default_rng(0).gamma(1.0, size=N)


def test_a_shuffled_pass_has_every_item_once():
    order = ShuffledOrder(N, seed=0)
    first, second = ([order.draw().item for _ in range(N)] for _ in range(2))
    assert sorted(first) == sorted(second) == list(range(N))
    assert first != second


def test_the_first_pass_by_error_is_even():
    order = ErrorOrder(N, seed=0)
    draws = [order.draw() for _ in range(N)]
    assert sorted(draw.item for draw in draws) == list(range(N))
    assert all(draw.weight == pytest.approx(1.0) for draw in draws)


def test_draws_follow_the_loss_and_weights_undo_it():
    order = ErrorOrder(N, seed=0)
    errors = losses()
    for item, loss in enumerate(errors):
        order.saw(item, loss)
    expected = N * order.probabilities()
    assert expected.min() == pytest.approx(0.5)
    assert expected.argmax() == errors.argmax()
    assert expected.max() > 1.5
    n_passes = 400
    counts, weights = np.zeros(N), np.zeros(N)
    for _ in range(n_passes):
        seen = np.zeros(N)
        for _ in range(N):
            item, weight = order.draw()
            seen[item] += 1
            weights[item] += weight
        assert ((seen == np.floor(expected)) | (seen == np.ceil(expected))).all()
        counts += seen
    # a count is rounded up or down at random: its mean over 400 passes has a deviation of at most 0.5 / 20
    assert np.abs(counts / n_passes - expected).max() < 0.1
    assert np.abs(weights / n_passes - 1.0).max() < 0.2


def test_items_without_a_loss_and_equal_losses_are_drawn_evenly():
    order = ErrorOrder(4, seed=0)
    order.saw(0, 1.0)
    assert order.probabilities() == pytest.approx(np.full(4, 0.25))
    order.saw(1, 3.0)  # the others count as 2
    assert order.probabilities() == pytest.approx([0.125, 0.375, 0.25, 0.25])


@pytest.mark.parametrize("kind", [ShuffledOrder, ErrorOrder])
def test_a_restored_order_goes_on_exactly(kind):
    order = kind(N, seed=3)
    for step in range(N + 7):
        order.saw(order.draw().item, float(step % 5))
    other = kind(N, seed=9)
    other.restore(json.loads(json.dumps(order.state())))
    for step in range(2 * N):
        draw = order.draw()
        assert other.draw() == draw
        for each in (order, other):
            each.saw(draw.item, float(step % 3))
