"""Mended clips in their place, all or none: a disk that refuses, kills between two files, and the way back."""

from __future__ import annotations

import errno
import os
from dataclasses import replace
from pathlib import Path

import pytest
from msgspec.structs import replace as with_entries

from app.project.clips.clip_versions import list_versions, set_aside
from app.project.mends import in_place
from app.project.mends.in_place import as_cut_now, put_in_place, take_back, version_before, why_not_back
from app.project.mends.record import (
    MAX_KEPT,
    UNFINISHED,
    MendedClip,
    MendRecord,
    keep_record,
    kept_record,
    record_numbers,
    records_dir,
    write_record,
)
from app.project.opening.project_access import open_project
from app.project.project import Project
from engine.errors import DiskError, ProjectError
from engine.mending.figures import Attempt, StretchFigures
from tests.app.made_projects import clip_header, make_project, write_header

BEFORE = StretchFigures(excess=0.4, worst=0.5, elsewhere=0.2, psnr={"0": 30.0, "1": 29.0})
AFTER = StretchFigures(excess=0.1, worst=0.2, elsewhere=0.2, psnr={"0": 30.0, "1": 29.5})
RECORD = MendRecord(
    words="the seam at frame 2",
    first=1,
    stop=3,
    clips=(MendedClip(1, "old-1", "new-1"), MendedClip(2, "old-2", "new-2")),
    before=BEFORE,
    after=AFTER,
    attempts=(Attempt("fade", "Two frames fade", AFTER, True, 2.5),),
    diagnosis="What can move jumps.",
    advice="",
    seconds=3.0,
)


@pytest.fixture
def project(tmp_path: Path) -> Project:
    made = make_project(tmp_path / "p")
    write_header(made.clip_path(0), clip_header(0))
    for index in (1, 2):
        write_header(made.clip_path(index), of(index, f"old-{index}"))
    return made


def of(clip_index: int, fingerprint: str):
    entries = {"role": "source", "reference_fingerprint": "clip-0", "fingerprint": fingerprint}
    return clip_header(clip_index, **entries)


def drafts(project: Project) -> dict[int, Path]:
    found = {}
    for index in (1, 2):
        found[index] = project.folder / f"draft-{index}.safetensors"
        write_header(found[index], of(index, f"new-{index}"))
    return found


def current(project: Project) -> list[str]:
    found = [project.headers.read(project.clip_path(index)) for index in (1, 2)]
    return [one.header.fingerprint for one in found if one is not None and one.header is not None]


def versions(project: Project, clip_index: int) -> list[str]:
    return [one.header.fingerprint for one in list_versions(project, clip_index) if one.header is not None]


def test_mended_clips_take_their_place_and_come_back(project: Project) -> None:
    number = put_in_place(project, RECORD, drafts(project))
    assert current(project) == ["new-1", "new-2"]
    assert [versions(project, index) for index in (1, 2)] == [["old-1"], ["old-2"]]
    assert [version_before(project, clip) for clip in RECORD.clips] == [1, 1]
    assert kept_record(project, number) == RECORD
    assert not (records_dir(project) / UNFINISHED).exists()
    take_back(project, RECORD)
    assert current(project) == ["old-1", "old-2"]
    assert [versions(project, index) for index in (1, 2)] == [["new-1"], ["new-2"]], "nothing is lost by that"


def test_a_clip_that_was_trained_meanwhile_is_left_alone(project: Project) -> None:
    write_header(project.clip_path(2), of(2, "trained"))
    with pytest.raises(ProjectError, match="Clip 2 was trained or restored while it was mended"):
        put_in_place(project, RECORD, drafts(project))
    assert current(project) == ["old-1", "trained"]
    assert not record_numbers(project)


def test_a_reference_that_was_trained_meanwhile_is_noticed(project: Project) -> None:
    write_header(project.clip_path(0), clip_header(0, fingerprint="another"))
    with pytest.raises(ProjectError, match="another version of clip 0"):
        put_in_place(project, RECORD, drafts(project))
    assert current(project) == ["old-1", "old-2"]


def test_what_was_trained_since_is_not_taken_back(project: Project) -> None:
    put_in_place(project, RECORD, drafts(project))
    write_header(project.clip_path(1), of(1, "trained"))
    assert "Clip 1 was trained" in why_not_back(project, RECORD)
    with pytest.raises(ProjectError, match="Clip 1 was trained"):
        take_back(project, RECORD)
    assert current(project) == ["trained", "new-2"], "none of them, rather than one"


