"""Commands that select, one after the other, on frames that change meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from app.session.editing.attributes import ATTRIBUTES, AnchorValues, values_of
from app.session.editing.selecting import ProjectSelecting
from app.session.editing.selection_commands import (
    Brush,
    ClearSelection,
    GrowSelection,
    How,
    InvertSelection,
    Lasso,
    Rectangle,
    Reselect,
    SelectAll,
    SelectAnchor,
    SelectByAttribute,
    SelectFlood,
    SelectInPicture,
    SelectVolume,
    ShrinkSelection,
)
from engine.editing.edit import Box, Sphere
from engine.editing.selection.seen_from import SeenFrom
from engine.editing.selection.set_algebra import SelectMode
from engine.errors import ProjectError
from tests.app.session.editing.made_frames import MadeShown, answer, frame, settle


@pytest.fixture(autouse=True)
def compiles_nothing_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.background.kernels.warm_cache", lambda: None)


@pytest.fixture
def shown() -> MadeShown:
    return MadeShown()


@pytest.fixture
def selecting(shown: MadeShown) -> Iterator[ProjectSelecting]:
    made = ProjectSelecting(shown)
    yield made
    made.close()


def chosen(selecting: ProjectSelecting) -> list[int]:
    """Rows of the shown frame that are selected once everything was found."""
    settle(selecting)
    gaussians = selecting._shown.selectable()
    assert gaussians is not None
    return np.flatnonzero(selecting.mask(gaussians)).tolist()


def from_above(x: float = 20.0) -> SeenFrom:
    """Looks along z at a place of the line from 50 units away; ten pixels to a unit."""
    pose = np.eye(4)
    pose[:3, 3] = -x, 0.0, 50.0
    return SeenFrom(pose, np.array([[500.0, 0, 100], [0, 500.0, 50], [0, 0, 1]]), 200, 100)


BALL = Sphere((10.0, 0.0, 0.0), 2.5)


def test_every_command_finds_what_it_says(selecting: ProjectSelecting) -> None:
    everything = list(range(50))
    view = from_above()
    whole = How(is_whole_anchors=True)
    corners = ((45.0, 0.0), (75.0, 0.0), (75.0, 99.0), (45.0, 99.0))
    for command, rows in (
        (SelectAll(), everything),
        (SelectInPicture(Rectangle(45.0, 0.0, 75.0, 99.0), view), [15, 16, 17]),
        (SelectInPicture(Lasso(corners), view, is_visible_only=True), [15, 16, 17]),
        (SelectInPicture(Brush(((50.0, 50.0),), 1.0), view), [15]),
        (SelectInPicture(Rectangle(51.5, 0.0, 58.8, 99.0), view, is_by_extent=True), [15, 16]),
        (SelectVolume(BALL), [8, 9, 10, 11, 12]),
        (SelectVolume(Box((10.0, 0.0, 0.0), (1.0, 1.0, 1.0)), whole), [8, 9, 10, 11]),
        (SelectVolume(Sphere((10.0, 0.0, 0.0), 0.85), is_by_extent=True), [9, 10, 11]),
        (SelectFlood((4.2, 1.0, 0.0), 1.1, 0.1), list(range(40))),
        (SelectFlood((104.0, 0.0, 0.0), 1.1, 0.1), list(range(40, 50))),
        (SelectAnchor((7.0, 0.3, 0.0)), [6, 7]),
        (SelectByAttribute("motion", 1.0, 1.0), list(range(40, 50))),
        (GrowSelection(1.5), list(range(40, 50))),
        (SelectVolume(BALL), [8, 9, 10, 11, 12]),
        (GrowSelection(1.5), list(range(7, 14))),
        (ShrinkSelection(1.5), [8, 9, 10, 11, 12]),
        (InvertSelection(), [*range(8), *range(13, 50)]),
        (ClearSelection(), []),
        (Reselect(), [*range(8), *range(13, 50)]),
        (Reselect(), []),
    ):
        selecting.apply(command)
        assert chosen(selecting) == rows, command


def test_modes_act_on_what_was_selected_before(selecting: ProjectSelecting) -> None:
    selecting.apply(SelectVolume(BALL))
    steps: tuple[tuple[SelectMode, float, list[int]], ...] = (
        ("add", 14.0, list(range(8, 17))),
        ("subtract", 10.0, [13, 14, 15, 16]),
        ("intersect", 16.0, [14, 15, 16]),
        ("replace", 3.0, [1, 2, 3, 4, 5]),
    )
    for mode, center, rows in steps:
        selecting.apply(SelectVolume(Sphere((center, 0.0, 0.0), 2.5), How(mode)))
        assert chosen(selecting) == rows, mode


def test_commands_that_come_quickly_are_all_carried_out_in_order(selecting: ProjectSelecting) -> None:
    for center in range(0, 40, 4):
        selecting.apply(SelectVolume(Sphere((center, 0.0, 0.0), 0.5), How("add")))
    selecting.apply(InvertSelection())
    selecting.apply(SelectVolume(Sphere((0.0, 0.0, 0.0), 2.5), How("intersect")))
    assert chosen(selecting) == [1, 2]
    selecting.apply(SelectVolume(BALL))
    selecting.apply(ClearSelection())
    assert chosen(selecting) == []


def test_a_selection_outlives_the_frame_and_reaches_other_clips(selecting: ProjectSelecting, shown: MadeShown) -> None:
    selecting.apply(SelectVolume(BALL))
    shown.gaussians = frame(1, hidden=9)  # the command still acts on the frame that was shown when it came
    assert chosen(selecting) == [0, 1, 2, 3]  # 8 is hidden here
    status = selecting.status()
    assert (status.n_gaussians, status.n_shown) == (5, 4)
    assert status.words == "5 Gaussians, 3 anchors, 1 clip"
    selecting.apply(SelectByAttribute("clip", 1.0, 1.0, How("add")))
    assert chosen(selecting) == [0, 1, 2, 3, *range(31, 41)]
    shown.gaussians = frame(0)
    assert chosen(selecting) == [8, 9, 10, 11, 12]
    assert selecting.status().words == "15 Gaussians, 8 anchors, 2 clips"
    selecting.apply(InvertSelection())
    assert len(chosen(selecting)) == 45
    assert selecting.status().n_gaussians == 45  # what is not shown here is not selected afterwards


def test_growing_leaves_what_is_not_shown_selected(selecting: ProjectSelecting, shown: MadeShown) -> None:
    selecting.apply(SelectAll())
    settle(selecting)
    selecting.apply(SelectVolume(Sphere((105.0, 0.0, 0.0), 20.0)))
    settle(selecting)
    shown.gaussians = frame(1)
    selecting.apply(SelectVolume(BALL, How("add")))
    selecting.apply(GrowSelection(1.5))
    assert chosen(selecting) == list(range(7, 14))
    shown.gaussians = frame(0)
    assert chosen(selecting) == [*range(7, 14), *range(40, 50)]


def test_there_has_to_be_something_to_select(selecting: ProjectSelecting, shown: MadeShown) -> None:
    gaussians = shown.gaussians
    assert gaussians is not None
    for nothing in (None, replace(gaussians, rows=None)):
        shown.gaussians = nothing
        assert not selecting.status().can_select
        with pytest.raises(ProjectError, match="No Gaussians to select"):
            selecting.apply(SelectAll())
        selecting.apply(ClearSelection())  # always possible
    shown.gaussians = gaussians
    with pytest.raises(ProjectError, match="'weight' is not an attribute"):
        selecting.apply(SelectByAttribute("weight", 0.0, 1.0))


def test_what_cannot_be_found_is_told_and_the_rest_goes_on(selecting: ProjectSelecting) -> None:
    broken = SelectInPicture("no shape", from_above())  # pyright: ignore[reportArgumentType]
    selecting.apply(broken)
    selecting.apply(SelectVolume(BALL))
    assert chosen(selecting) == [8, 9, 10, 11, 12]
    assert selecting.take_error() is not None
    assert selecting.take_error() is None


def test_another_project_begins_with_nothing(selecting: ProjectSelecting) -> None:
    selecting.apply(SelectAll())
    settle(selecting)
    selecting.apply(SelectVolume(BALL))
    selecting.forget()
    assert chosen(selecting) == []
    assert not selecting.status().has_before
    selecting.apply(Reselect())
    assert chosen(selecting) == []


def test_attributes_of_every_kind(shown: MadeShown) -> None:
    gaussians = shown.gaussians
    assert gaussians is not None
    anchors = AnchorValues(gaussians.means[::2] + np.float32(0.4), np.arange(25, dtype=np.float32))
    for name in ATTRIBUTES:
        assert values_of(name, gaussians, anchors).shape == (50,)
    np.testing.assert_array_equal(values_of("error", gaussians, anchors), np.arange(50) // 2)
    assert values_of("clip", frame(1)).tolist() == [0.0] * 40 + [1.0] * 10
    assert values_of("birth", gaussians).tolist() == [0.0] * 40 + [2.0] * 10
    assert values_of("size", gaussians) == pytest.approx(0.1)
    assert np.isnan(values_of("flicker", gaussians)).all()
    assert np.isnan(values_of("clip", replace(gaussians, rows=None))).all()
    left = replace(gaussians, **{name: getattr(gaussians, name)[1:] for name in ("means", "opacities")})
    assert values_of("error", left, anchors)[[0, 20, 48]].tolist() == [0.0, 10.0, 24.0]  # of the nearest anchor
    with pytest.raises(ValueError, match="attributes are"):
        values_of("weight", gaussians)


def test_by_residual_and_how_it_is_spread(selecting: ProjectSelecting, shown: MadeShown) -> None:
    selecting.apply(SelectByAttribute("error", 0.0, 100.0))
    assert chosen(selecting) == []  # not known yet
    shown.values = np.where(np.arange(25) < 5, np.nan, np.arange(25)).astype(np.float32)
    selecting.apply(SelectByAttribute("error", 20.0, 100.0))
    assert chosen(selecting) == list(range(40, 50))
    spread = answer(lambda: selecting.spread("error"))
    assert (spread.low, spread.high, spread.n_unknown, spread.counts.sum()) == (5.0, 24.0, 10, 40)
    shown.values = np.full(25, 3.0, np.float32)
    answer(lambda: ((spread := selecting.spread("error")) is not None and spread.low == 3.0) or None)
    with pytest.raises(ValueError, match="attributes are"):
        selecting.spread("weight")


def test_where_selected_ones_are_seen(selecting: ProjectSelecting, shown: MadeShown) -> None:
    gaussians, view = shown.gaussians, from_above(10.0)
    assert gaussians is not None
    assert selecting.share(gaussians, view, 0) is None  # nothing is selected
    selecting.apply(SelectVolume(Sphere((10.0, 0.0, 0.0), 0.5)))
    settle(selecting)
    share = answer(lambda: selecting.share(gaussians, view, 0))
    row, column = np.unravel_index(share.argmax(), share.shape)
    assert (row + 0.5) / share.shape[0] == pytest.approx(0.5, abs=0.02)
    assert (column + 0.5) / share.shape[1] == pytest.approx(0.5, abs=0.02)
    assert selecting.share(gaussians, from_above(11.0), 0) is None  # another view, another map


def test_it_is_known_in_which_picture_somebody_has_selected(selecting: ProjectSelecting) -> None:
    view, other = from_above(), from_above(21.0)
    strip = Rectangle(45.0, 0.0, 75.0, 99.0)
    for command, expected in (
        (SelectInPicture(strip, view), view),
        (SelectInPicture(strip, from_above(), How("add")), view),
        (SelectInPicture(strip, other, How("subtract")), None),
        (SelectInPicture(strip, other), other),
        (GrowSelection(1.5), None),
        (SelectInPicture(strip, other), other),
        (SelectVolume(BALL), None),
        (SelectInPicture(strip, view, How("add")), None),
        (SelectInPicture(strip, view), view),
        (ClearSelection(), None),
    ):
        selecting.apply(command)
        settle(selecting)
        found = selecting.seen_from
        assert (found is None) == (expected is None), command
        if found is not None and expected is not None:
            assert np.array_equal(found.world_to_camera, expected.world_to_camera)
