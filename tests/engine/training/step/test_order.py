"""The order of pictures: each picture once a pass; the state goes on exactly."""

from __future__ import annotations

import json

import pytest

from engine.training.step.order import ShuffledOrder

N = 40


def test_a_shuffled_pass_has_every_item_once():
    order = ShuffledOrder(N, seed=0)
    first, second = ([order.draw() for _ in range(N)] for _ in range(2))
    assert sorted(first) == sorted(second) == list(range(N))
    assert first != second


def test_a_restored_order_goes_on_exactly():
    order = ShuffledOrder(N, seed=3)
    for _ in range(N + 7):
        order.draw()
    other = ShuffledOrder(N, seed=9)
    other.restore(json.loads(json.dumps(order.state())))
    assert [other.draw() for _ in range(2 * N)] == [order.draw() for _ in range(2 * N)]


@pytest.mark.parametrize("left", [[N], [-1], [[3, 1.0]], [True], ["3"]])
def test_what_is_no_list_of_pictures_is_refused(left):
    order = ShuffledOrder(N, seed=3)  # pairs of an item and a weight stand in old checkpoints with sampling=error
    with pytest.raises(ValueError, match="not numbers of pictures"):
        order.restore(order.state() | {"left": left})
