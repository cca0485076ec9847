"""LiveTraining: training inline, its snapshots, notices and plan, without a session around it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial

import pytest

from app.background.jobs import Jobs
from app.project.opening.opened_project import OpenedProject
from app.project.opening.project_access import open_project
from app.session.notices import Notices
from app.session.training.live_training import LiveTraining
from app.training.worker import keeper
from engine.clip_files.clip_state import read_clip_state
from engine.errors import ProjectError
from tests.app.conftest import DEADLINE_S, inline
from tests.app.fakes import N_STEPS, make_slow


class Desk:
    """What a session would hold around it."""

    def __init__(self, **options) -> None:
        self.jobs, self.notices = Jobs(), Notices()
        self.training = LiveTraining(self.jobs, self.notices, launch=partial(inline, **options), can_measure=False)

    def poll_until(self, is_done: Callable[[], bool]) -> None:
        until_s = time.monotonic() + DEADLINE_S
        while not is_done():
            assert time.monotonic() < until_s, f"{self.training.status(None)} {list(self.notices)}"
            self.training.poll()
            self.jobs.poll()


@pytest.fixture
def desk() -> Iterator[Desk]:
    made = Desk()
    yield made
    made.training.close()


@pytest.fixture
def slow_desk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    """Trains for as long as anybody looks, with snapshots as often as they are given back."""
    monkeypatch.setattr(keeper, "SNAPSHOT_EVERY_S", 0.0)
    monkeypatch.setattr(keeper, "SNAPSHOT_SHARE", 1.0)
    made = Desk(make_training=make_slow)
    yield made
    made.training.close()


def test_without_a_project_it_answers_and_trains_nothing(desk: Desk):
    training = desk.training
    training.train_next()
    assert training.train(0, is_confirmed=True) is None
    for act in (training.pause, training.resume, training.stop, training.give_back_snapshots):
        act()
    assert [notice.title for notice in desk.notices] == ["Nothing to train yet"] * 2
    assert (training.status(0).state, training.clip_states(), training.plan()) == ("idle", [], None)
    assert training.state_of(0) is None
    assert (training.is_busy, training.unread_clips) == (False, ())


def test_clips_are_trained_one_after_the_other_and_the_user_hears_of_it(desk: Desk, make_opened):
    desk.training.open(make_opened())
    for _ in range(2):
        desk.training.train_next()
        assert desk.training.is_busy
        desk.poll_until(lambda: not desk.training.is_busy)
    assert [status.state for status in desk.training.clip_states()] == ["trained", "trained"]
    assert [notice.title for notice in desk.notices] == ["Clip 0 is trained", "Clip 1 is trained"]
    desk.training.train_next()
    assert desk.notices[-1].title == "Every clip is trained"
    state = desk.training.state_of(1)
    assert state is not None
    assert read_clip_state(state.file).header.step == N_STEPS


def test_a_finished_clip_is_trained_again_only_when_that_is_confirmed(desk: Desk, make_opened):
    desk.training.open(make_opened())
    desk.training.train_next()
    desk.poll_until(lambda: not desk.training.is_busy)
    question = desk.training.train(0, is_confirmed=False)
    assert question is not None
    assert (question.clip_index, desk.training.is_busy) == (0, False)
    assert desk.training.train(0, is_confirmed=True) is None
    assert desk.training.is_busy


def test_what_is_left_but_cannot_be_trained_is_told(desk: Desk, make_opened):
    opened = make_opened()
    desk.training.open(opened)
    desk.training.train_next()
    desk.poll_until(lambda: not desk.training.is_busy)
    path = opened.project.clip_path(0)
    path.unlink()  # whoever reads the file has it mapped, and would die of a shorter one
    path.write_bytes(b"not a clip")
    desk.training.note_damage(ProjectError("The clip is damaged.", path=path))
    desk.training.train_next()
    assert desk.notices[-1].title == "No clip can be trained next"
    assert desk.training.clip_states()[0].state == "damaged"


def test_a_snapshot_waits_until_it_is_given_back(slow_desk: Desk, make_opened):
    training = slow_desk.training
    training.open(make_opened())
    training.train_next()
    slow_desk.poll_until(lambda: training.unread_clips == (0,))
    first = training.state_of(0)
    assert first is not None
    assert first.is_live
    for _ in range(20):
        training.poll()
    assert training.state_of(0) == first, "the next one is not written before that"
    training.give_back_snapshots()
    assert training.unread_clips == ()
    slow_desk.poll_until(lambda: training.state_of(0) != first)


def test_a_snapshot_that_could_not_be_read_is_replaced(slow_desk: Desk, make_opened):
    training = slow_desk.training
    training.open(make_opened())
    training.train_next()
    slow_desk.poll_until(lambda: training.unread_clips == (0,))
    first = training.state_of(0)
    training.replace_snapshot(OSError("gone"))
    assert training.unread_clips == ()
    slow_desk.poll_until(lambda: training.unread_clips == (0,) and training.state_of(0) != first)
    assert len(slow_desk.notices) == 0


def test_the_end_of_a_training_leaves_no_snapshot_unread(slow_desk: Desk, make_opened):
    training = slow_desk.training
    training.open(make_opened())
    training.train_next()
    slow_desk.poll_until(lambda: training.unread_clips == (0,))
    training.stop()
    slow_desk.poll_until(lambda: not training.is_busy)
    assert training.unread_clips == ()
    state = training.state_of(0)
    assert state is not None
    assert not state.is_live


def test_another_project_ends_the_training_on_a_thread_and_keeps_it(slow_desk: Desk, make_opened, tmp_path):
    training = slow_desk.training
    first: OpenedProject = make_opened("a")
    training.open(first)
    training.train_next()
    slow_desk.poll_until(lambda: training.status(0).step >= 2)
    training.open(make_opened("b", generation=2))
    assert (training.is_busy, training.is_ending) == (False, True)
    assert training.clip_states()[0].state == "untrained"
    slow_desk.poll_until(lambda: not training.is_ending)
    again = open_project(tmp_path / "a")  # the lock was given back
    assert read_clip_state(again.checkpoint_path(0)).header.step >= 2
    again.close()


def test_there_is_a_plan_while_nothing_trains(slow_desk: Desk, make_opened):
    training = slow_desk.training
    training.open(make_opened())

    def is_planned() -> bool:
        plan = training.plan()
        return plan is not None and plan.summary != ""

    before = training.finished
    slow_desk.poll_until(is_planned)
    assert training.finished != before
    training.train_next()
    assert training.plan() is None
