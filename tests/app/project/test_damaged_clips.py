"""A damaged clip: put aside and never lost, the version that could come back, and clips of another reference."""

from __future__ import annotations

from pathlib import Path

from app.document.changes.clip_changes import with_reference
from app.project.clips.clip_catalog import ClipCatalog
from app.project.clips.clip_versions import (
    DAMAGED,
    best_version,
    list_versions,
    put_damaged_aside,
    read_finished,
    recovery_hint,
    restore_version,
    set_aside,
    version_path,
)
from app.project.project import Project
from tests.app.made_projects import clip_header, make_project, write_header


def trained(folder: Path) -> Project:
    """Three clips of one frame; clip 1 has two earlier versions, the newer of another reference."""
    project = make_project(folder)
    write_header(project.clip_path(0), clip_header(0))
    source = {"role": "source", "reference_fingerprint": "clip-0"}
    for name, base in (("old", "clip-0"), ("other", "gone"), ("new", "clip-0")):
        set_aside(project, 1)
        write_header(project.clip_path(1), clip_header(1, fingerprint=name, role="source", reference_fingerprint=base))
    write_header(project.clip_path(2), clip_header(2, **source))
    return project


def test_the_version_before_it_that_fits_is_offered(tmp_path: Path) -> None:
    project = trained(tmp_path / "p")
    project.clip_path(1).write_bytes(b"damaged")
    assert ClipCatalog(project, 3)[1].state == "damaged"
    version = best_version(project, 1)
    assert version is not None
    assert version.number == 1, "version 2 is of another reference"
    assert "--clip 1 --restore 1" in recovery_hint(project, 1)
    version_path(project, 1, 1).write_bytes(b"damaged as well")
    assert best_version(project, 1) is None
    assert "Restore it from a" in recovery_hint(project, 1)


def test_a_damaged_file_is_put_aside_whatever_takes_its_place(tmp_path: Path) -> None:
    project = trained(tmp_path / "p")
    for content in (b"damaged once", b"damaged twice"):
        project.clip_path(1).unlink()  # files are replaced, never written in place
        project.clip_path(1).write_bytes(content)
        assert set_aside(project, 1) is None, "it became a version"
    found = {path.name: path.read_bytes() for path in (project.folder / DAMAGED).iterdir()}
    assert found == {"0001-1.safetensors": b"damaged once", "0001-2.safetensors": b"damaged twice"}
    restore_version(project, 1, 1)
    assert read_finished(project, 1).header.fingerprint == "old"
    assert len(list((project.folder / DAMAGED).iterdir())) == 3
    assert put_damaged_aside(project, 7) is None


def test_damage_that_only_the_arrays_have_makes_no_version(tmp_path: Path) -> None:
    project = trained(tmp_path / "p")
    good = bytearray(project.clip_path(1).read_bytes())
    good[-3] ^= 0xFF
    project.clip_path(1).write_bytes(good)
    n_versions = len(list_versions(project, 1))
    assert set_aside(project, 1) is None
    assert len(list_versions(project, 1)) == n_versions
    assert (project.folder / DAMAGED / "0001-1.safetensors").read_bytes() == bytes(good)


def test_another_reference_makes_all_clips_stale_until_it_is_taken_back(tmp_path: Path) -> None:
    project = trained(tmp_path / "p")
    before = project.document
    assert [ClipCatalog(project, 3)[index].state for index in range(3)] == ["trained"] * 3
    project.change(with_reference(before, 1, 3), "another reference")
    catalog = ClipCatalog(project, 3)
    assert [catalog[index].state for index in range(3)] == ["stale"] * 3
    assert "now clip 1" in catalog[0].reason
    assert "now it is the reference itself" in catalog[1].reason
    assert best_version(project, 1) is None, "its versions were trained on another reference"
    project.change(before, "back")
    assert [ClipCatalog(project, 3)[index].state for index in range(3)] == ["trained"] * 3
    assert ClipCatalog(project, 3).dependents(0) == [1, 2]


def test_a_clip_says_which_it_is_after_clips_before_it_were_split(tmp_path: Path) -> None:
    project = trained(tmp_path / "p")
    write_header(project.clip_path(2), clip_header(5, start=2))
    assert read_finished(project, 2).header.clip_index == 2
