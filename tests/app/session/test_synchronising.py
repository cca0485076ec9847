"""Measuring how far cameras are ahead of each other, and correcting it, as a session has it."""

from __future__ import annotations

import json
import shutil
import threading
from types import SimpleNamespace

import numpy as np
import pytest

from app.background.jobs import JobCancelled
from app.session.captures.capture_commands import ApplyOffsets, SynchroniseCameras
from app.session.commands import CloseQuestion
from app.session.projects.project_commands import OpenCapture
from app.session.training.train_commands import TrainNextClip
from engine.capture.capture import open_capture
from engine.errors import CaptureError
from engine.progress import Progress
from engine.synchronisation.synchronisation import CameraOffset
from tests.app.conftest import DEADLINE_S, poll_until


def found(offsets, sigma=0.1):
    cameras = tuple(CameraOffset(str(row), offset, sigma, 0.95, "epipolar") for row, offset in enumerate(offsets))
    return SimpleNamespace(
        cameras=cameras,
        estimates=(SimpleNamespace(source="epipolar", note="from 12 pairs"),),
        disagreements=(SimpleNamespace(text="Sound says otherwise."),),
        offsets_frames=np.array(offsets),
        is_in_step=not any(offsets),
        fps=30.0,
    )


@pytest.fixture
def session(make_session, capture_folder, tmp_path):
    """With a copy of the tiny capture open."""
    session = make_session(is_open=False)
    session.dispatch(OpenCapture(shutil.copytree(capture_folder, tmp_path / "ring")))
    poll_until(session, lambda: session.capture is not None)
    return session


def measure(session, monkeypatch, result):
    def synchronise(capture, *, report):
        report(Progress("sound", 0.5))
        if isinstance(result, Exception):
            raise result
        return result

    monkeypatch.setattr("engine.synchronisation.estimating.synchronise", synchronise)
    session.dispatch(SynchroniseCameras())
    poll_until(session, lambda: session.synchronising.page.state == "done")
    return session.synchronising.page


def test_offsets_are_shown_and_nothing_is_written_before_that_is_said(session, monkeypatch):
    page = measure(session, monkeypatch, found([0.0, 2.0, 0.0, -1.0]))
    assert [row.offset_frames for row in page.rows] == [0.0, 2.0, 0.0, -1.0]
    assert page.can_apply
    assert page.target == session.capture.path
    assert "1: +2.00 frames" in page.text
    assert "Sound says otherwise." in page.text
    assert not (session.capture.path / "capture.json").exists()


def test_applying_corrects_the_capture(session, monkeypatch):
    page = measure(session, monkeypatch, found([0.0, 2.0, 0.0, -1.0]))
    session.dispatch(ApplyOffsets(page.target))
    poll_until(session, lambda: session.synchronising.page.state == "written")
    document = json.loads((session.capture.path / "capture.json").read_text())
    assert [row["offset_frames"] for row in document["cameras"]] == [0.0, 2.0, 0.0, -1.0]
    assert open_capture(session.capture.path).n_frames == 3


def test_where_something_is_trained_the_corrected_capture_is_another_one(session, monkeypatch, tmp_path):
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.clip_states[0].state == "trained")
    page = measure(session, monkeypatch, found([0.0, 2.0, 0.0, 0.0]))
    assert page.target == tmp_path / "ring-synchronised"
    session.dispatch(ApplyOffsets(page.target))
    poll_until(session, lambda: session.synchronising.page.state == "written")
    assert session.synchronising.page.written == tmp_path / "ring-synchronised"
    assert not (tmp_path / "ring" / "capture.json").exists()
    assert open_capture(tmp_path / "ring-synchronised", follow_links=True).n_frames == 4


@pytest.mark.parametrize(("offsets", "sigma"), [([0.0] * 4, 0.1), ([0.0, 3.0, 0.0, 0.0], 2.0)])
def test_what_is_in_step_or_uncertain_is_not_corrected(session, monkeypatch, offsets, sigma):
    assert not measure(session, monkeypatch, found(offsets, sigma)).can_apply


def test_why_it_could_not_be_measured_or_written_is_told(session, monkeypatch, tmp_path):
    assert "truncated" in measure(session, monkeypatch, CaptureError("It is truncated.")).failure
    page = measure(session, monkeypatch, found([0.0, 2.0, 0.0, 0.0]))
    (tmp_path / "file").write_text("")
    session.dispatch(ApplyOffsets(tmp_path / "file"))
    poll_until(session, lambda: session.synchronising.page.failure)
    assert "could not be written" in session.synchronising.page.failure
    assert session.synchronising.page.rows == page.rows


def test_closing_ends_the_measurement(session, monkeypatch):
    ended = threading.Event()

    def synchronise(capture, *, report):
        try:
            while True:
                report(Progress("motion", 0.2, "camera 3"))
        except JobCancelled:
            ended.set()
            raise

    monkeypatch.setattr("engine.synchronisation.estimating.synchronise", synchronise)
    session.dispatch(SynchroniseCameras())
    poll_until(session, lambda: session.synchronising.progress.message == "motion - camera 3")
    session.dispatch(CloseQuestion())
    assert session.synchronising.page is None
    assert ended.wait(DEADLINE_S)
    poll_until(session, lambda: True)
    assert session.synchronising.page is None


def test_without_a_capture_there_is_a_notice(make_session):
    session = make_session(is_open=False)
    session.dispatch(SynchroniseCameras())
    assert len(session.notices) == 1
