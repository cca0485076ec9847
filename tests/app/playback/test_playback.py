"""Playback: what is shown of a project at a playhead and from a view. Real tiny clips on disk, real decoding."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from app.playback.orbit_view import OrbitView
from app.playback.picture_source import PictureSource
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.project.opened_project import OpenedProject
from app.training.service import ShownState
from tests.app.fakes import N_ANCHORS, N_STEPS, write_trained

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
    assert not shown.playback.is_loaded(shown.timeline)
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
    assert not shown.playback.is_loaded(shown.timeline)


def test_other_settings_of_the_same_project_keep_what_was_made(shown: Shown, make_opened):
    opened = make_opened()
    shown.open(opened)
    assert shown.playback.captured_picture(1, 0, 640) is None
    shown.wait()
    shown.playback.show(opened)
    assert shown.playback.captured_picture(1, 0, 640) is not None


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
