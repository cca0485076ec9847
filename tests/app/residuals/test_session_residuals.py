"""Residuals as part of a session: opened, polled, told of trainings and closed with it."""

from __future__ import annotations

import numpy as np
import pytest

from app.residuals import measuring
from app.residuals.figures import RowFigures
from app.residuals.measuring_messages import PictureMeasured
from app.session.projects.setting_commands import SetClipLength
from app.session.training.train_commands import TrainClip, TrainNextClip
from app.training.worker import keeper
from engine.clip_files.clip_state import read_clip_state, write_clip_state
from tests.app.conftest import DEADLINE_S, poll_until
from tests.app.fakes import make_slow
from tests.app.residuals.test_measuring import Launched
from tests.clip_headers import with_header


@pytest.fixture
def launched() -> Launched:
    return Launched()


@pytest.fixture
def open_session(make_session, launched, monkeypatch):
    """Makes sessions that measure at once, with nothing behind it."""
    monkeypatch.setattr(measuring, "START_AFTER_S", 0.0)
    monkeypatch.setattr(measuring, "STATUS_EVERY_S", 0.0)

    def make(clip_length: int = 3):
        session = make_session()
        session.residuals.measuring._launch = launched
        session.dispatch(SetClipLength(clip_length))
        return session

    return make


def train(session, clip_index: int, *, is_confirmed: bool = False) -> None:
    session.dispatch(TrainClip(clip_index, is_confirmed=is_confirmed))
    poll_until(session, lambda: session.training.state == "idle", what="the training")


def test_figures_follow_what_is_trained(open_session, launched):
    session = open_session()
    assert session.residuals.status.n_all == 0
    assert len(session.residuals.status.seams) == 1
    session.residuals.look_at(session.timeline, 1)
    train(session, 0)
    poll_until(session, lambda: session.residuals.status.is_measuring, what="measuring")
    assert launched.all[-1].job.trained == (0,)
    launched.all[-1].events = [PictureMeasured(0, row=RowFigures(2, 1, 30.0, 0.25))]
    poll_until(session, lambda: np.isfinite(session.residuals.status.cells["psnr"][2, 1]), what="the figure")
    first = launched.all[-1]
    session.residuals.look_at(session.timeline, 1)
    train(session, 1)
    poll_until(session, lambda: launched.all[-1] is not first, what="measuring of both")
    assert first.is_ended
    assert launched.all[-1].job.trained == (0, 1)
    assert not launched.all[-1].job.rows[2, 1], "it is known"
    assert np.isfinite(session.residuals.status.cells["psnr"][2, 1])
    session.close()
    assert launched.all[-1].is_ended


def test_other_settings_have_other_seams(open_session, launched):
    session = open_session()
    assert [seam.frame_index for seam in session.residuals.status.seams] == [3]
    session.dispatch(SetClipLength(2))
    assert [seam.frame_index for seam in session.residuals.status.seams] == [2, 4]


def test_a_clip_that_cannot_be_read_is_told_once_and_marked(open_session, launched):
    session = open_session()
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.state == "idle", what="the training")
    poll_until(session, lambda: session.playback.is_loaded(session.timeline), what="the clip in playback")
    path = session.project.clip_path(0)
    state = read_clip_state(path)
    # another state by its fingerprint as well, or what playback has read of the first one would serve
    of_others = with_header(state, camera_names=["1"], fingerprint="of other cameras")
    write_clip_state(path, of_others)
    session.live_training.service.catalog.update(0)
    session.notices._notices = []
    session.residuals.heat(session.timeline, 0, "error")
    poll_until(session, lambda: len(session.notices) > 0, what="the notice")
    (notice,) = session.notices
    assert notice.title == "The residual cannot be shown"
    assert "does not hold the cameras' colours" in notice.detail
    session.residuals.heat(session.timeline, 0, "flip")
    for _ in range(5):
        session.poll()
    assert len(session.notices) == 1


@pytest.mark.slow
def test_a_clip_has_heat_while_it_trains_and_what_is_gone_is_no_fault(make_session, monkeypatch):
    monkeypatch.setattr(keeper, "SNAPSHOT_EVERY_S", 0.3)  # sooner than that, the heat of each may come too late
    monkeypatch.setattr(keeper, "SNAPSHOT_SHARE", 1.0)
    session = make_session(make_training=make_slow)
    session.dispatch(TrainNextClip())
    seen = []

    def is_another_shown() -> bool:
        session.shown_gaussians()  # the window reads it, so that the next one comes
        heat = session.residuals.heat(session.timeline, 1, "error")
        session.residuals._heat.worker.wait_idle(
            DEADLINE_S
        )  # the training runs on this thread, and would leave it no time
        if heat is not None and heat.values is not None and heat.key not in seen:
            seen.append(heat.key)
        return len(seen) >= 3

    poll_until(session, is_another_shown, what="heat of three live states")
    assert all(key.main.revision.startswith("live-") for key in seen)
    assert len({key.main.revision for key in seen}) == 3
    session.residuals._heat.worker.forget()
    for path in session.project.live_dir.iterdir():
        path.unlink()  # whoever reads the file has it mapped, and would die of a shorter one
        path.write_bytes(b"gone")
    monkeypatch.setattr(session.playback.decoder, "loaded", lambda request: None)
    session.timeline.seek(1)
    session.residuals.heat(session.timeline, 2, "error")
    assert session.residuals._heat.worker.wait_idle(DEADLINE_S)
    session.poll()
    assert not any(notice.title == "The residual cannot be shown" for notice in session.notices)
