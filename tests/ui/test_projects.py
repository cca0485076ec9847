"""Projects in the window: recent ones, the name of what is open, what is asked before a clip is trained again."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest
from pyglet.window import key, mouse

from app.playback.timeline import Timeline
from app.project.recents import RecentProject
from app.session.commands import CancelJob, CloseQuestion
from app.session.projects.project_commands import (
    ForgetRecent,
    LeaveTraining,
    NewProject,
    OpenCapture,
    OpenProject,
    StartOver,
)
from app.session.questions import LeaveQuestion, ProjectQuestion, RetrainQuestion, StartOverQuestion
from app.session.showing.look_commands import TogglePlay
from app.session.training.train_commands import TrainClip
from app.status import ClipStatus, JobStatus
from engine.capture.clip import split_clips
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import Pilot
from ui.shell.dialogs.questions import leaving_texts, outdated_text, retrain_texts
from ui.shell.window import window_title

pytestmark = [pytest.mark.gl, pytest.mark.slow]

RETRAIN = RetrainQuestion(0, False, "", 29.7, (1, 2), 104.0, False, 190.0, 810)
PRESETS = ("toy", "small", "medium")
PROJECTS = ProjectQuestion(
    "/captures/kitchen",
    (
        RecentProject("/projects/kitchen-toy", "/captures/kitchen", "kitchen-toy", 2, 3),
        RecentProject("/data/ClipGStream/projects/kitchen-12ab", "/captures/kitchen", "kitchen", 0, 3),
    ),
)


def test_recent_projects_open_with_a_click_and_those_that_are_gone_can_be_removed(
    open_pilot: Callable[..., Pilot],
) -> None:
    pilot = open_pilot(FakeSession(has_capture=False))
    pilot.click("welcome.recent0")
    assert pilot.sent(OpenProject) == [OpenProject(Path("/projects/kitchen-toy"))]
    pilot.click("welcome.recent1")  # it is gone
    assert len(pilot.sent(OpenProject)) == 1
    pilot.click("welcome.forget1")
    assert pilot.sent(ForgetRecent) == [ForgetRecent(Path("/projects/gone"))]
    pilot.click("welcome.recent2")  # a capture, as earlier versions kept them
    assert pilot.sent(OpenCapture) == [OpenCapture(Path("/captures/dance_floor"), is_asking=True)]


def test_the_window_names_its_project(pilot: Pilot) -> None:
    assert window_title(pilot.session) == "juggling - 1 of 3 clips trained - /projects/juggling - ClipGStream Studio"
    assert "menu.project" in pilot.rects


@pytest.mark.parametrize(
    ("symbol", "answer"), [(key.ENTER, TrainClip(0, is_confirmed=True)), (key.ESCAPE, CloseQuestion())]
)
def test_training_again_is_asked_and_answered_by_keyboard(pilot: Pilot, symbol: int, answer: object) -> None:
    pilot.session.question = RETRAIN
    pilot.draw(4)
    assert "question.outdated" in pilot.rects
    pilot.key(key.SPACE if symbol == key.ESCAPE else key.L)  # keys of the window wait
    pilot.session.question = RETRAIN
    pilot.draw(2)
    assert pilot.sent(TogglePlay) == []
    pilot.key(symbol)
    pilot.draw(3)
    assert pilot.session.commands[-1] == answer
    assert pilot.session.question is None
    assert "question.yes" not in pilot.rects


def test_the_key_that_leads_to_the_question_does_not_answer_it(pilot: Pilot) -> None:
    pilot.session.clip_states[0] = ClipStatus("trained", 1.0, 29.7)
    pilot.draw()
    pilot.tap(*pilot.rects["timeline.clip0"].center, button=mouse.RIGHT)
    pilot.key(key.DOWN)  # the keyboard takes over from the pointer
    pilot.key(key.UP)
    pilot.key(key.ENTER)
    pilot.draw(3)
    assert pilot.sent(TrainClip) == [TrainClip(0)]
    assert "question.yes" in pilot.rects
    pilot.key(key.ENTER)
    assert pilot.session.commands[-1] == TrainClip(0, is_confirmed=True)


def test_the_question_is_answered_by_its_buttons(pilot: Pilot) -> None:
    for name, answer in (("question.no", CloseQuestion()), ("question.yes", TrainClip(0, is_confirmed=True))):
        pilot.session.question = dataclasses.replace(RETRAIN)
        pilot.draw(4)
        pilot.click(name)
        assert pilot.session.commands[-1] == answer


def test_what_is_asked_says_what_depends_on_the_clip_and_what_it_costs() -> None:
    text = "\n".join([*retrain_texts(RETRAIN), outdated_text(RETRAIN)])
    assert [part for part in ("29.70 dB", "step 810", "1:44", "1, 2", "3:10") if part not in text] == []
    damaged = RetrainQuestion(3, True, "Its header cannot be read.", None, (), None, True, None, None)
    assert "Its header cannot be read." in "\n".join(retrain_texts(damaged))


def test_one_of_several_projects_is_chosen(pilot: Pilot) -> None:
    pilot.session.question = PROJECTS
    pilot.draw(4)
    pilot.key(key.DOWN)
    pilot.key(key.ENTER)
    assert pilot.session.commands[-1] == OpenProject(Path(PROJECTS.choices[1].project))
    pilot.session.question = dataclasses.replace(PROJECTS)
    pilot.draw(4)
    pilot.key(key.UP)  # the last row
    pilot.key(key.ENTER)
    assert pilot.session.commands[-1] == OpenCapture(Path("/captures/kitchen"), is_new_project=True, is_asking=True)


def test_a_stopped_clip_says_where_it_goes_on_and_a_damaged_one_is_not_offered(pilot: Pilot) -> None:
    session = pilot.session
    session.clip_states = [
        ClipStatus("trained", 1.0, 29.7, resume_step=400),
        ClipStatus("damaged", reason="The file is damaged: its header cannot be read."),
        ClipStatus("stopped", 0.19, 21.4, resume_step=810),
    ]
    session.training = dataclasses.replace(session.training, next_clip_index=2, resume_step=810)
    pilot.draw(3)
    pilot.move(*pilot.rects["timeline.clip1"].center)
    pilot.draw(3)
    from ui.panels.training.training import next_label

    assert next_label(session).endswith("Resume clip 2 at step 810")
    session.training = dataclasses.replace(session.training, next_clip_index=None, resume_step=None)
    assert next_label(session).endswith("No clip can be trained next")
    pilot.press(mouse.RIGHT)
    pilot.release(mouse.RIGHT)
    pilot.draw(3)
    pilot.click("clip menu.train")
    assert pilot.sent(TrainClip) == [TrainClip(1)]


def test_a_fault_of_the_session_becomes_one_notice_and_the_window_goes_on(pilot: Pilot) -> None:
    def fail() -> bool:
        raise UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte")

    pilot.session.poll = fail
    pilot.draw(3)
    (notice,) = pilot.session.notices
    assert notice.kind == "error"
    assert "UnicodeDecodeError" in notice.detail


def test_a_thousand_clips_are_drawn_in_runs_of_one_state(pilot: Pilot) -> None:
    session = pilot.session
    session.clips = split_clips(1000, 1)
    states = ["trained"] * 400 + ["damaged"] + ["trained"] * 99 + ["untrained"] * 500
    session.clip_states = [ClipStatus(state) for state in states]
    session.timeline = Timeline(session.clips)
    pilot.draw(3)
    bands = [name for name in pilot.rects if name.startswith("timeline.clip")]
    # clips hardly wider than a pixel count in threes, and of each three the one that is worst off
    assert sorted(bands) == ["timeline.clip0", "timeline.clip399", "timeline.clip402", "timeline.clip501"]
    assert pilot.rects["timeline.clip399"].width >= 3


def test_starting_over_says_the_cost_and_takes_a_preset(pilot: Pilot) -> None:
    pilot.session.question = StartOverQuestion(Path("/p"), "2 trained clips (4:10 of training), 3.1 MB", PRESETS, "toy")
    pilot.draw(4)
    pilot.click("question.preset")
    pilot.click("question.preset.medium")
    pilot.click("question.yes")
    assert pilot.session.commands[-1] == StartOver("medium")
    pilot.session.question = dataclasses.replace(pilot.session.question, is_working=True)
    pilot.draw(4)
    n_sent = len(pilot.session.commands)
    pilot.key(key.ENTER)
    assert len(pilot.session.commands) == n_sent  # it is answered already
    pilot.session.question = StartOverQuestion(Path("/p"), "", PRESETS, "small")
    pilot.draw(4)
    pilot.click("question.other")
    assert pilot.session.commands[-1] == NewProject()


def test_opening_another_project_asks_before_a_training_is_stopped(pilot: Pilot) -> None:
    question = LeaveQuestion("kitchen 2", 1, 913, 7000, 3)
    (text,) = leaving_texts(question)
    for part in ("Clip 1", "step 913 of 7,000", "kitchen 2", "progress is kept", "3 clips that wait"):
        assert part in text
    pilot.session.question = question
    pilot.draw(4)
    pilot.key(key.ESCAPE)
    assert pilot.session.commands[-1] == CloseQuestion()
    pilot.session.question = dataclasses.replace(question)
    pilot.draw(4)
    pilot.click("question.yes")
    assert pilot.session.commands[-1] == LeaveTraining()


def test_a_first_cloud_can_be_cancelled(pilot: Pilot) -> None:
    pilot.session.jobs = [JobStatus("Building a first cloud", 0.0, "sweeping planes", 1.0, can_cancel=True)]
    pilot.draw(3)
    pilot.click("status.cancel")
    assert pilot.session.commands[-1] == CancelJob("Building a first cloud")
