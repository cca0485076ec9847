"""What the window says of its picture against what is in it: real session, project and files in a headless window."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pyglet.window import key

import app.playback.ahead
import app.playback.frame_decoder
from app.playback.render import Picture, RenderRequest
from app.session.projects.project_commands import OpenCapture
from app.session.projects.setting_commands import SetClipLength
from app.session.showing.look_commands import LookThrough, SetCompare, SetFrame
from app.session.training.train_commands import TrainClip
from engine.clip_files.clip_state import ClipState
from tests.app.fakes import N_ANCHORS, write_capture
from tests.ui.pilot import Pilot
from tests.ui.real_session import WAIT_S, draw_until, hud, make_session, poll
from ui.panels.picture.hud import legend_rows
from ui.shell.screenshot import read_window
from ui.viewport.hud_text import CLOUD, RENDERED

pytestmark = [pytest.mark.gl, pytest.mark.slow]


@pytest.fixture
def trained(tmp_path: Path) -> tuple[Path, Path]:
    """A capture of two clips of three frames and its project, both clips trained."""
    capture, project = write_capture(tmp_path / "ring"), tmp_path / "project"
    session = make_session(tmp_path)
    session.dispatch(OpenCapture(capture))
    poll(session, lambda: session.capture is not None)
    session.dispatch(SetClipLength(3))
    for index in (0, 1):
        session.dispatch(TrainClip(index))
    poll(session, lambda: [state.state for state in session.clip_states] == ["trained", "trained"])
    session.close()
    return capture, project


class Reader:
    """Stands between playback and its files: reads them, and keeps what it read until it may go on."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.may_go_on = threading.Event()
        self.may_go_on.set()
        read = app.playback.frame_decoder.read_clip_state

        def read_and_wait(path: Path) -> ClipState:
            state = read(path)
            assert self.may_go_on.wait(WAIT_S)
            return state

        monkeypatch.setattr(app.playback.frame_decoder, "read_clip_state", read_and_wait)
        monkeypatch.setattr(app.playback.ahead, "STANDING", 0)  # else the next clip is read before it is asked for


@pytest.fixture
def reader(monkeypatch: pytest.MonkeyPatch) -> Iterator[Reader]:
    made = Reader(monkeypatch)
    yield made
    made.may_go_on.set()


@pytest.fixture
def window(
    trained: tuple[Path, Path], tmp_path: Path, reader: Reader, open_pilot: Callable[..., Pilot]
) -> Iterator[Pilot]:
    """The trained project open in a window that shows frame 0 from the side."""
    session = make_session(tmp_path)
    pilot = open_pilot(session)
    session.dispatch(OpenCapture(trained[0]))
    draw_until(pilot, lambda: session.capture is not None, "the capture")
    yield pilot
    reader.may_go_on.set()


def picture(pilot: Pilot) -> np.ndarray:
    """The middle of the viewport, without what is written over it."""
    rect = pilot.rects["viewport.canvas"]
    image = read_window(pilot.studio.ctx, pilot.studio.window.width, pilot.studio.window.height)
    return image[int(rect.y0) + 60 : int(rect.y1) - 100, int(rect.x0) + 20 : int(rect.x1) - 20].copy()


def show_frame(pilot: Pilot, frame_index: int) -> None:
    """Go there and wait until nothing is on its way."""
    pilot.session.dispatch(SetFrame(frame_index))

    def is_there() -> bool:
        return f"frame {frame_index}   " in hud(pilot).label and "viewport.busy" not in pilot.rects

    pilot.draw(2)
    draw_until(pilot, is_there, f"frame {frame_index}")
    assert pilot.studio.frame.viewport.scene.shows == RENDERED


def test_another_clip_that_loads_leaves_label_and_picture_together(window: Pilot, reader: Reader) -> None:
    show_frame(window, 0)
    before = picture(window)
    reader.may_go_on.clear()
    window.key(key.DOWN)
    assert window.session.timeline.frame_index == 3
    window.draw(10)
    assert np.array_equal(picture(window), before), "clip 1 cannot be there: its file is not read yet"
    assert hud(window).label.startswith("clip 0   frame 0   ")
    assert hud(window).pending == "showing frame 0 of clip 0, clip 1 is being loaded"
    assert "viewport.busy" in window.rects
    reader.may_go_on.set()
    draw_until(window, lambda: hud(window).label.startswith("clip 1   frame 3   "), "clip 1")
    draw_until(window, lambda: hud(window).pending == "", "the end of it")
    assert not np.array_equal(picture(window), before), "clip 1 has anchors of its own"


def test_a_cloud_stands_in_for_a_clip_that_loads_and_says_what_is_missing(window: Pilot, reader: Reader) -> None:
    scene = window.studio.frame.viewport.scene
    show_frame(window, 0)
    window.key(key._4)
    draw_until(window, lambda: scene.shows == CLOUD, "the cloud")
    window.key(key._4)
    show_frame(window, 0)
    reader.may_go_on.clear()
    window.session.playback.decoder.clear()  # as when the project was just opened
    window.session.playback.renderer.clear()
    window.draw(3)
    assert scene.shows == CLOUD
    assert hud(window).pending == "loading clip 0"
    assert hud(window).note == "point cloud of static parts, not the trained result"
    reader.may_go_on.set()
    draw_until(window, lambda: scene.shows == RENDERED, "the trained picture")
    assert hud(window).note == ""


