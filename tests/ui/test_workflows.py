"""What people come for, from the first key to the last, by pointer and keys: a real session and project in a window.

Open a capture; scrub and orbit; train the reference and watch; train the rest; find flicker. A picture of each station
is written beside the test's files, to be looked at.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pyglet.window import key

from app.evaluation.evaluation import evaluate_project
from app.evaluation.headless import open_trained
from app.session.projects.setting_commands import SetClipLength
from tests.app.fakes import write_capture
from tests.ui.pilot import CTRL, SHIFT, Pilot
from tests.ui.real_session import draw_until, make_session
from ui.panels.state import RESIDUALS
from ui.shell.screenshot import write_png
from ui.viewport.hud_text import RENDERED

pytestmark = [pytest.mark.gl, pytest.mark.slow]


def keep(pilot: Pilot, folder: Path, name: str) -> np.ndarray:
    """Write what stands in the window; returns it."""
    pilot.draw(3)
    image = pilot.picture()
    write_png(image, folder / f"{name}.png")
    assert image.std() > 5.0, "there is something to be seen"
    return image


def test_from_a_folder_to_the_cause_of_flicker(
    open_pilot: Callable[..., Pilot], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.shell.dialogs.dialogs.has_native_dialog", lambda: False)
    capture, session = write_capture(tmp_path / "ring"), make_session(tmp_path)
    pilot = open_pilot(session)
    keep(pilot, tmp_path, "first")

    # open a capture
    pilot.key(key.O, modifiers=(CTRL,))
    pilot.draw(3)
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.type(str(capture))
    pilot.key(key.RETURN)
    draw_until(pilot, lambda: session.opening.page is not None, "what it is")
    keep(pilot, tmp_path, "asked")
    pilot.key(key.RETURN)
    draw_until(pilot, lambda: session.capture is not None, "the capture")
    pilot.draw(4)
    session.dispatch(SetClipLength(3))
    pilot.draw(2)
    assert session.project_status is not None
    assert session.project_status.n_clips == 2
    keep(pilot, tmp_path, "opened")

    # scrub and orbit
    track, n_frames = pilot.rects["timeline.track"], session.timeline.n_frames
    y = track.y0 + 8
    pilot.drag((track.x0 + 4, y), (track.x1 - 4, y))
    assert session.timeline.frame_index == n_frames - 1
    pilot.key(key.HOME)
    assert session.timeline.frame_index == 0
    before = session.view.world_to_camera()
    x, y = pilot.rects["viewport.canvas"].center
    pilot.drag((x, y), (x + 90, y + 20))
    assert not np.array_equal(before, session.view.world_to_camera())
    pilot.key(key.BRACKETRIGHT)
    assert session.view.look_through is not None
    pilot.key(key.F)
    assert session.view.look_through is None

    # train the reference and watch it, then all the rest
    pilot.key(key.T)
    draw_until(pilot, lambda: session.clip_states[0].state == "trained", "the reference clip")
    draw_until(pilot, lambda: pilot.studio.frame.viewport.scene.shows == RENDERED, "its picture")
    keep(pilot, tmp_path, "reference")
    pilot.key(key.T, modifiers=(SHIFT,))
    draw_until(pilot, lambda: all(state.state == "trained" for state in session.clip_states), "every clip")
    keep(pilot, tmp_path, "trained")

    # find flicker: everything is measured, a boundary is played around, the map shows the place
    def is_measured() -> bool:
        session.residuals.look_at(session.timeline, session.view.look_through)  # as a started program does
        status = session.residual_status
        return 0 < status.n_all == status.n_done

    pilot.studio.frame.ui.wanted_panel = RESIDUALS
    draw_until(pilot, is_measured, "figures of every picture")
    assert not session.residual_status.message
    pilot.draw(4)
    (seam,) = session.residual_status.seams
    pilot.key(key.DOWN)
    assert session.timeline.frame_index == seam.frame_index
    pilot.key(key.SLASH)
    assert session.timeline.around is not None
    assert session.timeline.around[0] < seam.frame_index <= session.timeline.around[1]
    pilot.key(key.SLASH)
    pilot.key(key.K)
    assert not session.timeline.is_playing

    cells = pilot.rects["residuals.matrix"]
    n_cameras = len(session.rig)
    frame_index, camera_index = seam.frame_index, n_cameras - 1
    pilot.move(
        cells.x0 + cells.width * (frame_index + 0.5) / n_frames,
        cells.y0 + cells.height * (camera_index + 0.5) / n_cameras,
    )
    pilot.press()
    pilot.release()
    pilot.draw(2)
    assert (session.timeline.frame_index, session.view.look_through) == (frame_index, camera_index)
    pilot.key(key._7)
    heat = pilot.studio.frame.viewport.active.heat
    draw_until(pilot, lambda: heat.shown is not None and not heat.shown.is_stale, "the heat map")
    keep(pilot, tmp_path, "flicker")
    shown = heat.shown
    assert shown is not None
    assert (shown.kind, shown.frame_index, shown.camera_index) == ("E", frame_index, camera_index)
    assert shown.mean == pytest.approx(float(session.residual_status.cells["E"][frame_index, camera_index]), abs=1e-3)

    # and the numbers are those of eval
    assert session.project is not None
    document = evaluate_project(
        open_trained(session.project),
        clip_indices=[clip.clip_index for clip in session.clips],
        on_progress=lambda *_: None,
    )
    names = list(session.rig.names)
    for row in document["rows"]:
        at = row["frame_index"], names.index(row["camera"])
        assert session.residual_status.cells["psnr"][at] == pytest.approx(row["psnr"], abs=1e-4)
    draw_until(pilot, lambda: len(session.notices) == 0, "that notices fade, and none is a warning that stays")
