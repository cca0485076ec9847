"""What "Set moving" marks: what was drawn, or the box around what is selected."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from engine.editing.edit import Box, Prism, Sphere
from ui.panels.editing.edit_subject import bounds_of

MEANS = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [-1.0, 0.5, 1.0], [np.nan, 9.0, 9.0], [50.0, 50.0, 50.0]])


def session(*selected: int) -> Any:
    """A session that shows MEANS, of which some are selected."""
    mask = np.zeros(len(MEANS), np.bool_)
    mask[list(selected)] = True
    return SimpleNamespace(
        shown_gaussians=lambda: SimpleNamespace(means=MEANS, rows=()),
        selection=SimpleNamespace(n_gaussians=len(selected)),
        selected=lambda gaussians: mask,
    )


def test_the_box_around_a_selection_holds_its_centres_and_nothing_that_is_not_finite() -> None:
    assert bounds_of(session(0, 1, 2, 3), None) == ((-1.0, 0.0, 0.0), (1.0, 2.0, 3.0))


@pytest.mark.parametrize("selected", [(), (1,), (3,)])
def test_what_has_no_room_in_it_has_no_box(selected: tuple[int, ...]) -> None:
    assert bounds_of(session(*selected), None) is None


def test_what_was_drawn_goes_before_what_is_selected() -> None:
    assert bounds_of(session(4), Box((0.0, 0.0, 0.0), (0.5, 0.4, 0.3))) == ((-0.5, -0.4, -0.3), (0.5, 0.4, 0.3))
    assert bounds_of(session(4), Sphere((1.0, 2.0, 3.0), 0.5)) == ((0.5, 1.5, 2.5), (1.5, 2.5, 3.5))
    prism = Prism((0.0, 0.0, 0.0), (0.5, 0.4, 0.3), ((-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)), apex=2.0)
    assert bounds_of(session(4), prism) == ((-0.75, pytest.approx(-0.6), -0.3), (0.75, pytest.approx(0.6), 0.3))
