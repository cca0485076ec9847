"""Targets of exports: what cannot be written is said first; what fails leaves nothing."""

from __future__ import annotations

import errno
import os
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from app.evaluation.headless import TrainedProject
from app.export import staging
from app.export.staging import check_target, staged_file, staged_folder
from engine.errors import DiskError, ProjectError


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_or_folder_appears_when_it_is_complete(tmp_path: Path):
    with staged_file(tmp_path / "new" / "a.ply") as partial:
        partial.write_text("a")
        assert not (tmp_path / "new" / "a.ply").exists()
    assert (tmp_path / "new" / "a.ply").read_text() == "a"
    (tmp_path / "empty").mkdir()
    with staged_folder(tmp_path / "empty") as folder:
        (folder / "b").write_text("b")
        assert names(tmp_path / "empty") == []
    assert names(tmp_path / "empty") == ["b"]
    assert names(tmp_path) == ["empty", "new"]


def write_and_fail(staged: AbstractContextManager[Path], error: BaseException) -> None:
    with staged as partial:
        (partial / "x" if partial.is_dir() else partial).write_text("x")
        raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError("x"), OSError(errno.ENOSPC, "No space left")])
def test_what_fails_leaves_nothing(tmp_path: Path, error: BaseException):
    expected = DiskError if isinstance(error, OSError) else type(error)
    for staged, name in ((staged_file, "a.ply"), (staged_folder, "b")):
        with pytest.raises(expected):
            write_and_fail(staged(tmp_path / name), error)
    assert names(tmp_path) == []


def test_what_killed_programs_left_of_the_same_export_goes(tmp_path: Path):
    dead, alive = 999_999_999, os.getppid()
    (tmp_path / f".partial-{dead}-b").mkdir()
    (tmp_path / f".partial-{dead}-b" / "x").write_text("x")
    for name in (f".partial-{dead}-a.ply", f".partial-{dead}-other.ply", f".partial-{alive}-a.ply"):
        (tmp_path / name).write_text("x")
    with staged_file(tmp_path / "a.ply") as partial:
        partial.write_text("a")
    with staged_folder(tmp_path / "b") as folder:
        (folder / "b").write_text("b")
    assert names(tmp_path) == [f".partial-{alive}-a.ply", f".partial-{dead}-other.ply", "a.ply", "b"]


def fill_meanwhile(path: Path) -> None:
    with staged_folder(path) as partial:
        (partial / "x").write_text("x")
        path.mkdir()
        (path / "mine").write_text("mine")


def test_a_folder_that_was_filled_meanwhile_is_left_alone(tmp_path: Path):
    with pytest.raises(DiskError):
        fill_meanwhile(tmp_path / "b")
    assert names(tmp_path / "b") == ["mine"]
    assert names(tmp_path) == ["b"]


def test_targets_are_refused_before_work_starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "file").write_text("x")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "x").write_text("x")
    check_target(tmp_path / "file")
    check_target(tmp_path / "new" / "deep", is_folder=True)
    with pytest.raises(ProjectError, match="already taken"):
        check_target(tmp_path / "full", is_folder=True)
    with pytest.raises(ProjectError, match="already taken"):
        check_target(tmp_path / "file", is_folder=True)
    with pytest.raises(ProjectError, match="a folder, not a file"):
        check_target(tmp_path / "full")
    with pytest.raises(ProjectError, match="is a file"):
        check_target(tmp_path / "file" / "a.ply")
    monkeypatch.setattr(staging.os, "access", lambda *_: False)
    with pytest.raises(ProjectError, match="may not be written to"):
        check_target(tmp_path / "a.ply")


def test_too_little_room_is_said_before_work_starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    class Usage:
        free, total = 50 << 20, 1 << 30

    monkeypatch.setattr(staging.shutil, "disk_usage", lambda _: Usage)
    check_target(tmp_path / "a.ply", n_bytes=30_000_000)
    with pytest.raises(DiskError, match="About 40 MB will be written, but only 52 MB are free"):
        check_target(tmp_path / "a.ply", n_bytes=40_000_000)


def test_a_table_needs_little_room_and_little_room_is_told_in_kilobytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    class Usage:
        free, total = 600_000, 1 << 30

    monkeypatch.setattr(staging.shutil, "disk_usage", lambda _: Usage)
    check_target(tmp_path / "a.csv", n_bytes=30_000)
    with pytest.raises(ProjectError, match="About 400 kB will be written, but only 600 kB are free"):
        check_target(tmp_path / "a.csv", n_bytes=400_000)
    Usage.free = 100_000
    with pytest.raises(ProjectError, match="262 kB must be free, but only 100 kB are free"):
        check_target(tmp_path / "a.csv")


def test_a_file_system_without_room_for_files_is_told_from_a_full_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    class Usage:
        free = total = 0

    monkeypatch.setattr(staging.shutil, "disk_usage", lambda _: Usage)
    with pytest.raises(ProjectError, match="cannot hold files"):
        check_target(tmp_path / "a.csv", n_bytes=30_000)


def test_nothing_is_written_into_what_is_exported(opened: TrainedProject):
    project, capture = opened.project.folder, Path(opened.capture.path)
    for path in (project / "project.json", project / "exports" / "a.ply", capture / "cam00.mp4"):
        with pytest.raises(ProjectError, match="inside the"):
            check_target(path, opened=opened)
    with pytest.raises(ProjectError, match="inside the project"):
        check_target(project / "exports", opened=opened, is_folder=True)
    check_target(project.parent / "a.ply", opened=opened)
