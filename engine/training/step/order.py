"""The order in which training pictures are drawn: every picture once a pass, or those of a list as often as it has
them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


class ShuffledOrder:
    """Draws items without replacement, reshuffled after each pass. Owns its random state.

    Args:
        n_items: Those of range(n) are drawn.
        seed: Of the shuffling.
        items: Are drawn in place of those of range(n), each as often a pass as it is here; n of them.
    """

    def __init__(self, n_items: int, seed: int, items: Sequence[int] | None = None) -> None:
        self.n_items = n_items
        self._items = range(n_items) if items is None else items
        self._generator = np.random.default_rng(seed)
        self._left: list[int] = []

    def draw(self) -> int:
        """The next item."""
        if not self._left:
            self._left = self._generator.permutation(self.n_items).tolist()
        return self._items[self._left.pop()]

    def state(self) -> dict:
        """JSON-able state, to continue exactly here."""
        return {
            "left": list(self._left),
            "generator": self._generator.bit_generator.state,
        }

    def restore(self, state: dict) -> None:
        """Inverse of `state`.

        Raises:
            ValueError: The rest of the pass are not items.
        """
        left = list(state["left"])
        if not all(type(item) is int and 0 <= item < self.n_items for item in left):
            raise ValueError("the pictures left of a pass are not numbers of pictures")
        self._left = left
        self._generator.bit_generator.state = state["generator"]
