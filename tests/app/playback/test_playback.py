"""Playback: what is shown of a project at a playhead and from a view. Real tiny clips on disk, real decoding."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from app.playback.modes.arrays import Picture
from app.playback.modes.view_modes import ShownAs
from app.playback.picture_source import PictureSource
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.playback.views.orbit_view import OrbitView
from app.project.opening.opened_project import OpenedProject
from app.training.service import ShownState
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from engine.images.exposure_curve import to_reference
from tests.app.fakes import N_ANCHORS, N_STEPS, write_trained
from tests.clip_headers import with_header

WAIT_S = 300.0
"""Only a hang takes longer, or the first start, which compiles the kernels."""
SIZE = (32, 24)


class Shown:
    """A playback with a playhead and a view; `states` says which clips have a state."""

    def __init__(self) -> None:
        self.states: dict[int, ShownState] = {}
        self.playback = Playback(self.states.get)
        self.timeline, self.view = Timeline(), OrbitView()

    def open(self, opened: OpenedProject) -> None:
        self.playback.show(opened)
        self.timeline, self.view = Timeline(opened.clips), OrbitView(opened.rig)
        self.states.clear()

    def train(self, opened: OpenedProject, clip_index: int, *, is_live: bool = False) -> Path:
        path = write_trained(opened, clip_index)
        self.states[clip_index] = ShownState(path, f"state of {clip_index}", is_live)
        return path

    def wait(self) -> None:
        for worker in self.playback.workers:
            assert worker.wait_idle(WAIT_S)


@pytest.fixture
def shown() -> Iterator[Shown]:
    made = Shown()
    yield made
    made.playback.close()


def test_without_a_project_there_is_nothing(shown: Shown):
    playback, timeline, view = shown.playback, shown.timeline, shown.view
    assert playback.frame(timeline) is None
    assert playback.wanted(timeline, view) is None
    assert playback.cloud(view) is None
    assert playback.render(timeline, view, *SIZE) is None
    assert playback.captured_picture(0, 0, 32) is None
    assert not playback.is_loaded(timeline)


def test_a_trained_frame_comes_at_a_later_call_and_says_what_it_is(shown: Shown, make_opened):
    opened = make_opened()
    shown.open(opened)
    for index in (0, 1):
        shown.train(opened, index)
    shown.timeline.seek(4)
    assert shown.playback.frame(shown.timeline) is None
    shown.wait()
    frame = shown.playback.frame(shown.timeline)
    assert frame is not None
    assert frame.gaussians.source == PictureSource(1, 4, "state of 1", N_STEPS, True)
    assert (len(frame.anchors.inherited_positions), len(frame.anchors.own_positions)) == (N_ANCHORS, N_ANCHORS)
    assert shown.playback.is_loaded(shown.timeline)


def test_what_is_wanted_is_told_apart_from_what_is_there(shown: Shown, make_opened):
    opened = make_opened()
    shown.open(opened)
    shown.view.look(2)
    untrained = shown.playback.wanted(shown.timeline, shown.view)
    assert untrained is not None
    assert (untrained.clip_index, untrained.revision, untrained.camera_index) == (0, "", 2)
    shown.train(opened, 0)
    before = shown.playback.wanted(shown.timeline, shown.view)
    assert before is not None
    assert (before.revision, before.is_loaded, before.has_failed) == ("state of 0", False, False)
    shown.playback.frame(shown.timeline)
    shown.wait()
    after = shown.playback.wanted(shown.timeline, shown.view)
    assert after is not None
    assert after.is_loaded


def test_a_rendered_picture_carries_the_frame_and_the_view(shown: Shown, make_opened):
    opened = make_opened()
    shown.open(opened)
    shown.train(opened, 0)
    shown.view.look(1)
    picture = None
    for _ in range(3):  # decode, then draw
        picture = shown.playback.render(shown.timeline, shown.view, *SIZE)
        shown.wait()
    assert picture is not None
    assert (picture.size, picture.is_stale) == (SIZE, False)
    assert picture.source == PictureSource(0, 0, "state of 0", N_STEPS, True, 1, shown.view.look_key)
    assert np.ptp(picture.image) > 0, "the anchors are in it"
    shown.timeline.seek(2)
    other = shown.playback.render(shown.timeline, shown.view, *SIZE)
    assert other is not None
    assert (other.is_stale, other.source.frame_index) == (True, 0)


def test_the_next_project_shows_nothing_of_the_one_before(shown: Shown, make_opened):
    first, second = make_opened("a"), make_opened("b", generation=2)
    shown.open(first)
    shown.train(first, 0)
    for _ in range(3):
        shown.playback.render(shown.timeline, shown.view, *SIZE)
        shown.playback.captured_picture(1, 0, 640)
        shown.playback.cloud(shown.view)
        shown.wait()
    assert shown.playback.captured_picture(1, 0, 640) is not None
    shown.open(second)
    shown.train(second, 0)  # the same revision of the same clip
    assert shown.playback.frame(shown.timeline) is None
    assert shown.playback.render(shown.timeline, shown.view, *SIZE) is None
    assert shown.playback.captured_picture(1, 0, 640) is None
    assert shown.playback.cloud(shown.view) is None


def test_other_settings_of_the_same_project_keep_what_was_made(shown: Shown, make_opened):
    opened = make_opened()
    shown.open(opened)
    assert shown.playback.captured_picture(1, 0, 640) is None
    shown.wait()
    shown.playback.show(opened)
    assert shown.playback.captured_picture(1, 0, 640) is not None


def with_colors(path: Path, gains: np.ndarray, drift: np.ndarray | None = None) -> None:
    """Write colours of the cameras 1, 2 and 3 into a clip file. gains [3, 3], drift [3, M, 3]"""
    state = with_header(read_clip_state(path), camera_names=["1", "2", "3"])
    arrays = state.arrays | ({"gains": gains} if state.is_reference else {})
    arrays |= {} if drift is None else {"log_drift": np.log(drift)}
    write_clip_state(path, ClipState(arrays, state.header))


def test_beside_the_render_of_a_trained_frame_the_captured_picture_is_in_the_scenes_colours(shown: Shown, make_opened):
    opened = make_opened()
    shown.open(opened)
    gains, drift = np.ones((3, 3), np.float32), np.ones((3, 3, 3), np.float32)
    gains[0], drift[0, 1] = (1.1, 1.0, 1.0), (0.9, 0.9, 0.9)
    names = opened.rig.names

    def compared(camera: int) -> Picture:
        shown.playback.frame(shown.timeline)
        shown.wait()
        shown.playback.compared_picture(shown.timeline, camera, 640)
        shown.wait()
        picture = shown.playback.compared_picture(shown.timeline, camera, 640)
        assert picture is not None
        assert not picture.is_stale
        return picture

    taken = compared(names.index("1"))
    assert not taken.source.has_scene_colors, "nothing is trained"
    with_colors(shown.train(opened, 0), gains)
    with_colors(shown.train(opened, 1), gains, drift)
    for frame, gain in ((0, gains[0]), (3, gains[0]), (4, gains[0] * drift[0, 1])):
        shown.timeline.seek(frame)
        picture = compared(names.index("1"))
        assert picture.source.has_scene_colors
        expected = to_reference(opened.capture.frame(names.index("1"), frame), gain)
        assert np.array_equal(picture.image, expected), frame
    assert not compared(names.index("2")).source.has_scene_colors, "a camera in the scene's colours"
    held_out = compared(names.index("0"))
    assert held_out.source.has_scene_colors, "with the exposure that the others suggest"
    captured = shown.playback.captured_picture(names.index("1"), 4, 640)
    shown.wait()
    captured = shown.playback.captured_picture(names.index("1"), 4, 640)
    assert captured is not None
    assert np.array_equal(captured.image, opened.capture.frame(names.index("1"), 4)), "elsewhere as it was taken"


def test_another_state_of_a_clip_has_other_colours(shown: Shown, make_opened):
    opened = make_opened()
    shown.open(opened)
    camera = opened.rig.names.index("1")
    means = []
    for revision, red in (("a", 1.0), ("b", 1.25)):
        path = write_trained(opened, 0)
        with_colors(path, np.full((3, 3), red, np.float32))
        shown.states[0] = ShownState(path, revision, True)
        for _ in range(3):  # decode, then read
            shown.playback.frame(shown.timeline)
            picture = shown.playback.compared_picture(shown.timeline, camera, 640)
            shown.wait()
        picture = shown.playback.compared_picture(shown.timeline, camera, 640)
        assert picture is not None
        means.append(picture.image.mean())
    assert means[1] < means[0] - 10


def test_all_anchors_of_a_clip_are_known_while_it_trains_only(shown: Shown, make_opened):
    opened = make_opened()
    shown.open(opened)
    shown.train(opened, 0, is_live=True)
    assert shown.playback.live_anchors(shown.timeline) is None  # not loaded yet
    shown.playback.frame(shown.timeline)
    shown.wait()
    anchors = shown.playback.live_anchors(shown.timeline)
    assert anchors is not None
    assert len(anchors.own_positions) == N_ANCHORS
    shown.train(opened, 0)
    assert shown.playback.live_anchors(shown.timeline) is None


@pytest.mark.parametrize("is_live", [True, False])
def test_a_failure_says_what_it_came_of(shown: Shown, make_opened: Callable[..., OpenedProject], is_live: bool):
    opened = make_opened()
    shown.open(opened)
    shown.train(opened, 0, is_live=is_live).write_bytes(b"not a clip")
    shown.playback.frame(shown.timeline)
    shown.wait()
    (failure,) = shown.playback.take_failures()
    assert (failure.title, failure.is_of_clip, failure.is_live) == ("The clip cannot be shown", True, is_live)
    assert shown.playback.take_failures() == []
    wanted = shown.playback.wanted(shown.timeline, shown.view)
    assert wanted is not None
    assert wanted.has_failed


def test_what_is_finished_can_be_seen_in_one_value(shown: Shown, make_opened):
    shown.open(make_opened())
    before = shown.playback.finished
    shown.playback.captured_picture(0, 0, 16)
    shown.wait()
    assert shown.playback.finished != before
    assert shown.playback.finished == shown.playback.finished


def test_the_best_cloud_there_is_is_shown(shown: Shown, make_opened):
    opened = make_opened()
    shown.open(opened)

    def kind() -> str | None:
        shown.playback.cloud(shown.view)
        shown.wait()
        cloud = shown.playback.cloud(shown.view)
        return None if cloud is None else cloud.kind

    assert kind() == "pictures"
    shown.view.look(1)
    assert kind() is None, "the captured picture says more than the hint"
    shown.train(opened, 0)
    assert kind() == "static"


def test_two_places_show_two_modes_and_two_parts_of_one_frame(shown: Shown, make_opened: Callable[..., OpenedProject]):
    opened = make_opened()
    shown.open(opened)
    shown.train(opened, 0)
    asked = {"first": ShownAs("depth"), "second": ShownAs("birth", "f_s")}

    def pictures() -> dict[str, Picture | None]:
        return {
            place: shown.playback.render(shown.timeline, shown.view, *SIZE, shown_as=shown_as, view_id=place)
            for place, shown_as in asked.items()
        }

    for _ in range(4):
        pictures()
        shown.wait()
    for place, picture in pictures().items():
        assert picture is not None
        assert not picture.is_stale
        assert picture.source.shown_as == asked[place]
        assert (picture.values is not None) == (place == "first")
    assert not shown.playback.take_failures()


def test_an_earlier_state_of_a_clip_is_drawn_beside_the_present_one(
    shown: Shown, make_opened: Callable[..., OpenedProject], tmp_path: Path
):
    opened = make_opened()
    shown.open(opened)
    path = shown.train(opened, 0)
    state, earlier = read_clip_state(path), tmp_path / "earlier.safetensors"
    arrays = dict(state.arrays)
    arrays["sets.static.positions"] = arrays["sets.static.positions"] + np.float32(40.0)  # out of sight
    write_clip_state(earlier, ClipState(arrays, state.header).stamped())
    before = ShownState(earlier, "earlier", False)

    def both() -> tuple[Picture | None, Picture | None]:
        present = shown.playback.render(shown.timeline, shown.view, *SIZE)
        other = shown.playback.render(shown.timeline, shown.view, *SIZE, view_id="b", state_of=lambda index: before)
        return present, other

    for _ in range(4):
        both()
        shown.wait()
    present, other = both()
    assert present is not None
    assert other is not None
    assert not present.is_stale
    assert not other.is_stale
    assert (present.source.revision, other.source.revision) == ("state of 0", "earlier")
    assert present.image.std(axis=(0, 1)).max() > 5.0
    assert other.image.std(axis=(0, 1)).max() == 0.0, "nothing is in sight"
