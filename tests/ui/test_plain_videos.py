"""A folder of plain videos goes from the first screen to a trained clip, by keyboard, in a real session and window.

The calibration itself is made up: it writes the cameras as they are known, and has tests of its own.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pyglet.window import key

from app.calibration.job import CalibrationRequest
from app.session.session import Session
from app.session.training.train_commands import TrainNextClip
from engine.assets import asset_path
from engine.capture.capture import open_capture
from engine.capture.frames import VideoFrames
from engine.capture.writers.capture_json import capture_document, write_capture_json
from tests.ui.pilot import CTRL, Pilot
from tests.ui.real_session import draw_until, make_session
from ui.shell.screenshot import write_png
from ui.viewport.hud_text import RENDERED

pytestmark = [pytest.mark.gl, pytest.mark.slow]
N_CAMERAS = 6


def calibrated(request: CalibrationRequest) -> Callable[[Any], Any]:
    """The work of a job that knows the cameras of the sample already."""

    def work(context: Any) -> Any:
        context.report(0.5, "Matching - about 0:10 left")
        layout = open_capture(asset_path("sample")).layout
        cameras = tuple(
            replace(entry, source=VideoFrames(request.videos / f"{entry.name}.mp4", layout.n_frames))
            for entry in layout.cameras[:N_CAMERAS]
        )
        known = replace(layout, cameras=cameras, default_holdout=())
        write_capture_json(request.videos, capture_document(known, request.videos))
        found = SimpleNamespace(found=SimpleNamespace(rig=range(N_CAMERAS), doubts=("",) * N_CAMERAS), missing=())
        lines = (f"{N_CAMERAS} of {N_CAMERAS} cameras were found.",)
        return SimpleNamespace(
            capture=request.videos, needs_links=False, calibration=found, lines=lines, is_written=True
        )

    return work


def state_of(session: Session) -> str:
    """Of the calibration; empty where none is shown."""
    return "" if session.calibrating.page is None else session.calibrating.page.state


def keep(pilot: Pilot, folder: Path, name: str) -> None:
    """Write what stands in the window, to be looked at."""
    pilot.draw(3)
    image = pilot.picture()
    write_png(image, folder / f"{name}.png")
    assert image.std() > 5.0
    assert [notice for notice in pilot.session.notices if notice.kind == "error"] == []


def test_from_plain_videos_to_a_trained_clip(
    open_pilot: Callable[..., Pilot], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.shell.dialogs.dialogs.has_native_dialog", lambda: False)
    monkeypatch.setattr("app.session.captures.calibrating.calibration_work", calibrated)
    videos = tmp_path / "plain videos"
    videos.mkdir()
    for row in range(N_CAMERAS):
        shutil.copy(asset_path("sample") / f"cam{row:02d}.mp4", videos)
    session = make_session(tmp_path)
    pilot = open_pilot(session)

    # the folder is not a capture; that leads to its calibration
    pilot.key(key.O, modifiers=(CTRL,))
    pilot.draw(3)
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.type(str(videos))
    pilot.key(key.RETURN)
    draw_until(pilot, lambda: session.opening.refused is not None, "why it does not open")
    keep(pilot, tmp_path, "refused")
    pilot.key(key.RETURN)
    draw_until(pilot, lambda: state_of(session) == "asking", "its cameras")
    keep(pilot, tmp_path, "calibration")
    pilot.key(key.RETURN)
    draw_until(pilot, lambda: state_of(session) == "done", "the calibration")
    keep(pilot, tmp_path, "calibrated")

    # what it is now, and what is asked
    pilot.key(key.RETURN)
    draw_until(pilot, lambda: session.opening.page is not None, "the report")
    draw_until(pilot, lambda: len(session.opening.pictures) == N_CAMERAS, "the small pictures")
    page = session.opening.page
    assert page is not None
    assert len(page.answers.holdout) == 1
    keep(pilot, tmp_path, "report")
    pilot.click("opening.last")
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.type("7")
    pilot.key(key.RETURN)
    pilot.click("opening.clip_length")
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.type("4")
    pilot.key(key.RETURN)
    pilot.key(key.RETURN)
    draw_until(pilot, lambda: session.capture is not None, "the capture")
    assert session.capture is not None
    assert (session.capture.n_frames, len(session.clips)) == (8, 2)
    assert len(session.holdout) == 1
    keep(pilot, tmp_path, "opened")

    session.dispatch(TrainNextClip())
    draw_until(pilot, lambda: session.clip_states[0].state == "trained", "the reference clip")
    draw_until(pilot, lambda: pilot.studio.frame.viewport.scene.shows == RENDERED, "its picture")
    keep(pilot, tmp_path, "trained")
    x, y = pilot.rects["viewport.canvas"].center
    before = session.view.world_to_camera()
    pilot.drag((x, y), (x + 60, y + 20))
    assert not np.array_equal(before, session.view.world_to_camera())
