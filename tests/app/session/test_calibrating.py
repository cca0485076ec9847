"""From a folder of plain videos to a capture, as a session has it; the calibration itself is made up."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from app.background.jobs import JobCancelled
from app.calibration.job import CalibrationRequest
from app.session.captures.capture_commands import CalibrateVideos, KeepCalibration, LookAtVideos, StopCalibration
from app.session.commands import CloseQuestion
from engine.errors import PreparationError
from tests.app.conftest import DEADLINE_S, poll_until


@pytest.fixture
def videos(tmp_path):
    """Three cameras, a folder of pictures each."""
    for camera in ("a 1", "a 2", "a 10"):
        folder = tmp_path / "videos" / camera
        folder.mkdir(parents=True)
        for frame in range(2):
            Image.fromarray(np.full((8, 10, 3), 9 * frame, np.uint8)).save(folder / f"{frame}.png")
    return tmp_path / "videos"


def made_up(work):
    """In place of app.calibration.job.calibration_work."""
    return lambda request: lambda context: work(request, context)


def outcome(request, missing=()):
    found = SimpleNamespace(rig=[0, 1, 2], doubts=("", "", ""))
    calibration = SimpleNamespace(found=found, missing=[SimpleNamespace(name=name) for name in missing])
    return SimpleNamespace(
        capture=request.out or request.videos,
        needs_links=request.out is not None,
        calibration=calibration,
        lines=("3.",),
        is_written=True,
    )


def look(session, folder):
    session.dispatch(LookAtVideos(folder))
    assert session.calibrating.page.state == "looking"
    poll_until(session, lambda: session.calibrating.page.state == "asking")
    return session.calibrating.page


def test_cameras_are_shown_before_anything_is_computed(make_session, videos):
    page = look(make_session(is_open=False), videos)
    assert [(camera.name, camera.image_size, camera.n_frames) for camera in page.cameras] == [
        ("a 1", (10, 8), 2),
        ("a 2", (10, 8), 2),
        ("a 10", (10, 8), 2),
    ]
    assert not page.has_capture_json
    (videos / "capture.json").write_text("{}")
    assert look(make_session(is_open=False), videos).has_capture_json


def test_a_folder_without_cameras_says_so(make_session, tmp_path):
    (tmp_path / "empty").mkdir()
    page = look(make_session(is_open=False), tmp_path / "empty")
    assert page.cameras == ()
    assert "at least 3 are needed" in page.failure.message


def test_a_calibration_ends_with_a_capture_to_open(make_session, videos, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "app.session.captures.calibrating.calibration_work",
        made_up(lambda request, context: outcome(request, ("a 2",))),
    )
    session = make_session(is_open=False)
    look(session, videos)
    session.dispatch(CalibrateVideos(CalibrationRequest(videos, tmp_path / "elsewhere")))
    poll_until(session, lambda: session.calibrating.page.state == "done")
    result = session.calibrating.page.result
    assert (result.capture, result.needs_links, result.missing) == (tmp_path / "elsewhere", True, ("a 2",))
    session.dispatch(CloseQuestion())
    assert session.calibrating.page is None


def test_one_that_has_failed_can_be_kept(make_session, videos, monkeypatch):
    def failed(request, context):
        one = outcome(request)
        one.is_written, one.calibration.failure = False, "Matches contradict 3 of 3 cameras."
        return one

    kept = []

    def write(calibration, request):
        kept.append(request)
        return outcome(request)

    monkeypatch.setattr("app.session.captures.calibrating.calibration_work", made_up(failed))
    monkeypatch.setattr("app.session.captures.calibrating.written", write)
    session = make_session(is_open=False)
    look(session, videos)
    session.dispatch(CalibrateVideos(CalibrationRequest(videos)))
    poll_until(session, lambda: session.calibrating.page.state == "done")
    assert session.calibrating.page.result.failure == "Matches contradict 3 of 3 cameras."
    session.dispatch(KeepCalibration())
    session.dispatch(KeepCalibration())
    poll_until(session, lambda: not session.calibrating.page.result.failure)
    assert kept == [CalibrationRequest(videos, keeps_doubtful=True)]


def test_what_it_says_is_shown_and_stopping_leads_back_to_the_options(make_session, videos, monkeypatch):
    ended = threading.Event()

    def work(request, context):
        try:
            while True:
                context.report(0.25, "Matching")
        except JobCancelled:
            ended.set()
            raise

    monkeypatch.setattr("app.session.captures.calibrating.calibration_work", made_up(work))
    session = make_session(is_open=False)
    look(session, videos)
    session.dispatch(CalibrateVideos(CalibrationRequest(videos)))
    poll_until(session, lambda: session.calibrating.progress.done == 0.25)
    assert session.calibrating.progress.message == "Matching"
    session.dispatch(StopCalibration())
    assert session.calibrating.page.state == "asking"
    assert session.calibrating.progress is None
    assert ended.wait(DEADLINE_S)
    poll_until(session, lambda: True)
    assert session.calibrating.page.failure is None


def test_why_it_failed_is_shown_beside_the_options(make_session, videos, monkeypatch):
    errors = [PreparationError("Too little in common.", hint="Move closer."), RuntimeError("broken")]

    def work(request, context):
        raise errors.pop(0)

    monkeypatch.setattr("app.session.captures.calibrating.calibration_work", made_up(work))
    session = make_session(is_open=False)
    look(session, videos)
    for expected in ("Too little in common.", "RuntimeError: broken"):
        session.dispatch(CalibrateVideos(CalibrationRequest(videos)))
        assert session.calibrating.page.failure is None
        poll_until(session, lambda: session.calibrating.page.failure is not None)
        failure = session.calibrating.page.failure
        assert failure is not None
        assert expected in failure.text
        assert session.calibrating.page.cameras
