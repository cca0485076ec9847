"""The session's side of the capture doctor: examining in the background, correcting after a question."""

from __future__ import annotations

import json
import shutil
import time

import numpy as np
import pytest

from app.session.captures.capture_commands import CorrectCapture, ExamineCapture, StopExamining
from app.session.commands import CloseQuestion
from app.session.projects.project_commands import OpenCapture
from app.session.projects.settings import Settings
from app.session.questions import CorrectionQuestion
from app.session.session import Session
from engine.capture.writers.capture_json import Corrections
from engine.doctor.doctor import Diagnosis
from engine.doctor.finding import Finding
from engine.doctor.memory import memory_bytes
from engine.errors import CaptureError
from engine.progress import Progress

FOUND = Finding("frozen", "warning", ("cam01",), (3,), "cam01 stands still.", 0.9, "Leave it out.")


def poll(session: Session, is_done) -> None:
    until_s = time.monotonic() + 120.0
    while not is_done():
        assert time.monotonic() < until_s, list(session.notices)
        session.poll()
        time.sleep(0.005)


@pytest.fixture
def session(capture_folder, tmp_path):
    capture = tmp_path / "capture"
    shutil.copytree(capture_folder, capture)
    found = Session(settings=Settings(tmp_path / "settings.json"), project_dir=tmp_path / "p", is_preloading=False)
    found.dispatch(OpenCapture(capture))
    poll(found, lambda: found.capture is not None)
    yield found
    found.close()


def made_up(capture, report) -> Diagnosis:
    for step in range(5):
        report(Progress("Capture doctor", step / 5, "looking"))
    return Diagnosis((FOUND,), np.zeros(len(capture.rig)), (), np.zeros(len(capture.rig)), None, 7, 0.1)  # type: ignore[arg-type]


def test_a_capture_is_examined_in_the_background(session) -> None:
    session.doctor.run = made_up
    assert session.doctor_status.state == "idle"
    session.dispatch(ExamineCapture())
    session.dispatch(ExamineCapture())  # at it already
    poll(session, lambda: session.doctor_status.state == "done")
    assert session.doctor_status.findings == (FOUND,)
    assert session.doctor_status.diagnosis.n_pictures == 7
    poll(session, lambda: session.doctor_status.memory_bytes == memory_bytes(session.capture))


def test_examining_can_be_stopped_and_a_failure_is_told(session) -> None:
    has_ended = []

    def endless(capture, report):
        try:
            while True:
                report(Progress("Capture doctor", 0.3, "looking"))
                time.sleep(0.002)
        finally:
            has_ended.append(True)

    session.doctor.run = endless
    session.dispatch(ExamineCapture())
    poll(session, lambda: session.doctor_status.progress is not None and session.doctor_status.progress.done > 0.2)
    assert session.doctor_status.state == "running"
    assert session.doctor_status.progress.eta_s(time.monotonic()) is not None
    session.dispatch(StopExamining())
    assert session.doctor_status.state == "idle"
    poll(session, lambda: bool(has_ended))

    def failing(capture, report):
        raise CaptureError("The disk went away.")

    session.doctor.run = failing
    session.dispatch(ExamineCapture())
    poll(session, lambda: any("cannot be examined" in notice.title for notice in session.notices))
    assert session.doctor_status.state == "idle"


def test_a_correction_is_asked_about_then_written_and_opened_as_a_new_project(session) -> None:
    name, capture, project = session.rig.names[1], session.capture.path, session.project.folder
    session.dispatch(CorrectCapture(Corrections(is_excluded={name: True}), f"Exclude {name}"))
    question = session.question
    assert isinstance(question, CorrectionQuestion)
    assert (question.words, question.project) == (f"Exclude {name}", str(project))
    assert not (capture / "capture.json").exists()
    session.dispatch(CloseQuestion())
    assert session.question is None
    session.projects.opener.project_dir = project.parent / "p2"
    session.dispatch(CorrectCapture(question.corrections, question.words, is_confirmed=True))
    poll(session, lambda: session.project is not None and session.project.folder != project)
    assert name not in session.rig.names
    written = json.loads((capture / "capture.json").read_text())
    assert [camera["name"] for camera in written["cameras"] if camera.get("is_excluded")] == [name]


@pytest.mark.slow
def test_a_process_of_its_own_examines_and_says_what_is_wrong(session) -> None:
    seen = []
    session.dispatch(ExamineCapture())
    poll(session, lambda: seen.append(session.doctor_status.progress) or session.doctor_status.state == "done")
    shares = [progress.done for progress in seen if progress is not None]
    assert shares == sorted(shares)
    assert session.doctor_status.diagnosis.n_pictures == session.capture.n_frames * len(session.rig)


@pytest.mark.slow
def test_a_process_that_cannot_read_the_capture_says_why(session, tmp_path) -> None:
    shutil.rmtree(session.capture.path)
    session.dispatch(ExamineCapture())
    poll(session, lambda: any("cannot be examined" in notice.title for notice in session.notices))
    assert session.doctor_status.state == "idle"
