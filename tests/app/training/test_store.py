"""A worker knows nothing but its store: another one gives the same clip. Its owner takes in what it hands over."""

from __future__ import annotations

import errno
import os
import shutil
from functools import partial
from pathlib import Path

import pytest

from app.project.clips.clip_versions import list_versions
from app.project.clips.finished_clip import take_in
from app.project.opening.opened_project import OpenedProject
from app.project.opening.project_access import open_project
from app.training.jobs import train_job
from app.training.messages import ClipTrained, Pause, Resume, TrainingFailed, TrainingStopped, WarningRaised
from app.training.service import TrainingService
from app.training.store import ClipStore
from app.training.worker import disk_retries
from app.training.worker.folder_store import FolderStore
from app.training.worker.run import TrainingRun
from engine.clip_files.clip_state import read_clip_state
from engine.errors import ProjectError
from tests.app.conftest import inline
from tests.app.fakes import make_fake, make_slow, write_trained
from tests.app.test_failing_disk import Disk
from tests.app.training.memory_store import MemoryStore
from tests.app.training.test_train_queue import make_service, run_out


def train(job, store: ClipStore, make_training=make_fake, commands=()) -> list[object]:
    """Run a training to its end; all commands come before the first step."""
    events, left = [], list(commands)
    run = TrainingRun(
        job,
        lambda: store,
        receive=lambda wait_s: left.pop(0) if left else None,
        send=events.append,
        make_training=make_training,
        can_wait=False,
    )
    while run.advance():
        pass
    return events


def arrays_of(content: bytes, scratch: Path) -> dict[str, bytes]:
    scratch.write_bytes(content)
    return {name: array.tobytes() for name, array in read_clip_state(scratch).arrays.items()}


def test_a_store_in_memory_gives_the_clip_that_the_folder_gives(make_opened, tmp_path):
    opened: OpenedProject = make_opened()
    write_trained(opened, 0)
    project, job = opened.project, train_job(opened.project, opened.clips[1])
    store, folder = MemoryStore(project, tmp_path / "scratch"), FolderStore(project.folder)
    before = sorted(project.folder.rglob("*"))
    events = train(job, store, commands=[Pause(), Resume()])
    assert isinstance(events[-1], ClipTrained)
    assert sorted(project.folder.rglob("*")) == before, "nothing is written beside the store"
    assert store.snapshots == {}
    train(job, folder)
    of_folder = project.files(1).handed_over.read_bytes()
    assert arrays_of(store.clips["0001"], tmp_path / "a") == arrays_of(of_folder, tmp_path / "b")


# ---------------------------------------------------------------- taking in


def test_a_worker_leaves_the_finished_clip_to_the_owner_of_the_lock(make_opened):
    opened: OpenedProject = make_opened()
    before = write_trained(opened, 0, n_steps=2).read_bytes()
    project = opened.project
    train(train_job(project, opened.clips[0]), FolderStore(project.folder))
    assert project.clip_path(0).read_bytes() == before
    assert list_versions(project, 0) == []
    with pytest.raises(ProjectError, match="read-only"):
        take_in(open_project(project.folder, is_writable=False), 0)
    assert take_in(project, 0)
    (version,) = list_versions(project, 0)
    assert version.path.read_bytes() == before
    assert read_clip_state(project.clip_path(0)).header.step == 6
    assert project.metrics_path(0).is_file()
    assert not list(project.live_dir.iterdir())
    assert not take_in(project, 0)


def test_what_was_handed_over_when_the_program_was_killed_is_taken_in_when_it_opens(make_opened):
    project = (opened := make_opened()).project
    train(train_job(project, opened.clips[0]), FolderStore(project.folder))
    project.close()
    open_project(project.folder, is_writable=False)
    assert not project.is_trained(0)
    again = open_project(project.folder)
    assert again.is_trained(0)
    again.close()


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS])
def test_a_finished_clip_stays_where_it_cannot_be_kept_as_a_version(make_opened, monkeypatch, number):
    monkeypatch.setattr(disk_retries, "RETRY_AFTER_S", (0.0,))
    opened = make_opened()
    before = write_trained(opened, 0, n_steps=2).read_bytes()
    service, is_full = make_service(opened), [True]
    link, copy = os.link, shutil.copy2

    def refuse(instead):
        def act(source, target, **options):
            if is_full[0] and "versions" in str(target):
                raise OSError(number, os.strerror(number), str(target))
            return instead(source, target, **options)

        return act

    monkeypatch.setattr("os.link", refuse(link))
    monkeypatch.setattr("shutil.copy2", refuse(copy))
    service.enqueue(0)
    said = []
    while not any(isinstance(event, WarningRaised) for _, event in said):
        said += service.poll()
    assert opened.project.clip_path(0).read_bytes() == before
    (told,) = [event for _, event in said if isinstance(event, WarningRaised)]
    assert "could not be put in its place" in told.title
    assert "The earlier version of the clip could not be written" in told.detail
    is_full[0] = False
    said = run_out(service)
    assert [type(event) for _, event in said if not isinstance(event, WarningRaised)][-1] is ClipTrained
    (version,) = list_versions(opened.project, 0)
    assert version.path.read_bytes() == before


def test_a_clip_that_waits_for_room_can_be_stopped_and_is_taken_in_when_it_is_trained_again(make_opened, monkeypatch):
    opened = make_opened()
    service, disk = make_service(opened), Disk(monkeypatch, "clips")
    service.enqueue(0)
    while not any(isinstance(event, WarningRaised) for _, event in service.poll()):
        pass
    service.stop()
    assert isinstance(run_out(service)[-1][1], TrainingStopped)
    disk.is_full = False
    service._launch = partial(inline, make_training=make_slow)  # would not end
    service.enqueue(0)
    assert isinstance(run_out(service)[-1][1], ClipTrained)
    assert service.catalog[0].state == "trained"


def test_without_a_window_it_gives_up_and_the_project_takes_it_in_when_it_opens(make_opened, monkeypatch):
    monkeypatch.setattr(disk_retries, "PATIENCE_S", 0.0)
    opened = make_opened()
    launch = partial(inline, make_training=make_fake)
    service = TrainingService(opened.project, opened.clips, holdout=opened.holdout, launch=launch, is_window_open=False)
    disk = Disk(monkeypatch, "clips")
    service.enqueue(0)
    failed = run_out(service)[-1][1]
    assert isinstance(failed, TrainingFailed)
    assert failed.kind == "DiskError"
    assert "No space left on device" in failed.message
    disk.is_full = False
    opened.project.close()
    again = open_project(opened.project.folder)
    assert again.is_trained(0)
    again.close()


def test_a_training_that_ends_while_its_service_closes_is_taken_in(make_opened):
    opened = make_opened()
    service = make_service(opened)
    service.enqueue(0)
    service.poll()
    train(train_job(opened.project, opened.clips[0]), FolderStore(opened.project.folder))
    service.close()
    assert opened.project.is_trained(0)
