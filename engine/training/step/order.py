"""The order in which training pictures are drawn: every picture once a pass, or more often where the loss is large.

Both own their random state and are restored exactly from a checkpoint.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np


class Draw(NamedTuple):
    """An item, and the weight of its loss: draws times weight is one per pass and item, in expectation."""

    item: int
    weight: float


class Order(Protocol):
    """Draws items of a range, learns what loss each had, and can be stored as JSON."""

    def draw(self) -> Draw: ...
    def saw(self, item: int, loss: float) -> None: ...
    def state(self) -> dict: ...
    def restore(self, state: dict) -> None: ...


class ShuffledOrder:
    """Draws items of range(n) without replacement, reshuffled after each pass."""

    def __init__(self, n_items: int, seed: int) -> None:
        self.n_items = n_items
        self._generator = np.random.default_rng(seed)
        self._left: list[int] = []

    def draw(self) -> Draw:
        """The next item; all weigh 1."""
        if not self._left:
            self._left = self._generator.permutation(self.n_items).tolist()
        return Draw(self._left.pop(), 1.0)

    def saw(self, item: int, loss: float) -> None:
        """Nothing: the order does not depend on losses."""

    def state(self) -> dict:
        """JSON-able state, to go on exactly here."""
        return {
            "left": list(self._left),
            "generator": self._generator.bit_generator.state,
        }

    def restore(self, state: dict) -> None:
        """Inverse of `state`."""
        self._left = list(state["left"])
        self._generator.bit_generator.state = state["generator"]


class ErrorOrder:
    """Draws items of range(n) more often where the loss is large, n draws a pass, and weighs them by how rare they are.

    A pass draws item i with p_i = (1 - share) / n + share e_i / sum(e) on average n p_i times: rounded down or up, by
    one random offset for all (systematic sampling). A draw weighs 1 / (n p_i), so that sums over draws are on average
    those of even passes. e is a running mean of an item's loss, above the smallest one; the first pass is even.

    Args:
        n_items: n.
        share: Of the draws that follows the loss.
        memory: Weight of the past in the running mean.
    """

    def __init__(self, n_items: int, seed: int, *, share: float = 0.5, memory: float = 0.5) -> None:
        self.n_items, self._share, self._memory = n_items, share, memory
        self._generator = np.random.default_rng(seed)
        self._left: list[Draw] = []
        self._losses = np.full(n_items, np.nan)

    def draw(self) -> Draw:
        """The next item and its weight."""
        if not self._left:
            self._left = self._next_pass()
        return self._left.pop()

    def saw(self, item: int, loss: float) -> None:
        """The loss that an item had, before its weight."""
        old = self._losses[item]
        self._losses[item] = loss if np.isnan(old) else self._memory * old + (1 - self._memory) * loss

    def probabilities(self) -> np.ndarray:
        """p of the next pass. [n] float64"""
        even = np.full(self.n_items, 1 / self.n_items)
        if np.isnan(self._losses).all():
            return even
        errors = np.where(np.isnan(self._losses), np.nanmean(self._losses), self._losses) - np.nanmin(self._losses)
        total = errors.sum()
        return (1 - self._share) * even + self._share * (errors / total if total > 0 else even)

    def _next_pass(self) -> list[Draw]:
        expected = self.n_items * self.probabilities()
        order = self._generator.permutation(self.n_items)  # neighbours share a rounding, so they change every time
        ends = np.cumsum(expected[order])
        ends *= self.n_items / ends[-1]
        places = np.minimum(np.arange(self.n_items) + self._generator.random(), np.nextafter(self.n_items, 0))
        items = order[np.searchsorted(ends, places, side="right").clip(max=self.n_items - 1)]
        drawn = self._generator.permutation(items)
        return [Draw(item, 1 / weight) for item, weight in zip(drawn.tolist(), expected[drawn].tolist(), strict=True)]

    def state(self) -> dict:
        """JSON-able state, to go on exactly here."""
        return {
            "left": [list(draw) for draw in self._left],
            "losses": [None if np.isnan(loss) else loss for loss in self._losses.tolist()],
            "generator": self._generator.bit_generator.state,
        }

    def restore(self, state: dict) -> None:
        """Inverse of `state`."""
        self._left = [Draw(item, weight) for item, weight in state["left"]]
        self._losses = np.array([np.nan if loss is None else loss for loss in state["losses"]], np.float64)
        self._generator.bit_generator.state = state["generator"]