def test_mended_clips_are_found_where_clips_before_them_were_merged(project: Project) -> None:
    """Clips of two frames, of which the first two become one: clip 2 is clip 1 from then on."""
    for index in range(3):
        write_header(project.clip_path(index), clip_header(index, start=2 * index, n_frames=2, clip_length=2))
    settings = replace(project.settings, clip_length=2, clip_bounds=(0, 2, 4, 6))
    project.change(replace(project.document, settings=settings), "cut")
    write_header(project.clip_path(2), clip_header(2, start=4, n_frames=2, clip_length=2, fingerprint="new-2"))
    record = with_entries(RECORD, clips=(MendedClip(2, "old-2", "new-2"),))
    project.change(replace(project.document, settings=replace(settings, clip_bounds=(0, 4, 6))), "merge")
    assert [clip.clip_index for clip in as_cut_now(project, record).clips] == [1]
    assert "The version of clip 1" in why_not_back(project, record), "that is all that is missing"


def test_taking_back_that_was_killed_is_finished_when_the_project_is_opened(
    project: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_in_place(project, RECORD, drafts(project))
    restore = in_place.restore_version

    def killed(at: Project, clip_index: int, number: int) -> None:
        if clip_index == 2:
            raise KeyboardInterrupt
        restore(at, clip_index, number)

    monkeypatch.setattr(in_place, "restore_version", killed)
    with pytest.raises(KeyboardInterrupt):
        take_back(project, RECORD)
    assert current(project) == ["old-1", "new-2"]
    monkeypatch.undo()
    folder = project.folder
    project.close()
    reopened = open_project(folder)
    assert current(reopened) == ["old-1", "old-2"]
    reopened.close()


def test_what_was_trained_after_something_was_left_unfinished_stays(project: Project) -> None:
    put_in_place(project, RECORD, drafts(project))
    write_record(records_dir(project) / UNFINISHED, RECORD)
    write_header(project.clip_path(1), of(1, "trained"))
    folder = project.folder
    project.close()
    reopened = open_project(folder)
    assert current(reopened) == ["trained", "old-2"]
    reopened.close()


@pytest.mark.parametrize("fails_at", [1, 2])
def test_a_disk_that_refuses_leaves_both_clips_as_they_were(
    project: Project, monkeypatch: pytest.MonkeyPatch, fails_at: int
) -> None:
    replace_file, n_calls = in_place.replace_file, 0

    def refuse(source: Path, target: Path, **options: bool) -> None:
        nonlocal n_calls
        n_calls += 1
        if n_calls == fails_at:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        replace_file(source, target, **options)

    monkeypatch.setattr(in_place, "replace_file", refuse)
    with pytest.raises(DiskError, match="No space left"):
        put_in_place(project, RECORD, drafts(project))
    assert current(project) == ["old-1", "old-2"]
    assert not record_numbers(project)
    assert not (records_dir(project) / UNFINISHED).exists()


@pytest.mark.parametrize("n_replaced", [0, 1, 2])
def test_a_kill_between_two_files_is_taken_back_when_the_project_is_opened(project: Project, n_replaced: int) -> None:
    """As a program leaves it that is killed after so many files."""
    write_record(records_dir(project) / UNFINISHED, RECORD)
    for clip in RECORD.clips:
        set_aside(project, clip.clip_index, unless=clip.after)
    for index, draft in list(drafts(project).items())[:n_replaced]:
        os.replace(draft, project.clip_path(index))
    folder = project.folder
    project.close()
    half_done = [*["new-1", "new-2"][:n_replaced], *["old-1", "old-2"][n_replaced:]]
    assert current(open_project(folder, is_writable=False)) == half_done, "reading changes nothing"
    reopened = open_project(folder)
    try:
        assert current(reopened) == ["old-1", "old-2"]
        assert not (records_dir(reopened) / UNFINISHED).exists()
    finally:
        reopened.close()


def test_an_interruption_between_two_files_leaves_both_as_they_were(
    project: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*arguments: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(in_place, "keep_record", interrupt)
    with pytest.raises(KeyboardInterrupt):
        put_in_place(project, RECORD, drafts(project))
    assert current(project) == ["old-1", "old-2"]


def test_a_damaged_note_of_something_unfinished_keeps_nobody_out(project: Project) -> None:
    records_dir(project).mkdir()
    (records_dir(project) / UNFINISHED).write_text("{")
    folder = project.folder
    project.close()
    open_project(folder).close()
    assert not (folder / "mends" / UNFINISHED).exists()


def test_old_records_go(project: Project) -> None:
    numbers = [keep_record(project, RECORD) for _ in range(MAX_KEPT + 2)]
    assert record_numbers(project) == numbers[2:]


@pytest.mark.parametrize("text", ["{", '{"schema": 1}', '{"schema": 2}', "[]"])
def test_a_damaged_record_is_a_typed_error(project: Project, text: str) -> None:
    keep_record(project, RECORD)
    (records_dir(project) / "0001.json").write_text(text)
    with pytest.raises(ProjectError, match="mending record"):
        kept_record(project, 1)
    assert kept_record(project, 7) is None
