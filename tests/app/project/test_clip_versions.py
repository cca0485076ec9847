"""Versions of clips: set aside, listed, brought back, bounded; damaged, foreign, and on a disk that refuses."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from app.project.clips import clip_versions
from app.project.clips.clip_catalog import ClipCatalog
from app.project.clips.clip_versions import (
    MAX_VERSIONS,
    forget_oldest,
    list_versions,
    reference_file,
    remove_version,
    restore_version,
    set_aside,
    version_path,
)
from app.project.opening.project_access import open_project
from app.project.project import Project
from engine.errors import DiskError, ProjectError
from tests.app.made_projects import clip_header, make_project, write_header


def train(project: Project, clip_index: int, fingerprint: str, **entries: object) -> None:
    """As a finished training does it, with a clip of this fingerprint."""
    set_aside(project, clip_index, unless=fingerprint)
    write_header(project.clip_path(clip_index), clip_header(clip_index, fingerprint=fingerprint, **entries))
    project.metrics_path(clip_index).parent.mkdir(exist_ok=True)
    project.metrics_path(clip_index).unlink(missing_ok=True)
    project.metrics_path(clip_index).write_text(f"curves of {fingerprint}")
    forget_oldest(project, clip_index)


def fingerprints(project: Project, clip_index: int) -> list[str]:
    return [version.header.fingerprint for version in list_versions(project, clip_index) if version.header]


def current(project: Project, clip_index: int) -> str:
    found = project.headers.read(project.clip_path(clip_index))
    assert found is not None
    assert found.header is not None
    return found.header.fingerprint


def test_what_was_trained_before_is_kept_newest_first_and_so_many(tmp_path: Path) -> None:
    project = make_project(tmp_path / "p")
    assert set_aside(project, 0) is None, "nothing is there"
    assert list_versions(project, 0) == []
    for name in "abcdef":
        train(project, 0, name)
    assert MAX_VERSIONS == 3
    assert (current(project, 0), fingerprints(project, 0)) == ("f", ["e", "d", "c"])
    train(project, 0, "f")
    assert fingerprints(project, 0) == ["e", "d", "c"], "an equal clip is not kept twice"
    newest = list_versions(project, 0)[0]
    assert newest.path.with_suffix(".jsonl").read_text() == "curves of e"
    assert newest.trained_s > 0
    assert newest.n_bytes == newest.path.stat().st_size


def test_a_version_comes_back_with_its_curves_and_can_be_left_again(tmp_path: Path) -> None:
    project = make_project(tmp_path / "p")
    for name in "abcd":
        train(project, 0, name)
    oldest = list_versions(project, 0)[-1]
    restore_version(project, 0, oldest.number)
    assert (current(project, 0), fingerprints(project, 0)) == ("a", ["d", "c", "b"])
    assert project.metrics_path(0).read_text() == "curves of a"
    restore_version(project, 0, list_versions(project, 0)[0].number)
    assert (current(project, 0), fingerprints(project, 0)) == ("d", ["a", "c", "b"])
    assert project.metrics_path(0).read_text() == "curves of d"
    with pytest.raises(ProjectError, match="no version 99"):
        restore_version(project, 0, 99)


def test_curves_of_a_version_that_came_back_follow_when_the_program_was_killed_in_between(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = make_project(tmp_path / "p")
    for name in "ab":
        train(project, 0, name)

    def killed(source: Path, target: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(clip_versions, "_bring_curves", killed)
    with pytest.raises(KeyboardInterrupt):
        restore_version(project, 0, 1)
    monkeypatch.undo()
    project.close()
    project = open_project(tmp_path / "p")
    assert (current(project, 0), fingerprints(project, 0)) == ("a", ["b"])
    assert project.metrics_path(0).read_text() == "curves of a"
    restore_version(project, 0, list_versions(project, 0)[0].number)
    assert project.metrics_path(0).read_text() == "curves of b"


def test_what_depends_on_the_reference_is_out_of_date_by_its_fingerprint_alone(tmp_path: Path) -> None:
    project = make_project(tmp_path / "p")
    train(project, 0, "a")
    train(project, 1, "on a", role="source", reference_fingerprint="a")
    train(project, 0, "b")
    catalog = ClipCatalog(project, 2)
    assert [catalog[index].state for index in range(2)] == ["trained", "stale"]
    train(project, 1, "on b", role="source", reference_fingerprint="b")
    catalog.update(1)
    assert [catalog[index].state for index in range(2)] == ["trained", "trained"]
    (older,) = list_versions(project, 1)
    with pytest.raises(ProjectError, match="another version of clip 0"):
        restore_version(project, 1, older.number)
    assert older.header is not None
    reference = reference_file(project, 1, older.header)
    assert reference == version_path(project, 0, 1), "it can be looked at with the reference it was trained on"
    restore_version(project, 0, 1)
    catalog.update(0)
    assert [catalog[index].state for index in range(2)] == ["trained", "stale"]
    restore_version(project, 1, older.number)
    catalog.update(1)
    assert [catalog[index].state for index in range(2)] == ["trained", "trained"]
    found = list_versions(project, 1)[0].header
    assert found is not None
    assert reference_file(project, 1, found) == list_versions(project, 0)[0].path
    remove_version(project, 0, list_versions(project, 0)[0].number)
    assert reference_file(project, 1, found) is None


def test_a_damaged_version_is_listed_and_refused_and_the_clip_stays(tmp_path: Path) -> None:
    project = make_project(tmp_path / "p")
    train(project, 0, "a")
    train(project, 0, "b")
    path = version_path(project, 0, 1)
    data = bytearray(path.read_bytes())
    data[-3] ^= 0xFF  # in an array: the header is whole
    path.unlink()
    path.write_bytes(data)
    with pytest.raises(ProjectError, match="damaged"):
        restore_version(project, 0, 1)
    path.write_bytes(b"\xff" * 99)
    (version,) = list_versions(project, 0)
    assert version.header is None
    assert "damaged" in version.damage
    assert version.revision == ""
    with pytest.raises(ProjectError, match="damaged"):
        restore_version(project, 0, 1)
    assert (current(project, 0), len(list_versions(project, 0))) == ("b", 1)
    remove_version(project, 0, 1)
    assert list_versions(project, 0) == []
    assert not path.parent.exists()


def test_a_version_of_another_clip_or_project_is_refused(tmp_path: Path) -> None:
    project = make_project(tmp_path / "p")
    train(project, 0, "a")
    train(project, 0, "b")
    path = version_path(project, 0, 7)
    for header, said in (
        (clip_header(0, fingerprint="x", start=3), "covers frames 3 to .*, not clip 0"),
        (clip_header(0, fingerprint="x", n_frames=9), "covers frames 0 to 8, not clip 0"),
        (clip_header(0, fingerprint="x", camera_names=["elsewhere"]), "another project"),
    ):
        write_header(path, header)
        with pytest.raises(ProjectError, match=said):
            restore_version(project, 0, 7)
    assert current(project, 0) == "b"


def test_what_is_not_a_version_is_left_alone(tmp_path: Path) -> None:
    project = make_project(tmp_path / "p")
    train(project, 0, "a")
    train(project, 0, "b")
    folder = version_path(project, 0, 1).parent
    for name in ("notes.txt", "1.safetensors", "abcd.safetensors", ".partial-12-0002.safetensors"):
        (folder / name).write_text("mine")
    assert [version.number for version in list_versions(project, 0)] == [1]
    for name in "cdefg":
        train(project, 0, name)
    assert (folder / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS])
def test_a_disk_that_refuses_leaves_clip_and_versions_as_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    project = make_project(tmp_path / "p")
    train(project, 0, "a")
    train(project, 0, "b")

    def refuse(*arguments: object, **options: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("os.link", refuse)
    monkeypatch.setattr("shutil.copy2", refuse)
    with pytest.raises(DiskError, match="earlier version"):
        restore_version(project, 0, 1)
    monkeypatch.undo()
    monkeypatch.setattr("app.project.clips.clip_versions.replace_file", refuse)
    with pytest.raises(DiskError):
        restore_version(project, 0, 1)
    monkeypatch.undo()
    assert (current(project, 0), fingerprints(project, 0)) == ("b", ["a"])
    restore_version(project, 0, 1)
    assert (current(project, 0), fingerprints(project, 0)) == ("a", ["b"])


def test_without_links_the_version_is_a_copy_with_its_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    project = make_project(tmp_path / "p")
    train(project, 0, "a")
    os.utime(project.clip_path(0), (1_000_000_000, 1_000_000_000))

    def refuse(*arguments: object, **options: object) -> None:
        raise OSError(errno.EPERM, "no links here")

    monkeypatch.setattr("os.link", refuse)
    train(project, 0, "b")
    (version,) = list_versions(project, 0)
    assert version.trained_s == 1_000_000_000
    assert fingerprints(project, 0) == ["a"]


def test_who_may_only_read_brings_nothing_back(tmp_path: Path) -> None:
    project = make_project(tmp_path / "p")
    train(project, 0, "a")
    train(project, 0, "b")
    reader = open_project(project.folder, is_writable=False)
    with pytest.raises(ProjectError, match="read-only"):
        restore_version(reader, 0, 1)
