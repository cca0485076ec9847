"""Copies of two clips against brute force: decode the other clip, take the object's rows, and move them one by one."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch

from engine.camera.path_presets import turntable
from engine.camera.rotations import matrices_of
from engine.capture.clip import Clip
from engine.editing.actions import Expose, Hide, Transform
from engine.editing.clip_rows import named_sets
from engine.editing.copies.copied import Copier, CopySource, middle_of
from engine.editing.copies.copy_moments import CopyMoments, moved_along
from engine.editing.copies.object_copy import ObjectCopy, OnObject, OnPath, nearest_frame
from engine.editing.edit import Edit, ObjectTarget, Picked, PickedRows, Scope, Sphere
from engine.editing.edited_clip import EditedClip, EditedGaussians
from engine.editing.effects import EditStack
from engine.editing.gaussian_rows import COPIED
from engine.editing.picks import pack_rows, unpack_rows
from engine.editing.scene_object import ObjectInClip, SceneObject
from tests.clip_headers import make_header
from tests.engine.editing.edited_clips import CLIP, OWN, REFERENCE, K, edited, make_clip

NEXT = Clip(clip_index=3, start=15, n_frames=5, clip_length=6)
OTHER = "other-file"
TURN = (math.cos(0.4), 0.0, math.sin(0.4), 0.0)
PUSH = Transform((2.0, 0.5, -1.0), TURN, 1.5, (0.5, 0.4, 0.3))


def picks(origin: str, clip_index: int, *, step: int) -> tuple[PickedRows, ...]:
    return (
        PickedRows(0, REFERENCE, "moving", pack_rows(np.arange(0, 8 * K, step))),
        PickedRows(clip_index, origin, "residual", pack_rows(np.arange(1, 6 * K, step))),
    )


ONE = SceneObject(
    1, "one", clips=(ObjectInClip(10, 15, picks(OWN, 2, step=1)), ObjectInClip(15, 20, picks(OTHER, 3, step=2)))
)
CARRIER = SceneObject(2, "carrier", clips=(ObjectInClip(10, 15, picks(OWN, 2, step=3)), ObjectInClip(15, 20)))


@pytest.fixture(scope="module")
def clips() -> dict[int, EditedClip]:
    model = make_clip(has_light=False)
    header = make_header(role="source", clip_index=3, fingerprint=OTHER, reference_fingerprint=REFERENCE)
    return {2: edited(make_clip()), 3: EditedClip(model, NEXT, named_sets(model, header, 0))}


def clip_at(clips: dict[int, EditedClip]) -> Callable[[float], CopySource | None]:
    def found(frame: float) -> CopySource | None:
        at = nearest_frame(frame)
        index = next((index for index, one in clips.items() if one.clip.start <= at < one.clip.stop), None)
        return None if index is None else CopySource(index, lambda: clips[index])

    return found


def shown(clips: dict[int, EditedClip], stack: EditStack, frame: int) -> EditedGaussians:
    source = clip_at(clips)(frame)
    assert source is not None
    clip = source.load()
    before = clip.decode(clip.clip.clip_time(frame), stack.at(frame))
    after = Copier().with_copies(before, CopyMoments(stack).at(frame), clip_at(clips))
    n = len(before.gaussians)
    assert after.n_still == before.n_still
    for one, other in zip(before.gaussians.tensors(), after.gaussians.tensors(), strict=True):
        torch.testing.assert_close(other[:n], one, rtol=0, atol=0)
    np.testing.assert_array_equal(after.rows.number[:n], before.rows.number)
    assert [after.rows.sets[place] for place in set(after.rows.set_index[n:].tolist())] in ([], [COPIED])
    assert len(after.rows) == len(after.gaussians)
    return after


def is_of(one: SceneObject, edited: EditedGaussians, frame: float) -> np.ndarray:
    """Which Gaussians belong to an object, one by one."""
    wanted = {
        (picked.origin, picked.role, int(number))
        for picked in one.picked(frame).sets
        for number in unpack_rows(picked.rows)
    }
    rows = edited.rows
    names = [(rows.sets[place].origin, rows.sets[place].role) for place in rows.set_index]
    return np.array([(*name, int(number)) in wanted for name, number in zip(names, rows.number, strict=True)], bool)


def brute(clips: dict[int, EditedClip], one: SceneObject, edits: EditStack, moment: float) -> dict[str, np.ndarray]:
    source = clip_at(clips)(moment)
    assert source is not None
    clip, at = source.load(), nearest_frame(moment)
    times = [(when - clip.clip.start) / clip.clip.clip_length for when in (moment, at)]
    found = clip.decode(times[0], edits.at(at), alive_at=times[1])
    names = ("means", "quats", "scales", "opacities", "colors")
    rows = is_of(one, found, at)
    return {name: t.double().numpy()[rows] for name, t in zip(names, found.gaussians.tensors(), strict=True)}


def moved(found: dict[str, np.ndarray], by: Transform) -> dict[str, np.ndarray]:
    matrix, pivot = matrices_of(np.array(by.quat)), np.array(by.pivot)
    means = [by.scale * matrix @ (mean - pivot) + pivot + np.array(by.translation) for mean in found["means"]]
    return found | {"means": np.array(means).reshape(-1, 3), "scales": found["scales"] * by.scale}


def assert_copied(after: EditedGaussians, *expected: dict[str, np.ndarray]) -> None:
    n = sum(len(one["means"]) for one in expected)
    assert int((after.rows.set_index == len(after.rows.sets) - 1).sum()) == n > 0
    means, _, scales, opacities, colors = (tensor.double().numpy()[-n:] for tensor in after.gaussians.tensors())
    for name, values in (("means", means), ("scales", scales), ("opacities", opacities), ("colors", colors)):
        wanted = np.concatenate([one[name] for one in expected])
        np.testing.assert_allclose(values, wanted, rtol=2e-5, atol=2e-5)


@pytest.mark.parametrize("shift", [0.0, 1.0, -5.0, 2.5, -6.25])
def test_a_copy_is_the_object_of_another_moment(clips: dict[int, EditedClip], shift: float) -> None:
    copy = ObjectCopy(1, "a", 1, PUSH, shift_frames=shift)
    stack = EditStack((), (ONE,), (copy,))
    for frame in (11, 13, 16):
        moment = copy.source_frame(frame, (10, 20))
        assert moment is not None
        after = shown(clips, stack, frame)
        assert_copied(after, moved(brute(clips, ONE, EditStack(), moment), PUSH))


def test_turns_are_those_of_the_move(clips: dict[int, EditedClip]) -> None:
    stack = EditStack((), (ONE,), (ObjectCopy(1, "a", 1, PUSH),))
    after, plain = shown(clips, stack, 12), brute(clips, ONE, EditStack(), 12.0)
    n = len(plain["means"])
    quats = after.gaussians.quats.double().numpy()[-n:]
    for found, quat in zip(quats, plain["quats"], strict=True):
        wanted = matrices_of(np.array(TURN)) @ matrices_of(quat / np.linalg.norm(quat))
        np.testing.assert_allclose(matrices_of(found / np.linalg.norm(found)), wanted, atol=1e-5)


def test_a_copy_follows_the_edits_of_its_own_moment(clips: dict[int, EditedClip]) -> None:
    edits = (
        Edit(1, "", ObjectTarget(1), Transform((0.0, 3.0, 0.0)), Scope(15, 20)),
        Edit(2, "", Sphere((0.5, 3.5, 0.5), 2.0), Expose(1.0)),
    )
    copy = ObjectCopy(1, "a", 1, PUSH, shift_frames=-5.0)
    after = shown(clips, EditStack(edits, (ONE,), (copy,)), 11)
    assert_copied(after, moved(brute(clips, ONE, EditStack(edits, (ONE,)), 16.0), PUSH))
    hiding = (Edit(3, "", ObjectTarget(1), Hide()),)
    assert COPIED not in shown(clips, EditStack(hiding, (ONE,), (copy,)), 11).rows.sets


def test_a_copy_in_place_hides_the_object_and_not_itself(clips: dict[int, EditedClip]) -> None:
    copy = ObjectCopy(1, "a", 1, speed=2.0, anchor_frame=10.0, is_in_place=True)
    after = shown(clips, EditStack((), (ONE,), (copy,)), 12)
    assert not is_of(ONE, after, 12).any()
    assert_copied(after, brute(clips, ONE, EditStack(), 14.0))


def test_several_copies_come_in_their_order(clips: dict[int, EditedClip]) -> None:
    copies = tuple(
        ObjectCopy(i, "a", one.object_id, Transform((i, 0.0, 0.0)), shift_frames=shift)
        for i, (one, shift) in enumerate([(ONE, 0.0), (CARRIER, 0.0), (ONE, 0.0), (ONE, -4.0)], 1)
    )
    after = shown(clips, EditStack((), (ONE, CARRIER), copies), 12)
    moments = [(ONE, 12.0), (CARRIER, 12.0), (ONE, 12.0), (ONE, 16.0)]
    found = [brute(clips, one, EditStack(), moment) for one, moment in moments]
    assert_copied(after, *(moved(part, copy.transform) for part, copy in zip(found, copies, strict=True)))


def test_a_copy_that_is_off_or_whose_object_is_gone_adds_nothing(clips: dict[int, EditedClip]) -> None:
    copies = (
        ObjectCopy(1, "off", 1, is_on=False),
        ObjectCopy(2, "removed", 9),
        ObjectCopy(3, "later", 1, first=13),
        ObjectCopy(4, "over", 1, shift_frames=20.0, outside="gone"),
        ObjectCopy(5, "not there in that clip", 2, shift_frames=-6.0, outside="gone"),
    )
    stack = EditStack((), (ONE, CARRIER), copies)
    assert COPIED not in shown(clips, stack, 12).rows.sets
    first = {2: clips[2]}
    missing = EditStack((), (ONE,), (ObjectCopy(1, "of a clip that is not trained", 1, shift_frames=-6.0),))
    assert COPIED not in shown(first, missing, 12).rows.sets


def test_a_copy_on_a_path_keeps_its_place_in_the_camera(clips: dict[int, EditedClip]) -> None:
    path = turntable(np.array([0.5, 0.5, 0.5]), np.array([0.0, 0.0, 1.0]), 3.0, 0.2, (10, 19), name="orbit")
    copy = ObjectCopy(1, "a", 1, PUSH, anchor_frame=10.0, carried_by=OnPath("orbit"))
    stack = EditStack((), (ONE,), (copy,), (path,))
    for frame in (10, 12, 14):
        at_rest = moved(brute(clips, ONE, EditStack(), float(frame)), PUSH)
        rest, now = path.at(10.0)[0], path.at(frame)[0]
        means = [(np.linalg.inv(now) @ rest @ np.append(mean, 1.0))[:3] for mean in at_rest["means"]]
        assert_copied(shown(clips, stack, frame), at_rest | {"means": np.array(means)})
    still = moved_along(path, 11.0, 11.0)
    np.testing.assert_allclose((*still.translation, *still.quat), (0, 0, 0, 1, 0, 0, 0), atol=1e-9)


def test_a_copy_on_an_object_goes_as_far_as_that(clips: dict[int, EditedClip]) -> None:
    copy = ObjectCopy(1, "a", 1, PUSH, shift_frames=1.0, anchor_frame=10.0, carried_by=OnObject(2))
    stack = EditStack((), (ONE, CARRIER), (copy,))
    middles = {
        frame: np.median(brute(clips, CARRIER, EditStack(), float(frame))["means"], axis=0) for frame in (10, 12, 14)
    }
    for frame in (12, 14):
        at_rest = moved(brute(clips, ONE, EditStack(), frame - 1.0), PUSH)
        way = middles[frame] - middles[10]
        assert_copied(shown(clips, stack, frame), at_rest | {"means": at_rest["means"] + way})
    # the carrier is not there in the next clip: the copy stays where it was carried last
    assert_copied(
        shown(clips, stack, 16),
        moved(brute(clips, ONE, EditStack(), 15.0), PUSH)
        | {"means": moved(brute(clips, ONE, EditStack(), 15.0), PUSH)["means"] + middles[14] - middles[10]},
    )


def test_equal_moments_have_equal_digests(clips: dict[int, EditedClip]) -> None:
    def digest(*copies: ObjectCopy, frame: float = 12, edits: tuple[Edit, ...] = ()) -> str:
        return CopyMoments(EditStack(edits, (ONE, CARRIER), copies)).at(frame).digest

    base = ObjectCopy(1, "a", 1, PUSH)
    assert digest(base) == digest(ObjectCopy(7, "another name", 1, PUSH, group="g"))
    assert digest() == "" == digest(ObjectCopy(1, "a", 1, PUSH, is_on=False))
    others = {
        digest(base),
        digest(base, frame=13),
        digest(ObjectCopy(1, "a", 1, PUSH, shift_frames=1.0)),
        digest(ObjectCopy(1, "a", 1, Transform((2.0, 0.5, -1.0)))),
        digest(ObjectCopy(1, "a", 2, PUSH)),
        digest(base, base),
        digest(ObjectCopy(1, "a", 1, PUSH, carried_by=OnObject(2))),
        digest(base, edits=(Edit(1, "", Sphere((0.0, 0.0, 0.0), 1.0), Expose(1.0)),)),
    }
    assert len(others) == 8
    # one that stands still is the same at any time
    still = ObjectCopy(1, "a", 1, PUSH, speed=0.0, anchor_frame=11.0)
    assert digest(still, frame=10) == digest(still, frame=18)


def test_what_is_known_is_not_decoded_again(clips: dict[int, EditedClip]) -> None:
    n_loaded = []

    def counting(frame: float) -> CopySource | None:
        source = clip_at(clips)(frame)
        return None if source is None else CopySource(source.key, lambda: (n_loaded.append(frame), source.load())[1])

    copier = Copier()
    copies = (ObjectCopy(1, "a", 1, PUSH, shift_frames=-5.0), ObjectCopy(2, "a", 2))
    moments = CopyMoments(EditStack((), (ONE, CARRIER), copies))
    before = clips[2].decode(CLIP.clip_time(11))
    for _ in range(3):
        copier.with_copies(before, moments.at(11), counting)
    assert n_loaded == [16.0, 11.0]


def test_the_middle_of_an_object_bears_a_few_that_fly_away():
    gaussians = edited(make_clip()).decode(0.0).gaussians
    means = gaussians.means.clone()
    means[:2], means[2, 0] = 1e9, float("nan")
    middle = middle_of(type(gaussians)(means, *gaussians.tensors()[1:]))
    assert middle is not None
    assert np.abs(middle).max() < 2.0
    assert middle_of(gaussians[torch.zeros(len(gaussians), dtype=torch.bool)]) is None


def test_picks_of_a_moment_are_those_of_its_nearest_frame():
    moments = CopyMoments(EditStack((), (ONE,), (ObjectCopy(1, "a", 1, shift_frames=-0.25),)))
    assert moments.at(14.0).all[0].source.picked == Picked(picks(OWN, 2, step=1))
    assert moments.at(14.5).all[0].source.picked == Picked(picks(OTHER, 3, step=2))
    assert moments.at(14.5).frames == (15,)
