"""Ahead: what is decoded and drawn before anybody asks, and which frames count as ready."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from app.playback.ahead import MOST_UNASKED, Ahead
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.playback.views.orbit_view import OrbitView
from app.project.opening.opened_project import OpenedProject
from app.training.service import ShownState
from tests.app.fakes import write_trained

WAIT_S = 300.0
"""Only a hang takes longer, or the first start, which compiles the kernels."""
SIZE, FULL = (32, 24), (64, 48)


class Screen:
    """A playback that is looked at: `turn` is one turn of the loop of a window without a graphics card."""

    def __init__(self, opened: OpenedProject) -> None:
        self.states: dict[int, ShownState] = {}
        self.playback = Playback(self.states.get)
        self.playback.ahead = Ahead(self.playback.decoder, self.playback.renderer, settled_s=0.0)
        self.playback.show(opened)
        self.timeline, self.view = Timeline(opened.clips), OrbitView(opened.rig)
        for index in range(len(opened.clips)):
            self.states[index] = ShownState(write_trained(opened, index), f"state of {index}")

    def turn(self, *, is_busy: bool = False, draws: bool = True, size: tuple[int, int] = SIZE):
        picture = None
        if draws:
            picture = self.playback.render(self.timeline, self.view, *size, full_size=FULL)
        self.playback.work_ahead(self.timeline, is_busy=is_busy)
        for worker in (self.playback.decoder.worker, self.playback.renderer.worker):
            assert worker.wait_idle(WAIT_S)
        return picture

    def turns(self, n: int = 6, **options: object) -> list[tuple[int, int]]:
        """Some turns; gives what is ready then."""
        for _ in range(n):
            self.turn(**options)  # pyright: ignore[reportArgumentType]
        return self.playback.cached_frames()


@pytest.fixture
def screen(make_opened: Callable[..., OpenedProject]) -> Iterator[Screen]:
    """Two trained clips of three frames."""
    made = Screen(make_opened())
    yield made
    made.playback.close()


def test_while_it_stands_the_next_frames_become_ready_into_the_next_clip(screen: Screen):
    assert screen.playback.cached_frames() == []
    n = screen.timeline.n_frames
    assert n == 6
    assert screen.turns() == [(0, n)]
    for frame in range(n):
        screen.timeline.seek(frame)
        picture = screen.playback.render(screen.timeline, screen.view, *SIZE, full_size=FULL)
        assert picture is not None
        assert (picture.is_stale, picture.source.frame_index) == (False, frame), (
            "a frame that counts as ready is shown at once"
        )
        assert picture.size == (FULL if frame else SIZE), "sharp ones follow; the window itself asks for that of now"


def test_without_pictures_frames_are_ready_when_they_are_decoded(screen: Screen):
    screen.playback.frame(screen.timeline)
    assert screen.turns(draws=False) == [(0, 6)]
    assert screen.playback.renderer.worker.newest is None


def test_beside_a_training_nothing_is_made_ahead_until_it_plays(screen: Screen):
    assert screen.turns(is_busy=True) == [(0, 1)]
    screen.timeline.toggle_play()
    assert screen.turns(is_busy=True) == [(0, 6)]


def test_another_view_or_state_has_nothing_ready(screen: Screen):
    screen.turns()
    screen.view.orbit(40.0, 0.0)
    screen.turn(is_busy=True)
    assert screen.turns(1, is_busy=True) == [(0, 1)], "only what was drawn from here"
    screen.view.orbit(-40.0, 0.0)
    screen.turns(1)
    state = screen.states[1]
    screen.states[1] = ShownState(state.file, "another state")
    assert screen.playback.cached_frames() == [(0, 3)]


def test_a_snapshot_is_not_decoded_ahead_while_it_stands(screen: Screen):
    screen.states[1] = ShownState(screen.states[1].file, "live", is_live=True)
    assert screen.turns() == [(0, 3)]


def test_around_a_seam_every_frame_is_loaded_before_it_plays(screen: Screen):
    timeline, playback = screen.timeline, screen.playback
    timeline.toggle_around()
    assert (timeline.around, timeline.plays_every_frame) == ((0, 5), True)
    seen = []
    for _ in range(8):
        screen.turn(size=FULL)
        seen.append(playback.loading)
    assert seen[0] is not None
    assert seen[0] < (6, 6)
    assert [n for n in seen if n is not None] == sorted(n for n in seen if n is not None)
    assert seen[-1] is None, "all are there"
    assert playback.cached_frames() == [(0, 6)]
    screen.view.orbit(10.0, 0.0)
    screen.turn(size=FULL)
    assert playback.loading is None, "another view does not hold up what plays already"
    timeline.toggle_around()
    screen.turn(size=FULL)
    screen.view.orbit(10.0, 0.0)
    timeline.toggle_around()
    screen.turn(size=FULL)
    assert playback.loading is not None, "of this view frames are missing"
    timeline.toggle_every_frame()
    screen.turn(size=FULL)
    assert playback.loading is None, "who leaves frames out need not wait"
    assert not timeline.is_every_frame


def test_a_seam_of_which_a_clip_is_damaged_still_plays(screen: Screen):
    screen.states[1].file.write_bytes(b"not a clip")
    screen.timeline.toggle_around()
    for _ in range(8):
        screen.turn(size=FULL)
    assert screen.playback.loading is None


def test_what_is_asked_is_not_held_up_by_what_fails_ahead(screen: Screen):
    screen.states[1].file.write_bytes(b"not a clip")
    assert screen.turns() == [(0, 3)]
    assert screen.playback.take_failures() == [], "nobody has looked at it yet"
    screen.timeline.seek(3)
    screen.turn()
    (failure,) = screen.playback.take_failures()
    assert failure.title == "The clip cannot be shown"


def test_no_more_is_made_ahead_than_memory_holds(make_opened: Callable[..., OpenedProject]):
    screen = Screen(make_opened())
    decoder = screen.playback.decoder
    screen.playback.frame(screen.timeline)
    assert decoder.worker.wait_idle(WAIT_S)
    n_bytes = decoder._cache.n_bytes
    decoder._cache.max_bytes = int(4.5 * n_bytes)
    screen.timeline.toggle_play()
    began = decoder.worker.n_ahead
    assert screen.turns(10, draws=False) == [(0, 3)]
    assert decoder.worker.n_ahead - began == 2, "what was made is not thrown away for what comes later"
    screen.playback.close()


def test_a_moving_view_is_not_held_up(screen: Screen):
    screen.playback.ahead = Ahead(screen.playback.decoder, screen.playback.renderer, settled_s=1e6)
    assert screen.turns() == [(0, 1)]


def test_only_a_pause_after_work_ahead_is_news(screen: Screen):
    screen.turns()
    before = screen.playback.finished
    screen.view.orbit(30.0, 0.0)
    screen.turns(2)
    assert screen.playback.finished != before
    assert screen.playback.finished == screen.playback.finished


def test_a_place_that_is_no_more_is_forgotten(screen: Screen):
    screen.turns()
    assert screen.playback.cached_frames() == [(0, 6)]
    screen.playback.renderer.clear()
    screen.turns(3, draws=False, is_busy=True)
    assert screen.playback.cached_frames() == [], "for a while it may only be late"
    screen.turns(MOST_UNASKED, draws=False, is_busy=True)
    assert screen.playback.cached_frames() == [(0, 6)], "nobody asks for pictures: what is decoded is ready"


def test_captured_pictures_that_are_compared_come_ahead_while_it_plays(screen: Screen):
    playback = screen.playback

    def turn() -> None:
        playback.compared_picture(screen.timeline, 1, 640)
        screen.turn()
        assert playback.captured.viewing.wait_idle(WAIT_S)

    turn()
    assert playback.captured.viewing.n_ahead == 0
    screen.timeline.toggle_play()
    for _ in range(3):
        turn()
    assert playback.captured.viewing.n_ahead == screen.timeline.n_frames - 1
    for frame in range(screen.timeline.n_frames):
        screen.timeline.seek(frame)
        picture = playback.compared_picture(screen.timeline, 1, 640)
        assert picture is not None
        assert (picture.is_stale, picture.source.frame_index) == (False, frame)
    assert playback.take_failures() == []
