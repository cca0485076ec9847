"""Two services of one project, as of two processes: who trains what, and what each sees of the other."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial

import pytest

from app.evaluation.headless import train_clips
from app.project.claims.asks import Ask, ask_holder
from app.project.claims.claim_files import ClaimFile, make_claim
from app.project.claims.claims import Claims
from app.project.clips.finished_clip import take_in_left_over
from app.project.disk.discarding import discard, training_of
from app.project.opening.opened_project import OpenedProject
from app.project.opening.project_access import open_for_clips, open_project
from app.training.messages import ClipTrained, TrainingFailed
from app.training.service import TrainingService
from app.training.training_status import ClipStatuses, training_status
from app.training.worker.keeper import CHECKPOINT_EVERY_S, Keeper
from engine.errors import ProjectError
from tests.app.conftest import DEADLINE_S, inline
from tests.app.fakes import make_fake, make_slow
from tests.app.training.test_train_queue import run_out, six

__all__ = ["six"]


def make_service(opened: OpenedProject, make_training=make_fake, *, is_other: bool = False) -> TrainingService:
    """is_other: As of another process, which has no lock."""
    project = open_for_clips(opened.project.folder) if is_other else opened.project
    service = TrainingService(
        project,
        opened.clips,
        holdout=opened.holdout,
        launch=partial(inline, make_training=make_training),
        is_window_open=False,
        claims=Claims(project.folder, has_thread=False),
    )
    service.claims._describe = service._described
    return service


def make_service_like(one: TrainingService) -> TrainingService:
    service = TrainingService(
        open_for_clips(one.project.folder),
        one.clips,
        holdout=one.holdout,
        launch=partial(inline, make_training=make_fake),
        is_window_open=False,
        claims=Claims(one.project.folder, has_thread=False),
    )
    service.claims._describe = service._described
    return service


@pytest.fixture
def pair(six: OpenedProject) -> Iterator[tuple[TrainingService, TrainingService]]:
    one, other = make_service(six), make_service(six, make_slow, is_other=True)
    one.enqueue(0)
    run_out(one)
    other.catalog.update(0)
    yield one, other
    one.close()
    other.close()


def look(*services: TrainingService) -> None:
    for service in services:
        service.claims._beaten_s = -1e9  # a beat is due
        service.claims.look()


def test_a_clip_that_another_process_trains_is_left_to_it(pair) -> None:
    one, other = pair
    other.enqueue(1)
    other.poll()
    look(other, one)
    assert one.next_clip_index == 2
    shown = training_status(one).trainings
    assert [(clip.clip_index, clip.is_elsewhere) for clip in shown] == [(1, True)]
    assert ClipStatuses(one).all()[1].state in ("training", "preparing")
    one.add(1)
    one.enqueue(2)
    assert ended_of(one) == [2]
    assert list(one.queue) == [1], "it waits"
    other.stop(1)
    run_out(other)
    look(one)
    assert ended_of(one) == [1], "given up there, trained here"


def test_what_another_process_finishes_is_finished_here(pair) -> None:
    one, _ = pair
    other = make_service_like(one)
    look(one)
    other.enqueue(3)
    look(one)
    one.add(3)
    one.go_on()
    assert not one.runs
    run_out(other)
    look(one)
    assert [(index, type(event)) for index, event in one.poll()] == [(3, ClipTrained)]
    assert one.catalog[3].state == "trained"
    assert not one.queue
    other.close()


def ended_of(service: TrainingService) -> list[int]:
    """Clips that end before nothing trains any more, though others may wait."""
    ended, until_s = list[int](), time.monotonic() + DEADLINE_S
    while True:
        ended += [index for index, event in service.poll() if isinstance(event, ClipTrained)]
        if not service.runs:
            return ended
        assert time.monotonic() < until_s
        time.sleep(0.002)  # clips arrive on a thread


def test_others_can_pause_and_stop_it(pair) -> None:
    one, other = pair
    other.enqueue(1)
    other.poll()
    key = other.project.clip_name(1)
    asks: list[tuple[Ask, str]] = [("pause", "paused"), ("resume", "running")]
    for ask, state in asks:
        ask_holder(one.project.folder, key, ask)
        look(other)
        other.poll()
        other.poll()
        assert other.runs[1].is_paused == (state == "paused")
    ask_holder(one.project.folder, key, "stop")
    look(other)
    run_out(other)
    assert not other.runs
    assert one.project.checkpoint_path(1).is_file(), "progress is kept"


def test_a_run_whose_claim_is_lost_ends_and_puts_nothing_in_place(pair) -> None:
    _, other = pair
    other.enqueue(1)
    other.poll()
    other.claims._lost.add(other.project.clip_name(1))
    events = [event for index, event in other.poll() if index == 1]
    assert isinstance(events[-1], TrainingFailed)
    assert events[-1].kind == "ClipClaimed"
    assert not other.project.is_trained(1)


def test_train_clips_waits_for_what_another_process_trains(pair) -> None:
    one, _ = pair
    other = make_service_like(one)
    other.enqueue(1)
    look(one)

    def meanwhile(_: float) -> None:
        run_out(other)
        look(one)

    said: list[object] = []
    outcomes = train_clips(
        one, [1, 2], on_status=said.append, on_event=said.append, on_outcome=said.append, sleep=meanwhile
    )
    assert sorted((outcome.clip_index, outcome.state) for outcome in outcomes) == [(1, "trained"), (2, "trained")]
    other.close()


def test_settings_cannot_change_while_another_process_trains(pair) -> None:
    one, other = pair
    other.enqueue(1)
    other.poll()
    with pytest.raises(ProjectError, match="trains clip 1"):
        discard(one.project, training_of(one.project))


def test_a_window_that_opens_and_closes_leaves_what_others_train(pair) -> None:
    """Its sweep, and clips that it takes in."""
    one, other = pair
    other.enqueue(1)
    other.poll()
    key, folder = other.project.clip_name(1), other.project.folder
    files = [other.project.files(1).snapshot(1), folder / "live" / f"{key}-p7-0a1b2c3d-final.safetensors"]
    files += [other.project.files(1).handed_over, folder / "clips" / f".partial-7@00000000-{key}.safetensors"]
    for path in files:
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(one.project.clip_path(0).read_bytes())
    one.close()
    one.project.close()
    open_project(folder).close()
    assert all(path.is_file() for path in files)
    assert not one.project.is_trained(1)
    files[2].unlink()
    other.stop(1)
    run_out(other)
    open_project(folder).close()
    assert [path for path in files if path.is_file()] == files[-1:], "of a computer whose processes nobody here sees"


def test_a_project_that_others_train_into_is_not_taken_back(pair) -> None:
    one, other = pair
    other.enqueue(1)
    other.poll()
    one.project.remove_files()
    assert one.project.is_trained(0)
    other.stop(1)
    run_out(other)
    one.project.remove_files()
    assert not one.project.is_trained(0)


def test_a_reference_that_is_trained_again_meanwhile_makes_the_clip_out_of_date(pair) -> None:
    one, other = pair
    look(one)
    other.enqueue(1)
    other.poll()
    one.enqueue(0, {"joint_steps": 9})
    run_out(one)
    other.runs[1].worker._run._training.n_steps = 3  # it comes to its end
    run_out(other)
    assert other.project.is_trained(1)
    look(one)
    one.poll()
    assert one.catalog[1].state == "stale"
    one.enqueue(1)
    run_out(one)
    assert one.catalog[1].state == "trained"


def test_a_worker_whose_clip_was_taken_over_hands_nothing_over(pair) -> None:
    """It goes on while its own process is halted, which cannot end it."""
    one, other = pair
    other.enqueue(1)
    other.poll()
    key = other.project.clip_name(1)
    make_claim(ClaimFile(other.project.folder, key, 2), one.claims.token)
    worker = other.runs[1].worker
    worker._run._training.n_steps = 3
    events = [event for _ in range(9) for event in worker.poll()]
    assert isinstance(events[-1], TrainingFailed)
    assert events[-1].kind == "ClipClaimed"
    assert not other.project.files(1).handed_over.exists()
    assert not other.project.checkpoint_path(1).exists()


def test_what_was_handed_over_is_taken_in_by_one(pair) -> None:
    one, other = pair
    key, folder = one.project.clip_name(0), one.project.folder
    handed_over = one.project.files(0).handed_over
    handed_over.parent.mkdir(exist_ok=True)
    one.project.clip_path(0).rename(handed_over)
    other.claims.take(key)
    take_in_left_over(one.project)
    assert not one.project.is_trained(0), "the other one does"
    other.claims.release(key)
    take_in_left_over(one.project)
    assert one.project.is_trained(0)
    assert list((folder / "claims").iterdir()) == []


def test_clips_that_others_train_take_no_place_of_a_worker(pair) -> None:
    one, _ = pair
    other = make_service_like(one)
    one.n_workers, other.n_workers = 2, 2
    other.enqueue_all([1, 2])
    look(other, one)
    ended, until_s = list[int](), time.monotonic() + DEADLINE_S

    def wait(_: float) -> None:
        if set(ended) >= {3, 4, 5}:
            other.poll()
        look(other, one)
        assert time.monotonic() < until_s

    outcomes = train_clips(
        one,
        range(1, 6),
        on_status=lambda status: None,
        on_event=lambda event: None,
        on_outcome=lambda outcome: ended.append(outcome.clip_index),
        sleep=wait,
    )
    assert ended[:3] == [3, 4, 5], "while the others are in training elsewhere"
    assert {outcome.state for outcome in outcomes} == {"trained"}
    assert sorted(ended) == [1, 2, 3, 4, 5]
    other.close()


def test_hundreds_that_share_a_disk_write_checkpoints_less_often(pair) -> None:
    one, other = pair
    other.enqueue(1)
    other.poll()
    assert other.runs[1].worker.job.n_everywhere == 1
    for number in range(98):
        (one.project.folder / "claims" / f"holder-{number:032x}.json").write_text("{}")
    one.enqueue(2)
    job = one.runs[2].worker.job
    assert job.n_everywhere == 100, "the other one and this one are among them"
    keeper = Keeper(job, None, send=print, watch=None, clock=lambda: 0.0)  # pyright: ignore[reportArgumentType]
    assert keeper._checkpoint_cadence._every_s == 5 * CHECKPOINT_EVERY_S