@pytest.mark.parametrize("mode", ["side", "wipe"])
def test_compared_pictures_of_different_frames_say_so(
    mode: str, window: Pilot, reader: Reader, monkeypatch: pytest.MonkeyPatch
) -> None:
    labels: list[str] = []

    def note(draw: object, x: float, y: float, text: str, **_: object) -> float:
        labels.append(text)
        return x

    monkeypatch.setattr("ui.panels.picture.picture_pane.chip", note)
    show_frame(window, 0)
    window.session.dispatch(LookThrough(1))
    window.session.dispatch(SetCompare(mode))
    show_frame(window, 0)
    draw_until(window, lambda: labels[-2:] == ["Captured, frame 0", "Rendered, frame 0"], "both of one frame")
    reader.may_go_on.clear()
    window.session.dispatch(SetFrame(3))
    warned = ["Captured, frame 3 (not the same frame)", "Rendered, frame 0 (not the same frame)"]
    draw_until(window, lambda: labels[-2:] == warned, "the warning")
    reader.may_go_on.set()
    draw_until(window, lambda: labels[-2:] == ["Captured, frame 3", "Rendered, frame 3"], "both of the next")


def test_table_legend_and_arrays_count_the_same_anchors(window: Pilot) -> None:
    session = window.session
    counts = [(status.n_inherited, status.n_own) for status in session.clip_states]
    assert counts == [(0, N_ANCHORS), (N_ANCHORS, N_ANCHORS)], "of the header, as nothing was looked at yet"
    window.key(key._2)
    window.key(key._3)
    for frame_index, expected in ((0, ["12 reference anchors"]), (3, ["12 inherited anchors", "12 residual anchors"])):
        show_frame(window, frame_index)
        scene = window.studio.frame.viewport.scene
        assert [text for _, _, text in legend_rows(session, scene)] == expected
        anchors = session.shown_anchors()
        assert (len(anchors.inherited_positions), len(anchors.own_positions)) == counts[frame_index // 3]


def test_playing_every_frame_shows_each_one(window: Pilot) -> None:
    show_frame(window, 0)
    window.key(key.SPACE, modifiers=(key.LSHIFT,))
    window.key(key.SPACE)
    seen: list[int] = []

    def is_round() -> bool:
        shown = window.studio.frame.viewport.scene.shown.source.frame_index
        if shown is not None and (not seen or seen[-1] != shown):
            seen.append(shown)
        return len(seen) > 7

    draw_until(window, is_round, "once round the loop")
    assert [(after - before) % 6 for before, after in pairwise(seen)] == [1] * (len(seen) - 1)
    assert hud(window).rate.endswith("every frame")


def test_playback_tells_the_rate_that_is_seen_and_that_frames_are_skipped(window: Pilot) -> None:
    """The clock of the playhead runs ten times faster than the window: nine of ten frames are left out."""
    show_frame(window, 0)
    window.key(key.SPACE)
    window.session.timeline.fps = 300.0
    draw_until(window, lambda: "every " in hud(window).rate, "a rate")
    assert re.search(r" of 300 fps, every \d+(st|nd|rd|th) frame$", hud(window).rate)
    assert 0.0 < float(hud(window).rate.partition(" ")[0]) < 100.0


def test_the_cloud_key_does_something_on_a_trained_clip_and_says_what(window: Pilot) -> None:
    show_frame(window, 0)
    before = picture(window)
    window.key(key._4)
    draw_until(window, lambda: window.studio.frame.viewport.scene.shows == CLOUD, "the cloud")
    assert hud(window).note == "point cloud, not the trained result (4 switches)"
    assert not np.array_equal(picture(window), before)
    window.key(key.SPACE)
    window.draw(40)
    assert hud(window).rate == "", "a cloud does not change, so no rate of pictures is shown"
    window.key(key.SPACE)
    window.session.dispatch(SetFrame(0))
    window.key(key._4)
    draw_until(window, lambda: window.studio.frame.viewport.scene.shows == RENDERED, "the picture again")
    assert hud(window).note == ""


def test_a_view_that_moved_is_being_redrawn_and_the_resolution_is_told(
    window: Pilot, monkeypatch: pytest.MonkeyPatch
) -> None:
    show_frame(window, 0)
    may_draw = threading.Event()  # small pictures may be finished before the window is drawn once
    worker = window.session.playback.renderer.worker
    draw_picture = worker._compute

    def wait_and_draw(request: RenderRequest) -> Picture:
        assert may_draw.wait(WAIT_S)
        return draw_picture(request)

    monkeypatch.setattr(worker, "_compute", wait_and_draw)
    scene = window.studio.frame.viewport.scene
    full = scene.shown.size
    assert f"{full[0]} x {full[1]}" in hud(window).label
    window.session.view.orbit(50, 0)
    window.studio.frame.request_redraw()
    window.draw(1)
    assert hud(window).pending == "being redrawn from here"
    may_draw.set()
    draw_until(window, lambda: hud(window).pending == "", "the new picture")
    assert scene.shown.source.look == window.session.view.look_key
