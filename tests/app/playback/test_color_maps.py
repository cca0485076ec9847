"""Colour maps: even lightness, apart for colour-blind eyes, and values at, between and beyond the ends."""

from __future__ import annotations

import numpy as np
import pytest

from app.playback.modes.color_maps import COLOR_MAPS, SIGNED, mapped

# Linear RGB as seen without the long, the middle and the short cones, after Machado, Oliveira and Fernandes, 2009.
BLINDNESS = {
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def _luminance(colors: np.ndarray) -> np.ndarray:
    return (colors / 255.0) ** 2.2 @ [0.2126, 0.7152, 0.0722]


def _as_seen(colors: np.ndarray, kind: str) -> np.ndarray:
    return np.clip((colors / 255.0) ** 2.2 @ np.array(BLINDNESS[kind]).T, 0.0, 1.0) ** (1 / 2.2)


@pytest.mark.parametrize("name", ["inferno", "viridis", "gray"])
def test_sequential_maps_grow_lighter_from_end_to_end(name: str) -> None:
    steps = np.diff(_luminance(COLOR_MAPS[name])[::8])
    assert (steps > 0).all()


def test_the_signed_map_is_lightest_at_zero_and_equally_dark_at_its_ends() -> None:
    luminance = _luminance(COLOR_MAPS[SIGNED])
    assert abs(int(np.argmax(luminance)) - 127.5) <= 1
    assert luminance[0] == pytest.approx(luminance[-1], abs=0.03)
    assert (np.diff(luminance[:128:8]) > 0).all()
    assert (np.diff(luminance[128::8]) < 0).all()


@pytest.mark.parametrize("kind", BLINDNESS)
def test_the_two_sides_of_the_signed_map_stay_apart_for_colour_blind_eyes(kind: str) -> None:
    seen = _as_seen(COLOR_MAPS[SIGNED], kind)
    for share in (0.1, 0.25, 0.4):  # as far below zero as above it
        low, high = seen[round(255 * (0.5 - share))], seen[round(255 * (0.5 + share))]
        assert np.abs(low - high).max() > 0.15


@pytest.mark.parametrize("name", COLOR_MAPS)
def test_a_table_is_whole_and_cannot_be_changed(name: str) -> None:
    table = COLOR_MAPS[name]
    assert table.shape == (256, 3)
    assert table.dtype == np.uint8
    with pytest.raises(ValueError, match="read-only"):
        table[0] = 0


def test_values_beyond_the_ends_take_the_colours_of_the_ends() -> None:
    values = np.array([[-np.inf, -5.0, 1.0], [3.0, 5.0, np.inf]])
    colors = mapped(values, "viridis", 1.0, 3.0)
    table = COLOR_MAPS["viridis"]
    assert (colors[0] == table[0]).all()
    assert (colors[1] == table[-1]).all()


def test_what_is_not_a_number_is_drawn_as_nothing() -> None:
    colors = mapped(np.array([0.5, np.nan]), "gray", 0.0, 1.0, nothing=(1.0, 0.0, 0.2))
    assert colors.tolist() == [[128, 128, 128], [255, 0, 51]]


@pytest.mark.parametrize(("name", "low", "high"), [("jet", 0.0, 1.0), ("gray", 1.0, 1.0), ("gray", 0.0, np.nan)])
def test_a_map_that_does_not_exist_and_an_empty_range_are_refused(name: str, low: float, high: float) -> None:
    with pytest.raises(ValueError, match=r"maps are|low < high"):
        mapped(np.zeros(3), name, low, high)
