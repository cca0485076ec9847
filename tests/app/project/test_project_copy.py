"""Saving a project as another one: complete, with its history, or not at all."""

from dataclasses import replace
from pathlib import Path

import pytest

from app.background.jobs import JobCancelled
from app.document.project_document import Marker
from app.project.opening.project_access import open_project
from app.project.project_copy import copy_bytes, copy_project
from engine.errors import ProjectError
from tests.app.made_projects import make_chain


def nothing(done: float, message: str) -> None:
    assert 0.0 <= done <= 1.0


def made(folder: Path):
    project = make_chain(folder, 3, capture=str(folder.parent / "capture"))
    project.change(replace(project.document, markers=(Marker(2, "a"),)), "add a marker")
    project.metrics_path(0).parent.mkdir()
    project.metrics_path(0).write_text("row\n")
    project.live_dir.mkdir()
    (project.live_dir / "x.safetensors").write_text("being written")
    return project


def test_a_copy_has_everything_and_its_own_way_to_the_capture(tmp_path: Path) -> None:
    project = made(tmp_path / "a" / "project")
    target = tmp_path / "b" / "c" / "copy"
    copy_project(project, target, nothing)
    copy = open_project(target)
    assert copy.document == project.document
    assert copy.history.undo_name == "add a marker"
    assert copy.metrics_path(0).read_text() == "row\n"
    assert copy.clip_path(2).read_bytes() == project.clip_path(2).read_bytes()
    assert not copy.live_dir.exists()
    copy.change(replace(copy.document, markers=()), "remove a marker")
    copy.metrics_path(0).write_text("other\n")
    assert project.metrics_path(0).read_text() == "row\n"
    assert open_project(project.folder, is_writable=False).document.markers == (Marker(2, "a"),)
    assert (project.folder / "project.json").read_text().count('"../capture"') == 1
    copy.close()
    project.close()


def test_a_copy_that_is_cancelled_leaves_nothing(tmp_path: Path) -> None:
    project = made(tmp_path / "project")

    def cancel(done: float, message: str) -> None:
        if done > 0.3:
            raise JobCancelled

    with pytest.raises(JobCancelled):
        copy_project(project, tmp_path / "copy", cancel)
    assert [path.name for path in tmp_path.iterdir()] == ["project"]
    assert copy_bytes(project.folder) > 0
    project.close()


def test_a_copy_takes_no_place_that_is_taken(tmp_path: Path) -> None:
    project = made(tmp_path / "project")
    taken = tmp_path / "taken"
    taken.mkdir()
    (taken / "file").touch()
    with pytest.raises(ProjectError, match="already taken"):
        copy_project(project, taken, nothing)
    with pytest.raises(ProjectError, match="inside the project itself"):
        copy_project(project, project.folder / "copy", nothing)
    assert [path.name for path in taken.iterdir()] == ["file"]
    project.close()


def test_nothing_outside_of_a_project_is_copied(tmp_path: Path) -> None:
    project = made(tmp_path / "project")
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "letter").write_text("x" * 1000)
    n_bytes = copy_bytes(project.folder)
    (project.folder / "notes").symlink_to(mine)
    assert copy_bytes(project.folder) == n_bytes
    copy_project(project, tmp_path / "copy", nothing)
    assert not (tmp_path / "copy" / "notes").exists()
    project.metrics_path(0).unlink()
    project.metrics_path(0).parent.rmdir()
    project.metrics_path(0).parent.symlink_to(mine)
    with pytest.raises(ProjectError, match='cannot be copied: its folder "metrics"'):
        copy_project(project, tmp_path / "again", nothing)
    assert not (tmp_path / "again").exists()
    project.close()
