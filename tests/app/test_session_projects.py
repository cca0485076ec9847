"""The session and its projects: recent ones, several of one capture, retraining that is asked first, damaged clips."""

from __future__ import annotations

import json
import re
import shutil
import threading
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from app.background.jobs import Jobs
from app.project.opening.opening import Opened, open_for_window
from app.project.opening.opening_answers import default_answers
from app.session.commands import CloseQuestion
from app.session.projects.project_commands import (
    AskStartOver,
    ForgetRecent,
    NewProject,
    OpenCapture,
    OpenProject,
    SetProjectsFolder,
    StartOver,
)
from app.session.projects.setting_commands import SetClipLength, SetPreset
from app.session.projects.settings import Settings
from app.session.questions import ProjectQuestion, RetrainQuestion, StartOverQuestion
from app.session.session import Session
from app.session.showing.look_commands import SetFrame
from app.session.training.train_commands import StopTraining, TrainClip, TrainNextClip
from engine.capture.capture import open_capture
from engine.capture.writers.capture_json import capture_document, write_capture_json
from engine.user_folders import data_dir
from tests.app.conftest import DEADLINE_S, inline, poll_until
from tests.app.fakes import make_fake, make_slow, write_capture


def train_next(session: Session) -> None:
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.state in ("idle", "failed"), what="the end of the training")


@pytest.fixture
def open_session(tmp_path: Path):
    """Sessions as the window makes them: projects lie in the user's data folder unless one is opened by its path."""
    made: list[Session] = []

    def make(path: Path | None) -> Session:
        settings = Settings(tmp_path / "settings.json")
        session = Session(launch=partial(inline, make_training=make_fake), settings=settings, is_preloading=False)
        made.append(session)
        if path is not None:
            session.dispatch(OpenCapture(path))
            poll_until(session, lambda: session.capture is not None or session.question is not None, what="opening")
        return session

    yield make
    for session in made:
        session.close()


def test_recent_lists_the_project_and_how_far_it_is_trained(open_session, make_session, capture_folder, tmp_path):
    session = make_session(name="own")
    session.dispatch(SetClipLength(3))
    train_next(session)
    assert (session.project_status.name, session.project_status.trained_text) == ("own", "1 of 2 clips trained")
    session.close()
    again = open_session(None)
    (entry,) = again.recent.entries
    assert (entry.folder, entry.n_trained, entry.n_clips) == (tmp_path / "own", 1, 2)
    again.dispatch(OpenProject(entry.folder))
    poll_until(again, lambda: again.capture is not None, what="the project")
    assert [state.state for state in again.clip_states] == ["trained", "untrained"]


def test_of_two_captures_the_one_asked_for_last_is_opened_however_long_the_other_takes(tmp_path):
    first, second = (write_capture(tmp_path / name, n_cameras=3, n_frames=2) for name in ("first", "second"))
    go_on = threading.Event()

    def opener(path: Path, **options: Any) -> Opened:
        assert path != first or go_on.wait(DEADLINE_S)
        return open_for_window(path, **options)

    session = Session(settings=Settings(tmp_path / "settings.json"), opener=opener, is_preloading=False)
    session.dispatch(OpenCapture(first))
    session.dispatch(OpenCapture(second))
    poll_until(session, lambda: session.capture is not None, what="the second capture")
    go_on.set()
    poll_until(session, lambda: not session.jobs, what="the first capture")
    assert session.capture is not None
    assert Path(session.capture.path) == second
    assert not list((data_dir() / "projects").glob("first-*/lock"))  # let go of
    session.close()


