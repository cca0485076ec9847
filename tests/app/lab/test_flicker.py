"""Flicker and seam ratios: which pairs, which cameras, whose borders."""

from typing import Any

import pytest

from app.lab.flicker import FIGURES, OWN_BORDERS, definition_of, flicker_figures
from engine.metrics.clips.seams import PairRow, summarize


def pair(
    frame: int, static: float | None, moving: float | None, *, is_border: bool = False, is_held_out: bool = True
) -> dict[str, Any]:
    camera = "held out" if is_held_out else "trained on"
    return PairRow(frame, 0, camera, is_held_out, is_border, static, moving, 0.0, 0.0, static, moving, 0.5).as_dict()


def test_flicker_is_change_on_static_pixels_of_held_out_cameras_inside_clips_and_at_given_borders():
    rows = [pair(1, 0.01, 0.2), pair(2, 0.03, None, is_border=True), pair(3, 0.06, 0.3), pair(4, 0.02, 0.2)]
    rows.append(pair(3, 9.0, 9.0, is_held_out=False))
    found = flicker_figures(rows, {3})
    assert tuple(found) == FIGURES
    assert found["flicker_inside"] == pytest.approx(255 * 0.02)
    assert found["flicker_borders"] == pytest.approx(255 * 0.06)
    assert found["seam_ratio_static"] == pytest.approx(3.0)
    assert found["seam_ratio_moving"] == pytest.approx(1.5)


def test_without_given_borders_they_are_the_result_s_own_and_ratios_those_of_its_seams():
    rows = [pair(1, 0.01, 0.2), pair(2, 0.03, 0.1, is_border=True), pair(3, 0.06, 0.3)]
    found = flicker_figures(rows)
    assert found["flicker_borders"] == pytest.approx(255 * 0.03)
    assert found["flicker_inside"] == pytest.approx(255 * 0.035)
    seams = summarize([PairRow(**row) for row in rows])["means"]["held_out"]
    assert (found["seam_ratio_static"], found["seam_ratio_moving"]) == (seams["ratio_static"], seams["ratio_moving"])


@pytest.mark.parametrize(
    "rows",
    [
        [],
        [pair(1, 0.01, 0.1)],
        [pair(3, 0.01, 0.1)],
        [pair(1, 0.0, 0.0), pair(3, 0.01, 0.1)],
        [pair(1, None, None), pair(3, 0.01, 0.1)],
    ],
)
def test_a_ratio_that_does_not_exist_is_none(rows):
    found = flicker_figures(rows, {3})
    assert found["seam_ratio_static"] is None
    assert found["seam_ratio_moving"] is None


def test_without_held_out_cameras_all_count():
    rows = [pair(1, 0.01, 0.1, is_held_out=False), pair(3, 0.02, 0.1, is_held_out=False)]
    assert flicker_figures(rows, {3})["seam_ratio_static"] == pytest.approx(2.0)


def test_the_definition_says_whose_borders():
    assert definition_of().endswith(f"{OWN_BORDERS}.")
    assert definition_of("the borders are others").endswith("the borders are others.")
