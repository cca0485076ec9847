"""What a project takes on the disk, and making room: every byte counted once, nothing deleted that is in use."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from app.document.changes.clip_changes import with_merge
from app.project.clips.clip_versions import set_aside
from app.project.disk.room import WHAT, make_room, room_of
from app.project.disk.use import disk_use
from app.project.project import Project
from engine.errors import ProjectError
from tests.app.made_projects import clip_header, make_project, write_header


def write(path: Path, n_bytes: int) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"x" * n_bytes)


def full_project(folder: Path) -> Project:
    """Two clips with versions, a checkpoint, preparation, a log, and files that no clip has."""
    project = make_project(folder)
    for index in range(2):
        for name in ("a", "b", "c"):
            set_aside(project, index)
            write_header(project.clip_path(index), clip_header(index, fingerprint=f"{name}{index}"))
    write(project.metrics_path(0), 30)
    write(project.checkpoint_path(1), 100)
    write(project.unfinished_metrics_path(1), 7)
    write(project.prep_dir / "clip-0001-0.safetensors", 50)
    write(project.prep_dir / "backgrounds.safetensors", 500)
    write(project.log_path(0), 11)
    write(project.folder / "clips" / "000004-000006.safetensors", 1000)
    write(project.folder / "versions" / "000004-000006" / "0001.safetensors", 2000)
    write(project.folder / "damaged" / "0000-1.safetensors", 3000)
    write(project.folder / "clips" / ".partial-1-0000.safetensors", 9)
    return project


def test_every_file_counts_once_and_where_it_belongs(tmp_path: Path) -> None:
    project = full_project(tmp_path / "p")
    use = disk_use(project, 2)
    everything = sum(path.stat().st_size for path in project.folder.rglob("*") if path.is_file())
    assert use.total == everything
    assert use.clips[0].clip == project.clip_path(0).stat().st_size + 30
    assert [clip.n_versions for clip in use.clips] == [2, 2]
    assert use.clips[1].checkpoint == 157
    assert (use.preparation, use.unused, use.n_unused) == (500, 6000, 3)
    set_aside(project, 0)  # the same file under two names
    assert disk_use(project, 2).total == everything


def test_what_is_asked_for_goes_and_nothing_else(tmp_path: Path) -> None:
    project = full_project(tmp_path / "p")
    kept = {path for path in project.folder.rglob("*") if path.is_file()}
    oldest = room_of(project, 2, "oldest")
    assert [path.name for path in oldest.paths] == ["0001.safetensors"] * 2
    assert make_room(project, oldest) == oldest.n_bytes > 0
    assert {path for path in project.folder.rglob("*") if path.is_file()} == kept - set(oldest.paths)
    assert make_room(project, oldest) == 0, "gone already"
    of_one = room_of(project, 2, "versions", 1)
    assert [path.parent.name for path in of_one.paths] == ["0001"]
    make_room(project, of_one)
    assert not (project.folder / "versions" / "0001").exists()
    assert room_of(project, 2, "versions", 0).n_clips == 1
    checkpoints = room_of(project, 2, "checkpoints")
    assert checkpoints.n_bytes == 157
    assert make_room(project, room_of(project, 2, "unused")) == 6000
    assert project.clip_path(0).is_file()
    assert disk_use(project, 2).unused == 0


def test_half_written_and_foreign_files_are_not_offered(tmp_path: Path) -> None:
    project = full_project(tmp_path / "p")
    write(project.folder / "clips" / "my copy.safetensors", 5)
    offered = {path.name for path in room_of(project, 2, "unused").paths}
    assert offered == {"000004-000006.safetensors", "0001.safetensors", "0000-1.safetensors"}


def test_a_clip_that_was_cut_away_is_offered_and_one_in_use_is_not(tmp_path: Path) -> None:
    project = make_project(tmp_path / "p")
    for index in range(3):
        write_header(project.clip_path(index), clip_header(index))
    document = with_merge(project.document, 0, 3)
    project.history = replace(project.history, present=document)
    assert [project.clip_name(index) for index in range(2)] == ["000000-000002", "0002"]
    room = room_of(project, 2, "unused")
    assert [path.name for path in room.paths] == ["0000.safetensors", "0001.safetensors"]


def test_what_cannot_be(tmp_path: Path) -> None:
    project = make_project(tmp_path / "p")
    with pytest.raises(ProjectError, match="no clip 5"):
        room_of(project, 2, "versions", 5)
    with pytest.raises(ValueError, match=", ".join(WHAT)):
        room_of(project, 2, "everything")
    project.close()
    with pytest.raises(ProjectError, match="read-only"):
        make_room(project, room_of(project, 2, "versions"))
