"""TrainQueue and the service around it: order, failures, holding, settings of one clip, live view."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from app.project.opening.opened_project import OpenedProject
from app.training.jobs import train_job
from app.training.messages import ClipTrained, SnapshotWritten, TrainingFailed, TrainJob
from app.training.own_settings import ALLOWED, offered, with_own
from app.training.service import ClipEvent, TrainingService
from app.training.train_queue import TrainQueue, needed_clips
from app.training.training_status import ClipStatuses, training_status
from app.training.worker import keeper
from app.training.worker.folder_store import FolderStore
from engine.clip_files.clip_state import read_clip_state
from engine.errors import NonFiniteLoss, ProjectError
from tests.app.conftest import DEADLINE_S, inline
from tests.app.fakes import FakeTraining, make_fake, make_slow, write_trained
from tests.app.made_projects import make_chain, make_project

Make = Callable[..., OpenedProject]


def make_service(opened: OpenedProject, make_training=make_fake) -> TrainingService:
    launch = partial(inline, make_training=make_training)
    return TrainingService(opened.project, opened.clips, holdout=opened.holdout, launch=launch)


def run_out(service: TrainingService) -> list[ClipEvent]:
    """Poll until nothing trains. Returns all events."""
    events, until_s = list[ClipEvent](), time.monotonic() + DEADLINE_S
    while service.is_busy:
        assert time.monotonic() < until_s
        events += service.poll()
    return events


def trained_order(events: list[ClipEvent]) -> list[int]:
    return [clip_index for clip_index, event in events if isinstance(event, ClipTrained)]


@pytest.fixture
def six(make_opened: Make) -> OpenedProject:
    """Six clips of one frame."""
    from dataclasses import replace

    from app.project.opening.opened_project import opened_project

    opened = make_opened()
    opened.project.update(replace(opened.project.settings, clip_length=1))
    return opened_project(opened.capture, opened.project, 1)


def test_waiting_clips_are_moved_and_taken_out() -> None:
    queue = TrainQueue()
    for index in (3, 1, 4, 5):
        queue.add(index)
    queue.add(1)
    queue.move(5, 0)
    queue.move(3, 99)
    queue.move(77, 0)
    assert list(queue) == [5, 1, 4, 3]
    queue.remove(1)
    queue.remove(1)
    assert list(queue) == [5, 4, 3]
    queue.is_held = True
    for index in (5, 4, 3):
        queue.remove(index)
    assert not queue.is_held, "an empty queue holds nothing"


@pytest.mark.slow
def test_clips_are_trained_in_the_order_they_were_put_in(six: OpenedProject) -> None:
    service = make_service(six)
    assert service.enqueue_all(range(6)) == []
    assert (service.running_clip, list(service.queue)) == (0, [1, 2, 3, 4, 5])
    service.queue.move(5, 0)
    service.queue.remove(3)
    assert trained_order(run_out(service)) == [0, 5, 1, 2, 4]
    assert service.queue.n_done == 5
    assert service.enqueue_all([0, 1, 3]) == []
    assert service.running_clip == 3, "what is finished is not trained again"
    assert service.queue.n_done == 0, "another sequence"
    run_out(service)


def test_what_a_clip_needs_is_trained_before_it(six: OpenedProject) -> None:
    service = make_service(six)
    service.enqueue_all([4])
    assert (service.running_clip, list(service.queue)) == (0, [4])
    run_out(service)
    assert service.catalog[4].state == "trained"


def test_clips_that_go_on_from_each_other_need_the_one_before(tmp_path) -> None:
    chain = make_chain(tmp_path / "chain", 4)
    assert [needed_clips(chain, index) for index in range(4)] == [(), (0,), (0, 1), (0, 2)]
    alone = make_project(tmp_path / "alone", overrides={"independent": True}, reference_clip=1)
    assert [needed_clips(alone, index) for index in range(3)] == [(), (), ()]
    on = make_project(tmp_path / "on", overrides={"independent": True, "start": "previous"}, reference_clip=1)
    assert [needed_clips(on, index) for index in range(3)] == [(1,), (), (0,)]


def test_a_failed_clip_says_why_and_the_queue_goes_on_without_it(six: OpenedProject) -> None:
    def fails_once(job: TrainJob, store, report) -> FakeTraining:
        training = make_fake(job, store, report)
        training.fails_at = 2 if job.clip_index == 2 else None
        return training

    service = make_service(six, fails_once)
    service.enqueue_all(range(4))
    events = run_out(service)
    assert trained_order(events) == [0, 1, 3]
    status = ClipStatuses(service).all()[2]
    assert status.state == "failed"
    assert "nan at step 3" in status.reason
    assert "nan at step 3" in service.queue.failed[2]
    service._launch = inline  # whatever made it fail is gone
    service.enqueue(2)
    assert service.queue.failed == {}
    run_out(service)
    assert ClipStatuses(service).all()[2].state == "trained"


def test_clips_that_need_a_failed_one_leave_the_queue(six: OpenedProject) -> None:
    def fails(job: TrainJob, store, report) -> FakeTraining:
        raise NonFiniteLoss("The loss became nan.")

    service = make_service(six, fails)
    service.enqueue_all(range(3))
    events = run_out(service)
    assert [event.kind for _, event in events if isinstance(event, TrainingFailed)] == ["NonFiniteLoss"]
    assert (list(service.queue), service.take_dropped(), service.take_dropped()) == ([], [1, 2], [])


def test_the_queue_is_held_after_a_clip_and_goes_on_when_told(six: OpenedProject) -> None:
    service = make_service(six)
    service.enqueue_all(range(3))
    service.stop_after_clip(True)
    service.stop_after_clip(False)
    service.stop_after_clip(True)
    assert trained_order(run_out(service)) == [0]
    assert (service.queue.is_held, list(service.queue), training_status(service).state) == (True, [1, 2], "idle")
    assert service.next_clip_index == 1, "what a button would start"
    service.go_on()
    assert trained_order(run_out(service)) == [1, 2]


@pytest.mark.parametrize("is_all", [False, True])
def test_whoever_trains_something_goes_on_with_a_held_queue(six: OpenedProject, is_all: bool) -> None:
    service = make_service(six)
    service.enqueue_all(range(3))
    service.stop_after_clip(True)
    run_out(service)
    if is_all:
        service.enqueue_all(range(3))
    else:
        service.enqueue(4)
    assert (service.running_clip, service.queue.is_held) == (1, False)
    assert trained_order(run_out(service)) == [1, 2] + ([] if is_all else [4])


def test_a_damaged_clip_and_those_that_need_it_are_left_out(six: OpenedProject) -> None:
    write_trained(six, 0).write_bytes(b"\xff" * 64)
    service = make_service(six)
    assert service.enqueue_all(range(6)) == [0, 1, 2, 3, 4, 5]
    assert not service.is_busy
    with pytest.raises(ProjectError, match="whose file is damaged"):
        service.enqueue(2)


def test_one_clip_has_settings_of_its_own(six: OpenedProject) -> None:
    service = make_service(six)
    service.enqueue(0, {"joint_steps": 9})
    run_out(service)
    assert read_clip_state(six.project.clip_path(0)).header.step == 9
    assert six.project.settings.overrides == {}
    service.enqueue(1)
    run_out(service)
    assert read_clip_state(six.project.clip_path(1)).header.step == 6
    with pytest.raises(ProjectError, match="share gaussians_per_anchor"):
        service.enqueue(1, {"gaussians_per_anchor": 3})
    with pytest.raises(ProjectError, match="has to be"):
        service.enqueue(1, {"source_steps": -4})
    assert not service.is_busy


def test_a_stopped_training_is_given_up_for_other_settings_and_goes_on_with_them(six: OpenedProject) -> None:
    service = make_service(six, make_slow)
    service.enqueue(0)
    for _ in range(5):
        service.poll()
    service.stop()
    run_out(service)
    assert service.catalog[0].resume_step is not None
    service.enqueue(0, {"joint_steps": 50})
    assert service.catalog[0].resume_step is None
    for _ in range(3):
        service.poll()
    service.stop()
    run_out(service)
    service.enqueue(0)
    assert service.leading is not None
    assert service.leading.worker.job.overrides == {"joint_steps": 50}
    service.close()


def test_settings_of_one_clip_are_those_that_leave_the_others_alone(six: OpenedProject) -> None:
    for index in (0, 1):
        assert set(offered(six.project, index)) <= set(ALLOWED)
    assert "joint_steps" in offered(six.project, 0)
    assert "source_steps" in offered(six.project, 1)
    frames = replace(six.project.settings, overrides={"gate": "off", "cloud": "frames"})
    with_frames: Any = SimpleNamespace(settings=frames)
    assert set(offered(six.project, 0)) - set(offered(with_frames, 0)) == {"static_steps"}, "there is no such phase"
    shared = {"static_feature_dim", "gaussians_per_anchor", "color", "gate", "decoder", "inherit", "field"}
    assert not shared & set(ALLOWED)
    assert with_own(six.project, {"source_steps": 7, "residual": "none"}) == {"source_steps": 7, "residual": "none"}


@pytest.mark.parametrize(("mode", "n_expected"), [("off", 0), ("low", 2), ("live", 6)])
def test_how_often_snapshots_are_written(six: OpenedProject, mode: str, n_expected: int) -> None:
    from app.training.worker.run import TrainingRun

    now_s = [0.0]
    commands: list[object] = []
    events: list[object] = []
    training = TrainingRun(
        train_job(six.project, six.clips[0], holdout=(0,), live_view=mode),
        lambda: FolderStore(six.project.folder),
        receive=lambda wait_s: commands.pop(0) if commands else None,  # type: ignore[arg-type, return-value]
        send=events.append,
        make_training=make_slow,
        can_wait=False,
        clock=lambda: now_s[0],
    )
    from app.training.messages import SetSnapshots, SnapshotConsumed

    def advance(n_seconds: int) -> int:
        before = sum(isinstance(event, SnapshotWritten) for event in events)
        for _ in range(n_seconds):
            now_s[0] += 1.0
            training.advance()
            written = [event for event in events if isinstance(event, SnapshotWritten)]
            if written:
                commands.append(SnapshotConsumed(written[-1].revision))
        return sum(isinstance(event, SnapshotWritten) for event in events) - before

    assert advance(12) in (n_expected, n_expected + 1)
    commands.append(SetSnapshots("off"))
    advance(1)
    assert advance(20) == 0
    commands.append(SetSnapshots("live"))
    assert advance(2) >= 1, "asked for again, it comes at once"
    assert keeper.LOW_SNAPSHOT_EVERY_S > keeper.SNAPSHOT_EVERY_S


def test_the_live_view_reaches_a_running_worker_and_the_next_one(six: OpenedProject) -> None:
    service = make_service(six, make_slow)
    service.enqueue(0)
    service.poll()
    service.set_live_view("off")
    service.poll()
    assert service.leading is not None
    assert service.leading.worker._run._keeper._live_view == "off"  # type: ignore[attr-defined]
    service.close()
    service.enqueue(0)
    assert service.leading is not None
    assert service.leading.worker.job.live_view == "off"
    service.close()
    with pytest.raises(ValueError, match="off, low, live"):
        service.set_live_view("sometimes")
