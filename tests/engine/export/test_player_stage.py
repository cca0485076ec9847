"""Where a headset stands: the ground and the scale of made scenes."""

from __future__ import annotations

import numpy as np
import pytest

from engine.export.player.stage import CAMERAS_M, FARTHEST_CAMERAS_M, PERSON_M, stage_of
from engine.export.splats import Splats
from tests.engine.export.scenes import chance_splats

UP = np.array([0.0, 0.0, 1.0])
FOCUS = np.array([0.0, 0.0, 3.0])
RADIUS = 5.0


def splats(heights: np.ndarray, opacities: float | np.ndarray = 0.9) -> Splats:
    rows = chance_splats(len(heights))
    rows.means[:] = 0.0
    rows.means[:, 2] = heights
    rows.opacities[:] = opacities
    return rows


FLOOR = splats(np.full(500, 2.0))
PERSON = splats(np.linspace(2.2, 4.0, 1001))
NOTHING = FLOOR[:0]


def test_what_moves_stands_on_the_ground_and_is_as_tall_as_a_person():
    found = stage_of(FLOOR, PERSON, up=UP, focus=FOCUS, radius=RADIUS)
    assert found["floor"] == pytest.approx(2.2, abs=0.05)
    assert found["meters_per_unit"] == pytest.approx(PERSON_M / 1.8, rel=0.06)
    assert not found["is_measured"]


def test_a_known_unit_is_kept():
    found = stage_of(FLOOR, PERSON, up=UP, focus=FOCUS, radius=RADIUS, meters_per_unit=0.01)
    assert (found["meters_per_unit"], found["is_measured"]) == (0.01, True)


def test_where_nothing_moves_still_parts_are_the_ground():
    found = stage_of(FLOOR, NOTHING, up=UP, focus=FOCUS, radius=RADIUS)
    assert found["floor"] == 2.0
    assert found["meters_per_unit"] == CAMERAS_M / RADIUS


@pytest.mark.parametrize("height", [0.0, 1e-6, 0.1, 0.99 * PERSON_M * RADIUS / FARTHEST_CAMERAS_M])
def test_what_is_too_flat_for_a_person_does_not_make_the_scene_gigantic(height: float):
    flat = splats(np.linspace(2.2, 2.2 + height, 1001))
    found = stage_of(FLOOR, flat, up=UP, focus=FOCUS, radius=RADIUS)
    assert found["floor"] == pytest.approx(2.2, abs=0.05)
    assert found["meters_per_unit"] == CAMERAS_M / RADIUS


def test_what_is_faint_or_far_away_does_not_count():
    heights = np.concatenate([PERSON.means[:, 2], np.full(200, -1.0), np.full(300, -90.0)])
    opacities = np.concatenate([np.full(1001, 0.9), np.full(200, 1e-3), np.full(300, 0.9)])
    found = stage_of(FLOOR, splats(heights, opacities), up=UP, focus=FOCUS, radius=RADIUS)
    assert found["floor"] == pytest.approx(2.2, abs=0.05)


def test_an_empty_scene_has_a_ground_too():
    found = stage_of(NOTHING, NOTHING, up=UP, focus=FOCUS, radius=RADIUS)
    assert found["floor"] == pytest.approx(0.5)
    assert found["meters_per_unit"] > 0.0
