"""Traces of something that moves."""

import numpy as np

from engine.filling.traces import Swept

UP = np.array([0.0, 0.0, 1.0])
DARK, BRIGHT = np.array([0.1, 0.1, 0.1]), np.array([0.8, 0.7, 0.7])


def swept() -> Swept:
    """A dark column that walks from x = 0 to x = 1."""
    found = Swept(0.1, UP)
    for x in np.linspace(0.0, 1.0, 21):
        z = np.linspace(0.0, 1.8, 90)
        means = np.stack([np.full(90, x + 0.05), np.full(90, 0.05), z], axis=1)
        found.add(means, np.full(90, 0.9), np.tile(DARK, (90, 1)))
    return found


def is_trace(place: tuple[float, float, float], color: np.ndarray = DARK) -> bool:
    return bool(swept().is_trace(np.array([place]), color[None])[0])


def test_what_stands_where_it_walks_is_a_trace():
    assert is_trace((0.52, 0.05, 0.9))


def test_what_stands_beside_its_way_is_none():
    assert not is_trace((0.52, 0.35, 0.9))
    assert not is_trace((1.6, 0.05, 0.9))


def test_the_ground_is_none():
    assert not is_trace((0.52, 0.05, 0.0))


def test_what_has_other_colors_is_none():
    assert not is_trace((0.52, 0.05, 0.9), BRIGHT)


def test_faint_gaussians_say_nothing_and_broken_ones_are_none():
    found = Swept(0.1, UP)
    found.add(np.zeros((9, 3)), np.full(9, 0.1), np.tile(DARK, (9, 1)))
    assert not found.is_trace(np.zeros((1, 3)), DARK[None]).any()
    assert not swept().is_trace(np.array([[np.nan, 0.0, 0.5]]), DARK[None]).any()