def test_what_is_said_of_frames_of_another_shape_is_kept_in_the_capture(open_session, capture_folder, tmp_path):
    folder = Path(shutil.copytree(capture_folder, tmp_path / "capture"))
    layout = open_capture(folder).layout
    width, height = layout.cameras[0].image_size
    document = capture_document(layout, folder) | {"cameras": []}
    for row in capture_document(layout, folder)["cameras"]:
        document["cameras"].append(row | {"width": width + 2, "height": height * (width + 2) // width - 1})
    write_capture_json(folder, document | {"fit": "cropped_end"})
    before = open_capture(folder)
    answers = replace(default_answers(before), fit="cropped_start")
    session = open_session(None)
    session.dispatch(OpenCapture(folder, is_new_project=True, answers=answers))
    poll_until(session, lambda: session.capture is not None, what="the capture")
    assert json.loads((folder / "capture.json").read_text())["fit"] == "cropped_start"
    after = open_capture(folder)
    assert after.layout.cameras[0].K[0, 2] == before.layout.cameras[0].K[0, 2] - before.layout.cameras[0].misfit_px


def test_frames_of_quite_another_shape_are_asked_about_before_anything_is_made_of_them(
    open_session, capture_folder, tmp_path
):
    folder = Path(shutil.copytree(capture_folder, tmp_path / "capture"))
    layout = open_capture(folder).layout
    document = capture_document(layout, folder)
    for row in document["cameras"]:
        row["height"] += 6
    write_capture_json(folder, document)
    session = open_session(None)
    session.dispatch(OpenCapture(folder))  # as from the command line
    poll_until(session, lambda: session.opening.page is not None, what="the question")
    page = session.opening.page
    assert page is not None
    assert page.report.needs_fit
    assert "scaled or cropped" in session.opening.problem(page.answers)
    answers = replace(page.answers, fit="scaled")
    assert session.opening.problem(answers) == ""
    session.dispatch(OpenCapture(folder, is_new_project=True, answers=answers))
    poll_until(session, lambda: session.capture is not None, what="the capture")
    assert json.loads((folder / "capture.json").read_text())["fit"] == "scaled"


def test_a_capture_that_has_a_project_offers_it_and_a_new_one(open_session, make_session, capture_folder, tmp_path):
    session = make_session(name="own")
    session.dispatch(SetPreset("toy"))
    train_next(session)
    session.close()
    again = open_session(capture_folder)
    assert isinstance(again.question, ProjectQuestion)
    (choice,) = again.question.choices
    assert (choice.folder, choice.preset, choice.trained_text) == (tmp_path / "own", "toy", "1 of 1 clips trained")
    assert choice.opened
    assert not (data_dir() / "projects").exists()
    again.dispatch(OpenProject(choice.folder))
    poll_until(again, lambda: again.capture is not None, what="the project")
    again.dispatch(NewProject())
    poll_until(again, lambda: again.opening.page is not None, what="the dialog")
    page = again.opening.page
    assert page.folder.parent == data_dir() / "projects"
    again.dispatch(OpenCapture(page.report.path, is_new_project=True, answers=page.answers))
    poll_until(again, lambda: again.project.folder == page.folder, what="the new project")
    assert len(again.recent.entries) == 2


def test_projects_go_where_the_user_wants_them(open_session, capture_folder, tmp_path):
    session = open_session(None)
    session.dispatch(SetProjectsFolder(str(tmp_path / "mine")))
    session.dispatch(OpenCapture(capture_folder))
    poll_until(session, lambda: session.capture is not None, what="the project")
    assert session.project.folder.parent == tmp_path / "mine"


def test_settings_change_while_no_clip_is_finished_and_say_what_goes(make_session):
    session = make_session(make_training=make_slow)
    session.dispatch(SetPreset("toy"))
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.step >= 2, what="steps")
    session.dispatch(SetPreset("small"))
    assert "Stop the training first." in session.notices[-1].hint
    session.dispatch(StopTraining())
    poll_until(session, lambda: session.training.state == "idle", what="the end")
    poll_until(session, lambda: session.plan is not None, what="the plan")
    assert session.plan.can_edit
    assert session.plan.discards.startswith("the progress of clip 0 (step ")
    assert session.project.checkpoint_path(0).is_file()
    session.dispatch(SetPreset("small"))
    assert session.project.settings.overrides == {}
    assert session.notices[-1].detail.startswith("The progress of clip 0 (step ")
    assert not session.project.checkpoint_path(0).exists()
    assert [state.state for state in session.clip_states] == ["untrained"]


def test_starting_over_says_what_it_costs_and_frees_the_settings(make_session):
    session = make_session()
    session.dispatch(SetPreset("toy"))
    session.dispatch(SetClipLength(3))
    for _ in range(2):
        train_next(session)
    session.dispatch(AskStartOver())
    poll_until(session, lambda: isinstance(session.question, StartOverQuestion), what="the question")
    words = session.question.discards
    assert re.fullmatch(r"2 trained clips \(\d+:\d\d of training\), \d+(\.\d)? [kM]B", words)
    assert (session.question.preset, "paper" in session.question.presets) == ("toy", True)
    folder = session.project.folder
    session.dispatch(StartOver("medium"))
    assert session.question.is_working
    poll_until(session, lambda: session.question is None, what="the end")
    assert [state.state for state in session.clip_states] == ["untrained", "untrained"]
    assert session.project.settings.overrides["passes"] == 16
    assert session.notices[-1].detail == f"Discarded: {words}."
    assert not [path for path in folder.rglob("*.safetensors") if path.parent.name != "prep"]
    train_next(session)
    assert session.clip_states[0].state == "trained"


def test_of_several_projects_of_a_capture_the_user_chooses(open_session, make_session, capture_folder, tmp_path):
    open_session(capture_folder).close()  # one in the data folder
    own = make_session(name="own")
    own.close()
    session = open_session(capture_folder)
    assert session.capture is None
    assert isinstance(session.question, ProjectQuestion)
    folders = [Path(choice.project) for choice in session.question.choices]
    assert len(folders) == 2
    assert tmp_path / "own" in folders
    session.dispatch(OpenCapture(capture_folder, is_new_project=True))
    assert session.question is None
    poll_until(session, lambda: session.capture is not None, what="the new project")
    assert session.project.folder not in folders
    assert session.project.folder.parent == data_dir() / "projects"


def test_what_is_gone_is_known_and_can_be_removed(open_session, make_session, tmp_path):
    make_session(name="own").close()
    (tmp_path / "own" / "project.json").unlink()
    session = open_session(None)
    poll_until(session, lambda: session.recent.missing == {tmp_path / "own"}, what="a look at the disk")
    session.dispatch(ForgetRecent(tmp_path / "own"))
    assert Settings(tmp_path / "settings.json").recent == []


def test_training_a_finished_clip_again_is_asked_first(make_session):
    session = make_session()
    session.dispatch(SetClipLength(2))
    for _ in range(3):
        train_next(session)
    session.dispatch(TrainClip(0))
    question = session.question
    assert isinstance(question, RetrainQuestion)
    assert session.training.state == "idle"
    assert (question.clip_index, question.outdated, question.is_damaged) == (0, (1, 2), False)
    assert question.held_out_psnr == session.clip_states[0].held_out_psnr
    assert question.seconds is not None
    assert question.outdated_seconds is not None
    session.dispatch(CloseQuestion())
    assert session.question is None
    session.dispatch(TrainClip(0, is_confirmed=True))
    assert session.training.state != "idle"


@pytest.mark.slow
def test_a_damaged_clip_is_shown_as_such_and_only_trained_again_when_confirmed(make_session):
    session = make_session(name="own")
    session.dispatch(SetClipLength(2))
    for _ in range(2):
        train_next(session)
    path = session.project.clip_path(1)
    session.close()
    damaged = b"\xff" * 200
    path.write_bytes(damaged)
    session = make_session(name="own")
    assert [state.state for state in session.clip_states] == ["trained", "damaged", "untrained"]
    assert "damaged" in session.clip_states[1].reason
    assert session.project_status.n_trained == 1
    train_next(session)  # the one after it
    assert [state.state for state in session.clip_states] == ["trained", "damaged", "trained"]
    train_next(session)
    assert session.notices[-1].title == "No clip can be trained next"
    assert path.read_bytes() == damaged
    session.dispatch(TrainClip(1))
    assert session.question.is_damaged
    session.dispatch(TrainClip(1, is_confirmed=True))
    poll_until(session, lambda: session.clip_states[1].state == "trained", what="the clip")


@pytest.mark.slow
def test_a_clip_whose_arrays_turn_out_to_be_damaged_is_shown_as_such(make_session):
    session = make_session(name="own")
    session.dispatch(SetClipLength(3))
    for _ in range(2):
        train_next(session)
    path = session.project.clip_path(1)
    session.close()
    data = bytearray(path.read_bytes())
    data[-3] ^= 0xFF  # in an array: the header is as it was
    path.write_bytes(bytes(data))
    session = make_session(name="own")
    assert [state.state for state in session.clip_states] == ["trained", "trained"]
    session.dispatch(SetFrame(4))

    def is_found() -> bool:
        session.shown_gaussians()
        return session.clip_states[1].state == "damaged"

    poll_until(session, is_found, what="the damage")
    assert session.clip_states[0].state == "trained"
    assert session.training.next_clip_index is None


def test_a_bad_byte_in_the_curves_does_not_keep_the_project_closed(make_session):
    session = make_session(name="own")
    train_next(session)
    path = session.project.metrics_path(0)
    session.close()
    path.write_bytes(path.read_bytes() + b"\xff\n")
    session = make_session(name="own")
    assert session.clip_states[0].state == "trained"
    poll_until(session, lambda: len(session.training.psnr_history) > 0, what="the curves")


def test_what_taking_up_a_result_raises_ends_with_the_job():
    faults: list[tuple[str, Exception]] = []
    jobs = Jobs(lambda name, error: faults.append((name, error)))

    def take(result: object) -> None:
        raise ValueError(result)

    taken: list[int] = []
    for job in (jobs.start("Bad", lambda context: 1, take, take), jobs.start("Good", lambda _: 2, taken.append, take)):
        job.join(DEADLINE_S)
    assert jobs.poll()
    assert [(name, str(error)) for name, error in faults] == [("Bad", "1")]
    assert taken == [2]
