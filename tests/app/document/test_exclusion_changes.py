"""What training never sees, changed: spans are joined and cut, strokes gather, and nothing impossible is kept."""

from __future__ import annotations

import pytest

from app.document.changes.exclusion_changes import (
    with_cameras_excluded,
    with_frames_excluded,
    with_stroke,
    without_exclusions,
    without_masks,
)
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.document.storing.stored_document import document_of, plain_document
from engine.capture.exclusions import NOTHING_EXCLUDED, ExcludedFrames, Stroke, exclusion_key
from engine.errors import ProjectError

NAMES = ("a", "b", "c", "d")
DOT = Stroke(((0.5, 0.5),), 0.1)
EMPTY = ProjectDocument(ProjectSettings("c", "f", holdout=("d",)))


def frames(document: ProjectDocument, first: int, stop: int, camera: str | None = None, *, out: bool = True):
    return with_frames_excluded(document, first, stop, camera=camera, camera_names=NAMES, n_frames=30, is_excluded=out)


def painted(document: ProjectDocument, camera: str, first: int, stop: int, stroke: Stroke = DOT) -> ProjectDocument:
    return with_stroke(document, stroke, camera=camera, first=first, stop=stop, camera_names=NAMES, n_frames=30)


def test_cameras_go_and_come_back_in_the_order_of_the_capture() -> None:
    found = with_cameras_excluded(EMPTY, ["b"], NAMES)
    assert found.exclusions.cameras == ("b",)
    with pytest.raises(ProjectError, match="leaves 1 cameras"):
        with_cameras_excluded(found, ["a"], NAMES)
    assert with_cameras_excluded(found, ["d"], NAMES).exclusions.cameras == ("b", "d"), "one that is held out"
    assert with_cameras_excluded(found, ["b"], NAMES, is_excluded=False) == EMPTY
    assert with_cameras_excluded(found, ["b"], NAMES) is found
    with pytest.raises(ProjectError, match="no camera called x"):
        with_cameras_excluded(EMPTY, ["x"], NAMES)


def test_frames_are_joined_and_cut() -> None:
    found = frames(frames(frames(EMPTY, 3, 5), 9, 10), 5, 9)
    assert found.exclusions.frames == (ExcludedFrames(None, 3, 10),)
    found = frames(found, 5, 6, out=False)
    assert found.exclusions.frames == (ExcludedFrames(None, 3, 5), ExcludedFrames(None, 6, 10))
    found = frames(found, 1, 2, "b")
    assert found.exclusions.frames[-1] == ExcludedFrames("b", 1, 2)
    assert frames(found, 0, 30, out=False) == EMPTY, "of all cameras takes those of one with it"
    with pytest.raises(ProjectError, match="Frames 29 to 30"):
        frames(EMPTY, 29, 31)


def test_strokes_of_the_same_frames_are_one_mask() -> None:
    erasing = Stroke(((0.5, 0.5),), 0.1, is_erasing=True)
    found = painted(painted(painted(EMPTY, "a", 0, 30), "a", 0, 30, erasing), "b", 4, 5)
    assert [len(mask.strokes) for mask in found.exclusions.masks] == [2, 1]
    assert [mask.camera for mask in without_masks(found, camera="a").exclusions.masks] == ["b"]
    assert len(without_masks(found, camera="b", frame=9).exclusions.masks) == 2
    assert without_masks(found, frame=4).exclusions == NOTHING_EXCLUDED
    with pytest.raises(ProjectError, match="nothing to erase"):
        painted(EMPTY, "a", 0, 30, erasing)
    assert document_of(plain_document(found)) == found
    assert without_exclusions(found) == EMPTY


def test_the_key_names_what_concerns_the_frames_alone() -> None:
    found = frames(EMPTY, 3, 5).exclusions
    assert exclusion_key(found, (5, 9)) == ""
    assert exclusion_key(found, (4, 9)) == exclusion_key(found, (0, 30)) != ""
    assert exclusion_key(frames(EMPTY, 3, 6).exclusions, (0, 30)) != exclusion_key(found, (0, 30))
