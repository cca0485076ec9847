"""Clips split and merged, another reference: pure changes of a document, taken back by nothing but the old document."""

from __future__ import annotations

import random

import pytest

from app.document.changes.clip_changes import with_merge, with_reference, with_split
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.document.storing.stored_document import document_of, plain_document
from app.project.clips.clip_names import clip_name
from engine.errors import ProjectError

N = 40


def document(**entries: object) -> ProjectDocument:
    return ProjectDocument(ProjectSettings("c", "f", **({"clip_length": 10} | entries)))  # type: ignore[arg-type]


def starts(found: ProjectDocument) -> list[int]:
    return [clip.start for clip in found.settings.clips(N)]


def names(found: ProjectDocument) -> list[str]:
    settings = found.settings
    return [clip_name(i, settings.clip_bounds, settings.clip_length) for i in range(len(settings.clips(N)))]


def test_a_split_gives_two_clips_and_leaves_the_names_of_all_others() -> None:
    split = with_split(document(), 15, N)
    assert starts(split) == [0, 10, 15, 20, 30]
    assert names(split) == ["0000", "000010-000015", "000015-000020", "0002", "0003"]
    assert [clip.clip_length for clip in split.settings.clips(N)] == [10] * 5


def test_a_merge_gives_a_clip_whose_time_still_runs_below_one() -> None:
    merged = with_merge(document(), 2, N)
    assert names(merged) == ["0000", "0001", "000020-000040"]
    clip = merged.settings.clips(N)[2]
    assert (clip.n_frames, clip.clip_length) == (20, 20)
    assert clip.clip_time(39) == 19 / 20


def test_what_is_split_and_merged_again_is_the_document_from_before() -> None:
    start = document(reference_clip=2)
    assert with_merge(with_split(start, 15, N), 1, N) == start
    short = document(clip_length=16)  # the last clip has 8 frames
    assert with_merge(with_split(short, 37, N), 2, N) == short
    assert names(with_split(short, 37, N))[-2:] == ["000032-000037", "000037-000040"]


def test_the_reference_stays_the_clip_with_its_first_frame() -> None:
    start = document(reference_clip=2)
    assert with_split(start, 5, N).settings.reference_clip == 3
    assert with_split(start, 25, N).settings.reference_clip == 2
    assert with_merge(start, 0, N).settings.reference_clip == 1
    assert with_merge(start, 1, N).settings.reference_clip == 1, "the merged clip holds it"
    assert with_reference(start, 3, N).settings.reference_clip == 3


def test_any_row_of_changes_keeps_clips_whole_and_their_names_apart() -> None:
    drawn, found = random.Random(5), document()
    for _ in range(300):
        try:
            if drawn.random() < 0.55:
                found = with_split(found, drawn.randrange(-2, N + 2), N)
            else:
                found = with_merge(found, drawn.randrange(-1, 6), N)
        except ProjectError:
            continue
        clips = found.settings.clips(N)
        assert [clip.stop for clip in clips[:-1]] == [clip.start for clip in clips[1:]]
        assert (clips[0].start, clips[-1].stop) == (0, N)
        assert all(clip.clip_time(clip.stop - 1) < 1.0 for clip in clips)
        assert len(set(names(found))) == len(clips)
        assert document_of(plain_document(found)) == found


def test_what_cannot_be() -> None:
    with pytest.raises(ProjectError, match="begins at frame 10 already"):
        with_split(document(), 10, N)
    for frame in (0, N, -3):
        with pytest.raises(ProjectError, match="No clip can begin"):
            with_split(document(), frame, N)
    for clip in (-1, 3, 9):
        with pytest.raises(ProjectError, match="another one after it"):
            with_merge(document(), clip, N)
    with pytest.raises(ProjectError, match="no clip 4"):
        with_reference(document(), 4, N)
    with pytest.raises(ProjectError, match="One field covers all frames"):
        with_split(document(overrides={"field": "joint"}), 5, N)


@pytest.mark.parametrize("bounds", [[], [0], [1, 40], [0, 5, 5, 40], [0, 9, 4]])
def test_bounds_that_make_no_sense_are_refused_when_read(bounds: list[int]) -> None:
    plain = plain_document(document())
    plain["settings"]["clip_bounds"] = bounds
    with pytest.raises(ProjectError, match="have to rise"):
        document_of(plain)


def test_bounds_of_another_capture_are_refused() -> None:
    with pytest.raises(ProjectError, match="end at frame 40"):
        with_split(document(), 15, N).settings.clips(41)
