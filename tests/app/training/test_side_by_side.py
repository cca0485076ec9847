"""Several workers of one service: who starts when, what each is told, and what is shown of them."""

from __future__ import annotations

from functools import partial

import pytest

from app.evaluation.headless import train_clips
from app.project.opening.opened_project import OpenedProject
from app.training.messages import ClipTrained
from app.training.service import TrainingService
from app.training.training_status import ClipStatuses, training_status
from app.training.worker.worker import n_training_threads
from engine.clip_files.clip_state import read_clip_state
from engine.errors import NonFiniteLoss
from engine.portable import PROCESSORS
from tests.app.conftest import inline
from tests.app.fakes import make_fake, make_slow, write_trained
from tests.app.training.test_train_queue import run_out, six

__all__ = ["six"]


def make_service(opened: OpenedProject, make_training=make_fake, n_workers: int = 2) -> TrainingService:
    launch = partial(inline, make_training=make_training)
    return TrainingService(
        opened.project, opened.clips, holdout=opened.holdout, launch=launch, n_workers=n_workers, is_window_open=False
    )


def slow_sources(job, store, report):
    return make_fake(job, store, report) if job.reference is None else make_slow(job, store, report)


def test_source_clips_train_side_by_side_once_the_reference_is_finished(six: OpenedProject) -> None:
    service = make_service(six)
    service.enqueue_all(range(6))
    assert (list(service.runs), list(service.queue)) == ([0], [1, 2, 3, 4, 5])
    assert service.runs[0].worker.job.n_beside == 1, "alone it has all cores"
    while 0 in service.runs:
        service.poll()
    assert list(service.runs) == [1, 2]
    assert [run.worker.job.n_beside for run in service.runs.values()] == [2, 2]
    order = [clip_index for clip_index, event in run_out(service) if isinstance(event, ClipTrained)]
    assert sorted(order) == [1, 2, 3, 4, 5]
    assert all(service.catalog[index].state == "trained" for index in range(6))


def test_their_clips_are_those_of_one_after_the_other(make_opened) -> None:
    found = []
    for name, n_workers in (("one", 1), ("two", 2)):
        opened = make_opened(name)
        service = make_service(opened, n_workers=n_workers)
        service.enqueue_all(range(2))
        run_out(service)
        found.append([read_clip_state(opened.project.clip_path(index)).fingerprint for index in range(2)])
    assert found[0] == found[1]


def test_each_is_paused_and_stopped_by_itself_or_all_of_them(six: OpenedProject) -> None:
    write_trained(six, 0)
    service = make_service(six, slow_sources)
    service.enqueue_all([1, 2, 3])
    for _ in range(5):
        service.poll()
    service.pause(1)
    service.poll()
    statuses = ClipStatuses(service).all()
    assert [status.state for status in statuses[1:4]] == ["paused", "training", "queued"]
    status = training_status(service)
    assert (status.clip_index, status.state, status.n_running) == (1, "paused", 2), "the one that began first"
    service.stop(2)
    while 2 in service.runs:
        service.poll()
    assert (list(service.runs), service.catalog[2].state) == ([1, 3], "stopped")
    service.resume()
    assert not service.runs[1].is_paused
    service.stop()
    run_out(service)
    assert [service.catalog[index].state for index in (1, 3)] == ["stopped", "stopped"] or not service.queue


def test_live_states_are_told_apart(six: OpenedProject) -> None:
    write_trained(six, 0)
    service = make_service(six, slow_sources)
    service.enqueue_all([1, 2])
    for _ in range(3):
        service.poll()
    shown = [service.shown_state(index) for index in (1, 2)]
    assert all(state is not None and state.is_live for state in shown)
    assert len({state.revision for state in shown if state is not None}) == 2
    assert [state.file.name for state in shown if state is not None] == [
        "clip-0001-r0001.safetensors",
        "clip-0002-r0001.safetensors",
    ]
    service.close()
    assert not service.is_busy
    assert service.catalog[2].resume_step


@pytest.mark.slow
@pytest.mark.parametrize("n_workers", [1, 2, 3])
def test_the_command_line_trains_several_and_begins_none_after_a_failure(six: OpenedProject, n_workers: int) -> None:
    def fails(job, store, report):
        if job.clip_index == 2:
            raise NonFiniteLoss("The loss became nan.")
        return make_fake(job, store, report)

    service, begun = make_service(six, fails, n_workers), []
    outcomes = train_clips(
        service,
        range(6),
        on_status=lambda status: None,
        on_event=lambda event: None,
        on_outcome=lambda outcome: None,
        on_begin=begun.append,
        sleep=lambda seconds: None,
    )
    states = {outcome.clip_index: outcome.state for outcome in outcomes}
    assert states[0] == states[1] == "trained"
    assert states[2] == "failed"
    assert begun == sorted(states)
    assert len(begun) <= 2 + n_workers
    again = make_service(six, make_fake, n_workers)
    outcomes = train_clips(
        again,
        range(6),
        on_status=lambda status: None,
        on_event=lambda event: None,
        on_outcome=lambda outcome: None,
        sleep=lambda seconds: None,
    )
    assert sorted(outcome.clip_index for outcome in outcomes) == list(range(6))
    assert {outcome.state for outcome in outcomes} == {"trained", "skipped"}


@pytest.mark.parametrize(
    ("cores", "is_window_open", "n_beside", "expected"),
    [(1, False, 2, 1), (2, False, 2, 1), (8, False, 2, 4), (8, True, 2, 3)],
)
def test_they_share_the_cores(cores: int, is_window_open: bool, n_beside: int, expected: int) -> None:
    assert n_training_threads(cores, is_window_open=is_window_open, n_beside=n_beside) == expected


def test_a_training_with_portable_numbers_begins_with_the_variables_that_libraries_read(
    six: OpenedProject, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[dict[str, str]] = []
    monkeypatch.setattr("app.training.process.environment_of", lambda cpu: {"OF": cpu})

    class Begun(Exception):
        pass

    def begin(kind: object, task: object, environment: dict[str, str]) -> None:
        begun.append(environment)
        raise Begun

    monkeypatch.setattr("app.training.process.ChildProcess", begin)
    for clip_index, cpu in enumerate(PROCESSORS):
        write_trained(six, 0)
        service = TrainingService(six.project, six.clips, holdout=six.holdout, cpu=cpu)
        with pytest.raises(Begun):
            service.enqueue_all([clip_index + 1])
    assert begun == [{"OF": "native"}, {"OF": "portable"}]
