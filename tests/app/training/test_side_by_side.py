"""Several workers of one service: who starts when, what each is told, and what is shown of them."""

from __future__ import annotations

import os
from functools import partial

import pytest

from app.evaluation.headless import ClipOutcome, train_clips
from app.project.claims.claims import Claims
from app.project.opening.opened_project import OpenedProject
from app.training.jobs import train_job
from app.training.messages import ClipTrained
from app.training.process import ProcessWorker
from app.training.service import TrainingService
from app.training.training_status import ClipStatuses, training_status
from app.training.worker import worker
from app.training.worker.interface import MakeTraining
from app.training.worker.worker import n_training_threads
from engine.clip_files.clip_state import read_clip_state
from engine.errors import DiskError, NonFiniteLoss
from engine.parallel import CORES_VARIABLE, n_cores
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
    assert [(row.clip_index, row.state) for row in status.trainings] == [(1, "paused"), (2, "running")]
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


def fails_in(failing: int, error: Exception) -> MakeTraining:
    def make(job, store, report):
        if job.clip_index == failing:
            raise error
        return make_fake(job, store, report)

    return make


def trained(service: TrainingService, begun: list[int] | None = None) -> dict[int, ClipOutcome]:
    outcomes = train_clips(
        service,
        range(6),
        on_status=lambda status: None,
        on_event=lambda event: None,
        on_outcome=lambda outcome: None,
        on_begin=(begun if begun is not None else []).append,
        sleep=lambda seconds: None,
    )
    assert sorted(outcome.clip_index for outcome in outcomes) == list(range(6)), "each of them, once"
    return {outcome.clip_index: outcome for outcome in outcomes}


def states_of(outcomes: dict[int, ClipOutcome]) -> str:
    """Their first letters: trained, skipped, failed, left_out."""
    return "".join(outcomes[index].state[0] for index in range(6))


@pytest.mark.slow
@pytest.mark.parametrize("n_workers", [1, 2, 3])
def test_a_failure_stops_only_clips_that_need_the_failed_one(six: OpenedProject, n_workers: int) -> None:
    begun: list[int] = []
    failing = fails_in(2, NonFiniteLoss("The loss became nan."))
    assert states_of(trained(make_service(six, failing, n_workers), begun)) == "ttfttt"
    assert sorted(begun) == list(range(6))
    assert states_of(trained(make_service(six, make_fake, n_workers))) == "sstsss"


@pytest.mark.parametrize("n_workers", [1, 2])
def test_without_a_reference_clip_no_other_is_begun(six: OpenedProject, n_workers: int) -> None:
    begun: list[int] = []
    outcomes = trained(make_service(six, fails_in(0, NonFiniteLoss("nan")), n_workers), begun)
    assert states_of(outcomes) == "flllll"
    assert {outcome.left_out_by for outcome in outcomes.values()} == {None, 0}
    assert begun == [0]


def test_a_disk_that_fails_lets_no_other_clip_begin(six: OpenedProject) -> None:
    write_trained(six, 0)
    begun: list[int] = []
    outcomes = trained(make_service(six, fails_in(2, DiskError("The disk is full."))), begun)
    assert (outcomes[2].state, outcomes[1].state) == ("failed", "trained")
    assert [outcomes[index].left_out_by for index in (4, 5)] == [2, 2]
    assert set(begun) <= {1, 2, 3}, "those that trained next to it"


@pytest.mark.parametrize(
    ("cores", "is_window_open", "n_beside", "expected"),
    [(1, False, 2, 1), (2, False, 2, 1), (8, False, 2, 4), (8, True, 2, 3)],
)
def test_they_share_the_cores(cores: int, is_window_open: bool, n_beside: int, expected: int) -> None:
    assert n_training_threads(cores, is_window_open=is_window_open, n_beside=n_beside) == expected


def test_a_claim_of_a_clip_that_does_not_exist_is_passed_over(six: OpenedProject) -> None:
    other = Claims(six.project.folder, has_thread=False)
    for key in ("0003", "0099"):  # clips were cut otherwise when it was claimed, or somebody made the file
        other.take(key)
    service = make_service(six)
    service.claims.look()
    assert list(service.elsewhere) == [3]
    assert len(ClipStatuses(service).all()) == len(training_status(service).trainings) + 5
    service.close()
    other.close()


def test_a_worker_computes_everything_with_its_share(six: OpenedProject, monkeypatch) -> None:
    for name in (CORES_VARIABLE, "NUMBA_NUM_THREADS"):
        monkeypatch.setenv(name, "")  # put back afterwards
        monkeypatch.delenv(name)
    monkeypatch.setattr(worker, "n_cores", lambda: 8)
    monkeypatch.setattr(worker, "use_threads", lambda n: n)
    job = train_job(six.project, six.clips[1], is_window_open=False, n_beside=4)
    assert worker._set_threads(job) == 2
    assert (os.environ[CORES_VARIABLE], os.environ["NUMBA_NUM_THREADS"]) == ("2", "2")
    assert n_cores() <= 2


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

    launch = partial(ProcessWorker, start=begin)  # pyright: ignore[reportArgumentType]
    for clip_index, cpu in enumerate(PROCESSORS):
        write_trained(six, 0)
        service = TrainingService(six.project, six.clips, holdout=six.holdout, cpu=cpu, launch=launch)
        with pytest.raises(Begun):
            service.enqueue_all([clip_index + 1])
    assert begun == [{"OF": "native"}, {"OF": "portable"}]
