"""The residuals panel and heat maps over the picture, in the real window."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui
from pyglet.window import key

from app.residuals.anchor_heat import AnchorHeat
from app.residuals.heat_map import HEAT_KINDS, HeatMap
from app.session.showing.look_commands import LookThrough, SetCompare, SetFrame, ShowHeat
from app.status import CELL_RANGES, ResidualStatus, SeamStatus
from tests.ui.pilot import Pilot
from ui.panels.picture.heat_overlay import heat_words
from ui.panels.residuals.matrix import (
    NAME_HEIGHT,
    cell_at,
    cell_colors,
    frames_per_column,
    matrix_picture,
    named_rows,
    pixel_cells,
    worst_of,
)
from ui.panels.residuals.panel import listed_seams, progress_text
from ui.panels.state import RESIDUALS
from ui.panels.timeline.rows.columns import provisional_text
from ui.viewport.heat_image import value_at
from ui.viewport.layers.anchor_heat_layer import heat_points


def test_the_worst_of_frames_that_share_a_column_is_kept() -> None:
    cells = np.array([[30.0, 1.0], [20.0, np.nan], [25.0, np.nan]], np.float32)
    assert np.array_equal(worst_of(cells, 2, is_higher_better=True), [[20.0, 1.0], [25.0, np.nan]], equal_nan=True)
    assert np.array_equal(worst_of(cells, 2, is_higher_better=False), [[30.0, 1.0], [25.0, np.nan]], equal_nan=True)
    assert worst_of(cells, 1, is_higher_better=True) is cells


@pytest.mark.parametrize(("n_frames", "width"), [(1, 1), (30, 200), (10_000, 195), (7, 7), (201, 200)])
def test_one_bad_frame_is_seen_at_its_place_however_many_there_are(n_frames: int, width: int) -> None:
    low, high = CELL_RANGES["psnr"]
    cells = np.full((n_frames, 3), high, np.float32)
    bad = n_frames // 2
    cells[bad, 1] = low
    picture = matrix_picture(cells, "psnr", width, 9)
    assert picture.shape == (9, width, 3)
    is_bad = (picture == cell_colors(np.array(low), "psnr")).all(axis=2)
    rows, columns = np.nonzero(is_bad)
    assert set(rows) == {3, 4, 5}
    n = frames_per_column(n_frames, width)
    assert abs((columns.mean() + 0.5) / width - (bad + 0.5) / n_frames) <= max(n / n_frames, 1.0 / width)


def test_cells_of_pixels_cover_all_cells_in_order() -> None:
    found = pixel_cells(3, 8)
    assert list(found) == sorted(found)
    assert set(found) == {0, 1, 2}


def test_every_camera_has_a_name_or_a_neighbour_with_one() -> None:
    assert named_rows(8, 16.0, None) == set(range(8))
    assert named_rows(31, 250.0 / 31, None) == set(range(0, 31, 2))
    named = named_rows(31, 250.0 / 31, 13)
    assert 13 in named
    assert not {12, 14} & named
    for shown in range(31):
        rows = sorted(named_rows(31, 250.0 / 31, shown))
        assert min(after - row for row, after in itertools.pairwise(rows)) * 250.0 / 31 >= NAME_HEIGHT


def test_a_place_outside_of_the_matrix_is_no_cell() -> None:
    assert cell_at(0.999, 0.0, 30, 8) == (29, 0)
    assert cell_at(1.0, 0.5, 30, 8) is None
    assert cell_at(-0.01, 0.5, 30, 8) is None
    assert cell_at(0.5, 0.5, 0, 8) is None


def test_bad_is_bright_in_every_column() -> None:
    for column, (low, high) in CELL_RANGES.items():
        good, bad = (high, low) if column == "psnr" else (low, high)
        assert cell_colors(np.array(bad), column).sum() > cell_colors(np.array(good), column).sum()


def test_seams_without_a_score_are_left_out() -> None:
    seams = (SeamStatus(1, 10, 0.5, 1.2), SeamStatus(2, 20), SeamStatus(3, 30, 2.5, 2.0), SeamStatus(4, 40, 0.9))
    assert [seam.clip_index for seam, _ in listed_seams(seams, 5)] == [4, 3, 1]


def test_a_seam_is_neither_ranked_nor_flagged_before_all_cameras_are_in() -> None:
    early = SeamStatus(1, 10, 0.9, 2.64, 5, 31)
    seams = (early, SeamStatus(2, 20, 0.2, 1.3, 31, 31), SeamStatus(3, 30, 0.9, 2.5, 31, 31))
    assert [(seam.clip_index, ratio) for seam, ratio in listed_seams(seams, 5)] == [(3, 2.5), (2, 1.3), (1, None)]
    assert provisional_text(early) == "~2.6 (5 of 31 cameras)"
    assert [provisional_text(seam) for seam in (*seams[1:], SeamStatus(4, 40, n_all=31))] == [""] * 3


def test_progress_counts_what_the_panel_shows() -> None:
    measured = {"psnr": (1860, 4650), "flip": (0, 4650), "E": (26, 4619)}
    status = ResidualStatus(measured=measured, n_all=4650, is_measuring=True)
    for column, (n, n_all) in measured.items():
        assert f" {n:,} of {n_all:,} " in progress_text(status, column)
    assert "1 h 15 min" in progress_text(replace(status, eta_s=4500.0), "E")


def test_a_value_outside_of_the_map_is_none() -> None:
    values = np.array([[1.0, np.nan]], np.float32)
    assert value_at(values, 0.2, 0.5) == 1.0
    assert value_at(values, 0.7, 0.5) is None
    assert value_at(values, 1.0, 0.5) is None


def test_words_say_what_is_shown_and_why_not() -> None:
    kind = HEAT_KINDS["E"]
    for mean, told in ((1.25, " 1.2 "), (0.0452, " 0.045 ")):
        shown = HeatMap(np.zeros((2, 2), np.float32), "E", 1, 0, 5, 0, mean=mean)
        assert told in heat_words(kind, shown)
    assert "It is so." in heat_words(kind, HeatMap(None, "E", None, 0, 0, 0, note="It is so."))
    assert heat_words(kind, None)


# ---- in the window ---------------------------------------------------------------------------------------------


def _show(pilot: Pilot) -> None:
    pilot.studio.frame.ui.wanted_panel = RESIDUALS
    pilot.draw(6)


@pytest.mark.slow
def test_a_click_on_a_cell_goes_to_its_frame_and_camera(pilot: Pilot) -> None:
    _show(pilot)
    area = pilot.rects["residuals.matrix"]
    pilot.tap(area.x0 + area.width * 12.5 / 30, area.y0 + area.height * 5.5 / 8)
    assert pilot.session.timeline.frame_index == 12
    assert pilot.session.view.look_through == 5


@pytest.mark.slow
def test_the_worst_picture_comes_first_and_a_click_goes_there(pilot: Pilot) -> None:
    _show(pilot)
    pilot.click("residuals.worst12.5")
    assert (pilot.session.timeline.frame_index, pilot.session.view.look_through) == (12, 5)
    pilot.click("residuals.column.E")
    pilot.draw(2)
    assert "residuals.worst12.5" in pilot.rects


@pytest.mark.slow
def test_a_seam_is_played_around_as_its_worst_camera_sees_it(pilot: Pilot) -> None:
    _show(pilot)
    pilot.click("residuals.seam2")
    timeline = pilot.session.timeline
    assert timeline.around is not None
    assert timeline.around[0] < 20 < timeline.around[1]
    assert timeline.is_playing
    assert pilot.session.view.look_through == 5


@pytest.mark.slow
def test_a_heat_map_lies_over_the_picture_with_its_bar_and_the_value_under_the_pointer(pilot: Pilot) -> None:
    pilot.session.dispatch(LookThrough(2))
    pilot.key(key.RIGHT)
    pilot.draw(3)
    before = pilot.picture()
    pilot.key(key._7)
    pilot.draw(3)
    assert pilot.sent(ShowHeat) == [ShowHeat("E")]
    pane, bar = pilot.rects["viewport.rendered"], pilot.rects["viewport.heat_bar"]
    assert pane.contains(bar.x0, bar.y0)
    assert np.abs(pilot.picture().astype(int) - before).mean() > 5.0
    heat = pilot.studio.frame.viewport.active.heat
    assert heat.shown is not None
    assert heat.shown.kind == "E"
    pilot.key(key._7)
    pilot.draw(3)
    assert heat.shown is None
    assert "viewport.heat_bar" not in pilot.rects


def test_colours_keep_their_range_from_frame_to_frame(pilot: Pilot) -> None:
    pilot.session.dispatch(LookThrough(2))
    pilot.session.dispatch(ShowHeat("error"))
    strips = []
    for frame_index in (3, 17):
        pilot.session.dispatch(SetFrame(frame_index))
        pilot.draw(4)
        pane = pilot.rects["viewport.rendered"]
        y = int(pane.y0 + pane.height * 0.8)
        strips.append(pilot.picture()[y, int(pane.x0) + 4 : int(pane.x0) + 40].astype(int))
    assert np.abs(strips[0] - strips[1]).max() <= 2


def test_where_there_is_no_map_the_reason_is_said_and_nothing_breaks(pilot: Pilot) -> None:
    pilot.session.dispatch(LookThrough(2))
    pilot.session.dispatch(ShowHeat("E"))
    pilot.draw(4)
    assert pilot.studio.frame.viewport.active.heat.shown is None
    assert len(pilot.session.notices) == 0
    assert "viewport.heat_bar" in pilot.rects


@pytest.mark.slow
def test_every_kind_can_be_chosen_by_key(pilot: Pilot) -> None:
    pilot.session.dispatch(LookThrough(2))
    pilot.session.dispatch(SetFrame(4))
    seen = []
    for _ in HEAT_KINDS:
        pilot.key(key._8)
        pilot.draw(2)
        seen.append(pilot.session.overlays.heat)
    assert sorted(seen) == sorted(HEAT_KINDS)
    assert len(pilot.session.notices) == 0


@pytest.mark.slow
def test_in_a_free_view_anchors_show_their_residual(pilot: Pilot) -> None:
    pilot.draw(3)
    before = pilot.picture()
    pilot.session.dispatch(ShowHeat("error"))
    pilot.draw(4)
    pane = pilot.rects["viewport.rendered"]
    x, y = (int(v) for v in pane.center)
    around = np.s_[y - 60 : y + 60, x - 60 : x + 60]
    assert np.abs(pilot.picture()[around].astype(int) - before[around]).mean() > 1.0
    assert "viewport.heat_bar" in pilot.rects


def test_anchors_that_nobody_saw_are_left_out_and_the_hottest_come_last() -> None:
    heat = AnchorHeat(np.eye(3, dtype=np.float32), np.array([9.0, np.nan, 1.0], np.float32), "E", 1, 0, 0)
    positions, colors = heat_points(heat)
    assert np.array_equal(positions, np.eye(3)[[2, 0]])
    assert colors[1, 3] == 1.0
    assert colors[0, 3] < 0.5


@pytest.mark.slow
def test_words_of_a_heat_map_lie_over_the_wipe_and_fit_into_the_picture(
    pilot: Pilot, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[str] = []
    note = "Clip 0 ends before this frame; its last frame stands in, which shows no more than R"
    plain = pilot.session.heat
    monkeypatch.setattr(pilot.session, "heat", lambda kind: replace(plain(kind), note=f"{note}; {note}"))
    monkeypatch.setattr(
        "ui.panels.picture.heat_overlay.chip",
        lambda draw, x, y, text, **_: drawn.append(f"{text}|{x - imgui.calc_text_size(text).x}"),
    )
    monkeypatch.setattr("ui.panels.picture.picture_pane._draw_handle", lambda *_: drawn.append("wipe"))
    pilot.session.dispatch(LookThrough(2))
    pilot.session.dispatch(SetFrame(10))
    pilot.session.dispatch(ShowHeat("clips"))
    pilot.session.dispatch(SetCompare("wipe"))
    pilot.draw(3)
    drawn.clear()
    pilot.draw(1)
    assert drawn[0] == "wipe"
    lines = [line.split("|") for line in drawn[1:]]
    assert len(lines) > 1
    assert " ".join(text for text, _ in reversed(lines)).endswith(f"({note}; {note})")
    assert all(float(left) >= pilot.rects["viewport.rendered"].x0 for _, left in lines)
