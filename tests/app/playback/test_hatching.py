"""Hatching: only where nothing is seen, plain at any size."""

from __future__ import annotations

import numpy as np

from app.playback.modes.hatching import DARK, LIGHT, hatched


def test_it_leaves_what_is_seen_and_covers_the_rest_with_lines() -> None:
    image = np.full((60, 80, 3), 200, np.uint8)
    is_seen = np.zeros((60, 80), bool)
    is_seen[:, 40:] = True
    found = hatched(image, is_seen)
    assert (found[:, 40:] == 200).all()
    assert set(np.unique(found[:, :40])) == {DARK, LIGHT}
    assert 0.15 < (found[:, :40, 0] == LIGHT).mean() < 0.4
    assert (image == 200).all()
    assert hatched(image, np.ones((60, 80), bool)) is image


def test_a_mask_of_another_size_is_brought_to_the_picture() -> None:
    is_seen = np.zeros((120, 160), bool)
    is_seen[60:] = True
    found = hatched(np.full((30, 40, 3), 200, np.uint8), is_seen)
    assert (found[15:] == 200).all()
    assert (found[:15] <= LIGHT).all()
