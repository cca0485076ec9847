"""What a training does while the disk refuses, or after its folder has gone."""

import shutil

import pytest

from app.document.storing.document_file import PROJECT_FILE
from app.training.messages import WarningRaised
from app.training.worker.disk_retries import (
    PATIENCE_S,
    PATIENCE_UNKEPT_S,
    RETRY_AFTER_S,
    FolderWatch,
    ProjectGone,
    Refusals,
    Retries,
)
from engine.errors import ProjectError


class Clock:
    """Stands still until it is told."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def test_waits_grow_and_the_last_one_repeats():
    clock = Clock()
    retries = Retries(is_endless=True, clock=clock)
    assert retries.is_first
    assert retries.wait_s == 0.0
    waits = []
    for _ in range(len(RETRY_AFTER_S) + 2):
        assert retries.failed(is_kept=False)
        waits.append(retries.wait_s)
        clock.now_s += retries.wait_s
        assert retries.wait_s == 0.0
    assert waits == [*RETRY_AFTER_S, RETRY_AFTER_S[-1], RETRY_AFTER_S[-1]]
    assert not retries.is_first


@pytest.mark.parametrize(("is_kept", "patience_s"), [(True, PATIENCE_S), (False, PATIENCE_UNKEPT_S)])
def test_patience_is_longer_where_nothing_else_holds_the_clip(is_kept, patience_s):
    clock = Clock()
    retries = Retries(is_endless=False, clock=clock)
    assert retries.failed(is_kept=is_kept)
    clock.now_s += patience_s - 0.1
    assert retries.failed(is_kept=is_kept)
    clock.now_s += 0.2
    assert not retries.failed(is_kept=is_kept)


def test_with_a_window_open_it_never_gives_up():
    clock = Clock()
    retries = Retries(is_endless=True, clock=clock)
    for _ in range(3):
        clock.now_s += 1e6
        assert retries.failed(is_kept=True)


def test_a_refusal_is_told_once_and_again_after_it_went_well():
    told: list[WarningRaised] = []
    refusals = Refusals("No snapshot", told.append)
    for _ in range(3):
        refusals.refused(ProjectError("The disk is full.", hint="Make room."))
    assert told == [WarningRaised("No snapshot", "The disk is full.", "Make room.")]
    refusals.written()
    refusals.refused(ProjectError("The disk is full.", hint="Make room."))
    assert len(told) == 2


@pytest.fixture
def folder(tmp_path):
    """A project, as far as a watch looks at it."""
    folder = tmp_path / "p"
    folder.mkdir()
    (folder / PROJECT_FILE).write_text("{}")
    return folder


def test_a_project_that_stays_is_not_gone(folder):
    watch = FolderWatch(folder)
    (folder / "clips").mkdir()
    watch.check()


def test_a_project_that_was_deleted_or_moved_is_gone(folder):
    watch = FolderWatch(folder)
    folder.rename(folder.with_name("elsewhere"))
    with pytest.raises(ProjectGone, match="deleted or moved"):
        watch.check()
    with pytest.raises(ProjectGone):
        FolderWatch(folder)


def test_another_folder_of_the_same_name_is_noticed(folder):
    watch = FolderWatch(folder)
    shutil.copytree(folder, folder.with_name("copy"))
    folder.rename(folder.with_name("old"))
    folder.with_name("copy").rename(folder)
    with pytest.raises(ProjectGone, match="another folder is in its place"):
        watch.check()


def test_a_folder_without_its_project_file_is_gone(folder):
    watch = FolderWatch(folder)
    (folder / PROJECT_FILE).unlink()
    with pytest.raises(ProjectGone):
        watch.check()
