"""Deletions applied permanently: what is seen stays the same to the last bit, and the program may end at any point."""

from __future__ import annotations

import errno
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace as with_entries

from app.applying import applying
from app.applying.applying import apply_permanently, stage
from app.applying.deletions import find_deletions
from app.evaluation.headless import TrainedProject, open_trained
from app.export.scene_frames import SceneFrames
from app.project.clips import clip_exchange
from app.project.clips.clip_versions import list_versions, restore_version, set_aside
from app.project.opening.project_access import open_project
from app.project.project import Project
from engine.clip_files.array_names import LOG_DRIFT
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from engine.editing.actions import Delete, Expose, Hide, Recolor, Smooth, Transform
from engine.editing.edit import Box, Edit, Everything, ObjectTarget, Picked, PickedRows, Scope, Sphere
from engine.editing.picks import pack_rows
from engine.editing.scene_object import ObjectInClip, ObjectSeed, SceneObject
from engine.errors import DiskError, ProjectError
from engine.raster.gaussians import Gaussians
from tests.app.stored_project import copy_stored

FRAMES, MIDDLE = range(6), Sphere((0.0, 0.0, 0.5), 1.0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return copy_stored(tmp_path / "p")


def opened(project: Project) -> TrainedProject:
    return open_trained(project)


def give(project: Project, *edits: Edit) -> None:
    project.change(replace(project.document, edits=edits), "edit")


def seen(project: Project) -> list[Gaussians]:
    scene = SceneFrames(opened(project))
    return [scene.gaussians(frame) for frame in FRAMES]


def assert_same(before: list[Gaussians], after: list[Gaussians]) -> None:
    for one, other in zip(before, after, strict=True):
        for mine, theirs in zip(one.tensors(), other.tensors(), strict=True):
            np.testing.assert_array_equal(mine.numpy(), theirs.numpy())


def test_an_object_is_deleted_for_good_and_others_keep_their_gaussians(folder: Path) -> None:
    with_project = open_project(folder)
    trained = opened(with_project)
    header = trained.header(0)
    clips = trained.clips[:2]

    def rows(first: int, stop: int) -> tuple[PickedRows, ...]:
        return (PickedRows(0, header.origin, "static", pack_rows(np.arange(first, stop))),)

    k = header.decoder.gaussians_per_anchor

    def made(object_id: int, first: int, stop: int) -> SceneObject:
        found = tuple(
            ObjectInClip(clip.start, clip.stop, rows(first, stop), ((clip.start, clip.stop),), origin=header.origin)
            for clip in clips
        )
        return SceneObject(object_id, f"object {object_id}", seeds=(ObjectSeed(0, rows(first, stop)),), clips=found)

    gone, kept = made(1, 0, 4 * k), made(2, 4 * k, 7 * k)
    edit = Edit(1, "", ObjectTarget(1), Delete())
    show_kept = Edit(2, "", ObjectTarget(2), Hide(), is_inverted=True)
    with_project.change(replace(with_project.document, edits=(edit, show_kept), objects=(gone, kept)), "edit")
    before = seen(with_project)
    assert len(before[0])
    staged = applied(with_project)
    assert staged.n_anchors >= 4
    assert_same(before, seen(with_project))
    document = with_project.document
    assert [one.edit_id for one in document.edits] == [2]
    now = opened(with_project).header(0).origin
    assert now != header.origin
    assert [clip.origin for clip in document.objects[1].clips] == [now, now]
    assert now in {part.origin for part in document.objects[1].seeds[0].added}
    with_project.close()


def applied(project: Project, n_clips: int = 2) -> applying.StagedClips:
    return apply_permanently(project, opened(project).clips[:n_clips])


def origin(project: Project, clip_index: int) -> str:
    return read_clip_state(project.clip_path(clip_index)).header.fingerprint


def picks(project: Project, clip_index: int, role: str, numbers: np.ndarray) -> Picked:
    return Picked((PickedRows(clip_index, origin(project, clip_index), role, pack_rows(numbers)),))


@pytest.mark.slow
def test_what_is_seen_stays_the_same_and_the_clips_become_smaller(folder: Path) -> None:
    project = open_project(folder)
    give(
        project,
        Edit(1, "", picks(project, 0, "static", np.arange(400, 1200)), Recolor((1.0, 0.0, 0.0), 0.5)),
        Edit(2, "", picks(project, 1, "residual", np.arange(0, 40)), Expose(1.0)),
        Edit(3, "", picks(project, 0, "static", np.arange(0, 800)), Delete()),
        Edit(4, "", MIDDLE, Delete(), Scope(3)),
        Edit(5, "", Box((0.0, 0.0, 0.0), (2.5, 2.5, 2.5)), Hide(), Scope(1, 2), is_inverted=True),
        Edit(6, "", Everything(), Smooth(1.0), Scope(4, 5)),
    )
    before, anchors = seen(project), [read_clip_state(project.clip_path(index)).anchors for index in (0, 1)]
    sizes = [project.clip_path(index).stat().st_size for index in (0, 1)]
    result = applied(project)
    assert_same(before, seen(project))
    now = [read_clip_state(project.clip_path(index)).anchors for index in (0, 1)]
    assert len(now[0]["static"].own) == len(anchors[0]["static"].own) - 200  # type: ignore[arg-type]
    assert now[1]["static"].is_hidden is not None
    assert now[1]["static"].is_hidden.sum() > 0, "what only the second clip deletes is hidden there"
    assert len(now[1]["static"].is_hidden) == len(now[0]["static"].own)  # type: ignore[arg-type]
    assert project.clip_path(0).stat().st_size < sizes[0]
    assert result.clip_indices == (0, 1)
    left = [edit.edit_id for edit in project.document.edits]
    assert 3 not in left
    assert {1, 2, 5, 6} <= set(left), "only what is deleted is applied"
    project.close()


@pytest.mark.slow
def test_headers_say_what_is_left_and_dependants_fit(folder: Path) -> None:
    project = open_project(folder)
    give(project, Edit(1, "", picks(project, 0, "static", np.arange(0, 800)), Delete()))
    applied(project)
    reference, source = (read_clip_state(project.clip_path(index)) for index in (0, 1))
    assert source.header.reference_fingerprint == reference.header.fingerprint == reference.fingerprint
    assert source.header.fingerprint == source.fingerprint
    model = opened(project).load(0).model
    assert reference.header.n_anchors == {role: len(model.anchor_set(role)) for role in model.roles()}
    assert reference.header.figures.held_out_psnr is None, "it was measured with what is gone"
    project.close()


@pytest.mark.slow
def test_an_edit_that_holds_in_a_part_of_a_clip_stays_in_the_stack(folder: Path) -> None:
    project = open_project(folder)
    give(
        project,
        Edit(1, "", picks(project, 0, "static", np.arange(0, 800)), Delete()),
        Edit(2, "", picks(project, 0, "static", np.arange(800, 1200)), Delete(), Scope(1, 5)),
        Edit(3, "", picks(project, 0, "static", np.arange(1201, 1203)), Delete()),
        Edit(4, "", MIDDLE, Delete(), is_on=False),
    )
    before = seen(project)
    result = applied(project)
    assert_same(before, seen(project))
    assert [edit.edit_id for edit in project.document.edits] == [2, 3, 4]
    assert [edit.edit_id for edit in result.kept] == [2, 3]
    assert "2 edits that delete stay" in result.text()
    project.close()


@pytest.mark.slow
def test_versions_bring_back_what_was_deleted(folder: Path) -> None:
    project = open_project(folder)
    give(project)
    whole = seen(project)
    give(
        project,
        Edit(1, "", picks(project, 0, "static", np.arange(0, 800)), Delete()),
        Edit(2, "", picks(project, 0, "static", np.arange(900, 1200)), Expose(1.0)),
    )
    edited = seen(project)
    edits = project.document.edits
    applied(project)
    for index in (0, 1):
        versions = list_versions(project, index)
        assert len(versions) == 1
        restore_version(project, index, versions[0].number)
    exposed = seen(project)
    assert [len(one) for one in exposed] == [len(one) for one in whole], "what was deleted is there again"
    colors = [
        not np.array_equal(one.colors.numpy(), other.colors.numpy()) for one, other in zip(exposed, whole, strict=True)
    ]
    assert all(colors), "and the other edit still finds what was picked"
    project.change(replace(project.document, edits=edits), "as before")
    assert_same(edited, seen(project))
    project.close()


@pytest.mark.slow
def test_applying_twice_has_nothing_left_to_do(folder: Path) -> None:
    project = open_project(folder)
    give(
        project,
        Edit(1, "", picks(project, 0, "static", np.arange(0, 800)), Delete()),
        Edit(2, "", Everything(), Transform((1.0, 0.0, 0.0))),
    )
    applied(project)
    with pytest.raises(ProjectError, match="othing to apply"):
        applied(project)
    project.close()


@pytest.mark.slow
def test_where_a_clip_is_not_trained_the_reference_keeps_its_anchors(folder: Path) -> None:
    project = open_project(folder)
    give(project, Edit(1, "", picks(project, 0, "static", np.arange(0, 800)), Delete()))
    before, edited = origin(project, 0), seen(project)
    result = applied(project, n_clips=10)
    assert_same(edited, seen(project))
    assert result.clip_indices == (1,), "there it can be hidden"
    assert origin(project, 0) == before
    assert [edit.edit_id for edit in project.document.edits] == [1]
    project.clip_path(1).unlink()
    with pytest.raises(ProjectError, match="No anchor is fully deleted"):
        applied(project, n_clips=10)
    assert not (folder / "exchange").exists()
    project.close()


def test_nothing_happens_to_a_project_that_is_read_only(folder: Path) -> None:
    with pytest.raises(ProjectError):
        applied(open_project(folder, is_writable=False))


# ---------------------------------------------------------------- the end of the program, and of the disk


class Killed(BaseException):
    """The program ended here."""


@pytest.mark.slow
@pytest.mark.parametrize("n_done", [0, 1, 2])
def test_a_program_that_ends_during_the_exchange_ends_it_when_it_is_opened(
    folder: Path, n_done: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = open_project(folder)
    give(project, Edit(1, "", MIDDLE, Delete()))
    before, calls = seen(project), []

    def dying(source: Path, target: Path, *, is_durable: bool = False) -> None:
        if len(calls) == n_done:
            raise Killed
        calls.append(target)
        source.replace(target)

    monkeypatch.setattr(clip_exchange, "replace_file", dying)
    if n_done == 2:  # when only the list of the exchange is left to be removed
        monkeypatch.setattr(clip_exchange, "remove_list", lambda place: dying(place, place))
    with pytest.raises(Killed):
        applied(project)
    monkeypatch.undo()
    project.close()
    project = open_project(folder)
    assert not (folder / "exchange").exists()
    assert_same(before, seen(project))
    project.close()


@pytest.mark.slow
def test_a_program_that_ends_before_the_exchange_has_changed_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = open_project(folder)
    give(project, Edit(1, "", picks(project, 0, "static", np.arange(0, 800)), Delete()))
    before, files = seen(project), [project.clip_path(index).read_bytes() for index in (0, 1)]
    stage(project, find_deletions(project, opened(project).clips[:2]))
    assert (folder / "exchange").is_dir()
    project.close()
    project = open_project(folder)
    assert not (folder / "exchange").exists()
    assert [project.clip_path(index).read_bytes() for index in (0, 1)] == files
    assert_same(before, seen(project))
    project.close()


def test_a_full_disk_is_told_and_nothing_is_left(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    project = open_project(folder)
    give(project, Edit(1, "", MIDDLE, Delete()))
    files = [project.clip_path(index).read_bytes() for index in (0, 1)]
    edits = project.document.edits

    def full(*arguments: object, **options: object) -> None:
        raise DiskError("The clip could not be written (No space left on device).") from OSError(errno.ENOSPC, "full")

    monkeypatch.setattr(applying, "rewrite_clip", full)
    with pytest.raises(DiskError):
        applied(project)
    assert not (folder / "exchange").exists()
    assert [project.clip_path(index).read_bytes() for index in (0, 1)] == files
    assert project.document.edits == edits
    project.close()


def test_a_damaged_list_is_a_typed_error(folder: Path) -> None:
    (folder / "exchange").mkdir()
    (folder / "exchange" / "exchange.json").write_text("nonsense")
    with pytest.raises(ProjectError, match="list of exchanged clips"):
        open_project(folder)
    (folder / "exchange" / "exchange.json").unlink()
    open_project(folder).close()
    assert not (folder / "exchange").exists()


@pytest.mark.slow
def test_picks_hold_for_a_mended_clip_and_for_what_it_was(folder: Path) -> None:
    """Mending gives a clip another look and leaves its anchors in their rows."""
    project = open_project(folder)
    path, before = project.clip_path(1), seen(project)
    target = picks(project, 1, "residual", np.arange(12))
    give(project, Edit(1, "", target, Delete()))
    edited = seen(project)
    assert len(edited[4]) < len(before[4])

    state = read_clip_state(path)
    arrays = state.arrays | {LOG_DRIFT: np.full((len(state.header.camera_names), 3, 3), 0.1, np.float32)}
    mended = ClipState(arrays, with_entries(state.header, rows_of=state.header.origin)).stamped()
    set_aside(project, 1)
    write_clip_state(path, mended)
    assert origin(project, 1) != state.header.fingerprint
    assert_same(edited, seen(project))

    applied(project)
    assert not project.document.edits
    assert_same(edited, seen(project))
    assert read_clip_state(path).header.origin == origin(project, 1), "rows are others now"
    project.close()
