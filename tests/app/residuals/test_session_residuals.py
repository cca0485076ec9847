"""Residuals as part of a session: opened, polled, told of trainings and closed with it."""

from __future__ import annotations

import numpy as np
import pytest

from app.residuals import measuring
from app.residuals.figures import RowFigures
from app.residuals.measuring_messages import Measured
from app.session.commands import SetClipLength, TrainClip, TrainNextClip
from engine.clip_files.clip_state import read_clip_state, write_clip_state
from tests.app.conftest import poll_until
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
    launched.all[-1].events = [Measured(0, row=RowFigures(2, 1, 30.0, 0.25))]
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
    path = session.project.clip_path(0)
    state = read_clip_state(path)
    write_clip_state(path, with_header(state, camera_names=["1"]))  # the gains are those of no camera
    session.live_training.service.catalog.update(0)
    session.notices._notices = []
    session.residuals.heat(session.timeline, 0, "error")
    poll_until(session, lambda: len(session.notices) > 0, what="the notice")
    (notice,) = session.notices
    assert notice.title == "The residual cannot be shown"
    assert "does not say what the cameras make of its colours" in notice.detail
    session.residuals.heat(session.timeline, 0, "flip")
    for _ in range(5):
        session.poll()
    assert len(session.notices) == 1
