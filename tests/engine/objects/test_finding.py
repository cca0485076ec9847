"""Finding an object in clips: what was seen is meant, what stands still is the same everywhere."""

from __future__ import annotations

import numpy as np
import pytest

from engine.capture.clip import Clip
from engine.editing.edit import Picked, PickedRows
from engine.editing.edited_clip import EditedClip
from engine.editing.picks import pack_rows, unpack_rows
from engine.editing.scene_object import ObjectInClip, ObjectSeed, SceneObject, SeedView
from engine.editing.selection.seen_from import SeenFrom
from engine.objects.finding import SearchedClip, find_object
from tests.engine.editing.edited_clips import CLIP, OWN, REFERENCE, edited, make_clip

STILL = PickedRows(0, REFERENCE, "static", pack_rows(np.arange(3, 12)))
MOVING = PickedRows(2, OWN, "residual", pack_rows(np.arange(18)))
FRAME = CLIP.start + 2


@pytest.fixture(scope="module")
def clip() -> EditedClip:
    return edited(make_clip())


def found(clip: EditedClip, *seeds: ObjectSeed) -> tuple[ObjectInClip, ...]:
    return find_object(SceneObject(1, "it", seeds=seeds), [SearchedClip(clip.clip, lambda: clip)])


def from_the_side(depth: float) -> SeedView:
    """A view along z of the unit cube from a distance."""
    pose = np.eye(4)
    pose[:3, 3] = (-0.5, -0.5, depth)
    return SeedView.of(SeenFrom(pose, np.array([[50.0, 0, 32], [0, 50.0, 32], [0, 0, 1]]), 64, 64))


def test_nothing_was_said_of_trained_clips(clip: EditedClip) -> None:
    assert found(clip, ObjectSeed(CLIP.stop + 3, (MOVING,))) == ()
    assert found(clip) == ()


def test_what_stands_still_is_the_same_in_all_clips(clip: EditedClip) -> None:
    later = Clip(clip_index=3, start=CLIP.stop, n_frames=5, clip_length=6)
    gone = PickedRows(0, REFERENCE, "static", pack_rows(np.arange(3, 6)))
    seeds = (ObjectSeed(FRAME, (STILL,)), ObjectSeed(FRAME, removed=(gone,)))
    clips = [SearchedClip(clip.clip, lambda: clip), SearchedClip(later, lambda: clip)]
    first, second = find_object(SceneObject(1, "chair", seeds=seeds), clips)
    assert first.sets == second.sets
    assert [(one.origin, one.role) for one in first.sets] == [(REFERENCE, "static")]
    assert unpack_rows(first.sets[0].rows).tolist() == list(range(6, 12))
    assert (first.seen, second.seen) == (((CLIP.start, CLIP.stop),), ((later.start, later.stop),))


def test_what_moves_is_found_among_what_moves(clip: EditedClip) -> None:
    (one,) = found(clip, ObjectSeed(FRAME, (STILL, MOVING)))
    assert (one.start, one.stop) == (CLIP.start, CLIP.stop)
    assert {picked.role for picked in one.sets} <= {"moving", "residual"}
    assert clip.rows.is_picked(Picked(one.sets)).any()
    assert found(clip, ObjectSeed(FRAME, (STILL, MOVING))) == (one,)  # the same once more


def test_what_was_not_seen_was_not_meant(clip: EditedClip) -> None:
    """Seen from the other side of the room, nothing is in the picture, and all of the selection counts."""
    everything = found(clip, ObjectSeed(FRAME, (MOVING,)))
    assert found(clip, ObjectSeed(FRAME, (MOVING,), view=from_the_side(-50.0))) == everything
    assert found(clip, ObjectSeed(FRAME, (MOVING,), view=from_the_side(2.0)))[0].sets


def test_the_search_can_be_ended(clip: EditedClip) -> None:
    def report(n_done: int, n_all: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        find_object(
            SceneObject(1, "it", seeds=(ObjectSeed(FRAME, (MOVING,)),)), [SearchedClip(CLIP, lambda: clip)], report
        )


@pytest.mark.parametrize(
    ("pose", "K", "size"),
    [
        ((1.0,) * 15, (1.0,) * 9, (4, 4)),
        ((1.0,) * 16, (1.0,) * 8, (4, 4)),
        ((float("nan"),) * 16, (1.0,) * 9, (4, 4)),
        ((1.0,) * 16, (1.0,) * 9, (0, 4)),
        ((1.0,) * 16, (1.0,) * 9, (1 << 17, 4)),
        ((1.0,) * 16, (-1.0,) * 9, (4, 4)),
    ],
)
def test_a_view_is_checked(pose: tuple[float, ...], K: tuple[float, ...], size: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="view"):
        SeedView(pose, K, *size, near=0.01)
