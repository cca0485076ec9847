"""A capture whose files go away while it is open."""

from __future__ import annotations

import shutil
from pathlib import Path

from app.session.projects.project_commands import OpenCapture
from app.session.projects.settings import Settings
from app.session.session import Session
from tests.app.conftest import DEADLINE_S, poll_until


def test_pictures_that_are_gone_are_one_notice_and_the_session_goes_on(tmp_path: Path, capture_folder: Path) -> None:
    folder = tmp_path / "capture"
    shutil.copytree(capture_folder, folder)
    session = Session(project_dir=tmp_path / "p", settings=Settings(tmp_path / "settings.json"), is_preloading=False)
    session.dispatch(OpenCapture(folder))
    poll_until(session, lambda: session.capture is not None)
    shutil.rmtree(folder)
    for frame_index in range(session.timeline.n_frames):
        for camera_index in range(len(session.rig)):
            for width in (160, 400):  # on one thread each
                session.ground_truth(camera_index, frame_index, width)
                session.playback.captured.viewing.wait_idle(DEADLINE_S)
                session.playback.captured.thumbnails.wait_idle(DEADLINE_S)
                session.poll()
    (notice,) = session.notices
    assert notice.kind == "error"
    assert str(folder) in f"{notice.detail} {notice.hint}"
    session.timeline.seek(3)
    assert session.wanted_frame() is not None
    session.close()
