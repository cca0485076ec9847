"""Following an object: a volume that stays around it, with few keys and without trembling."""

from __future__ import annotations

import math

import numpy as np
import pytest

from engine.camera.rotations import matrices_of, quats_of_turns
from engine.capture.clip import Clip
from engine.editing.actions import Hide
from engine.editing.edit import Box, KeyedVolume, Picked, PickedRows, Prism, Sphere, VolumeKey
from engine.editing.effects import Effect, Effects
from engine.editing.picks import pack_rows
from engine.editing.scene_object import ObjectInClip, ObjectSeed, SceneObject
from engine.editing.selection.volumes import in_volume
from engine.editing.volumes.following import TOLERANCE, Crowd, crowd_of, followed, frames_to_follow, thinned
from engine.editing.volumes.keyed_volume import volume_at
from engine.errors import ProjectError
from tests.engine.editing.edited_clips import CLIP, OWN, REFERENCE, edited, make_clip

SIZES = np.array([0.4, 1.8, 0.3])
NOWHERE = Crowd(0, np.zeros((0, 3)), np.zeros(0))


def person(frame: int, *, yaw: float = 0.0, seed: int = 0, n: int = 2000) -> Crowd:
    """Somebody who walks along x, with a few Gaussians that are lost far away, and many faint ones around."""
    rng = np.random.default_rng(seed + frame)
    axes = matrices_of(quats_of_turns(np.array([0.0, yaw, 0.0])))
    body = rng.uniform(-0.5, 0.5, (n, 3)) * SIZES @ axes.T
    lost, faint = rng.normal(size=(10, 3)) * 30, rng.normal(size=(500, 3)) * 3
    means = np.concatenate([body, lost, faint]) + np.array([0.1 * frame, 0.9, 0.0])
    opacities = np.concatenate([rng.uniform(0.5, 1.0, n + 10), np.full(500, 1e-3)])
    return Crowd(frame, means, opacities)


def center_at(frame: float) -> np.ndarray:
    return np.array([0.1 * frame, 0.9, 0.0])


@pytest.mark.parametrize("like", [None, Sphere((9.0, 9.0, 9.0), 3.0), Box((9.0, 9.0, 9.0), (1.0, 1.0, 1.0))])
def test_it_stays_around_somebody_who_walks_and_lets_the_few_lost_ones_go(like: Box | Sphere | None) -> None:
    keyed = followed([person(frame) for frame in range(0, 40, 5)], like)
    assert all(isinstance(key.volume, Box if like is None else type(like)) for key in keyed.keys)
    assert len(keyed.keys) <= 4, "an even walk needs hardly any keys"
    for frame in range(0, 36):
        volume = volume_at(keyed, frame)
        np.testing.assert_allclose(volume.center, center_at(frame), atol=0.1)
        body = person(frame).means[:2000]
        assert in_volume(volume, body).mean() > 0.9
        if isinstance(volume, Box):
            assert volume.quat == (1.0, 0.0, 0.0, 0.0), "nothing is gained by a turn"
            np.testing.assert_allclose(np.array(volume.half_sizes) * 2, SIZES, rtol=0.25)


def test_a_box_turns_where_it_becomes_clearly_smaller_and_never_the_long_way() -> None:
    crowds = [person(frame, yaw=math.radians(3 * frame)) for frame in range(0, 41, 5)]
    keyed = followed(crowds)
    quats = np.array([key.volume.quat for key in keyed.keys if isinstance(key.volume, Box)])
    assert len({tuple(quat) for quat in quats.tolist()}) > 1
    for crowd in crowds:
        volume = volume_at(keyed, crowd.frame_index)
        assert isinstance(volume, Box)
        assert in_volume(volume, crowd.means[:2000]).mean() > 0.85
        assert math.prod(volume.half_sizes) * 8 < 2.6 * math.prod(SIZES)


def test_a_prism_goes_along_and_keeps_its_form() -> None:
    prism = Prism((0.0, 0.0, 0.0), (1.0, 2.0, 3.0), ((-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)), apex=2.0)
    keyed = followed([person(frame) for frame in range(0, 20, 5)], prism)
    for key in keyed.keys:
        assert isinstance(key.volume, Prism)
        np.testing.assert_allclose(key.volume.center, center_at(key.frame), atol=0.1)
        assert key.volume.half_sizes == prism.half_sizes


def test_frames_without_anything_are_left_out_and_with_nothing_at_all_it_says_so() -> None:
    keyed = followed([NOWHERE, person(5), person(10)])
    assert [key.frame for key in keyed.keys] == [5.0, 10.0]
    with pytest.raises(ProjectError, match="has no Gaussians"):
        followed([NOWHERE])


def test_keys_that_change_little_are_left_out_and_all_others_stay() -> None:
    angles = np.linspace(0.0, 6.0, 60)
    places = np.stack([np.sin(angles), 0.1 * angles, np.cos(2 * angles)], axis=1)
    full = KeyedVolume(
        tuple(VolumeKey(5.0 * i, Box(tuple(place.tolist()), (0.5, 1.0, 0.5))) for i, place in enumerate(places))
    )
    found = thinned(full)
    assert 2 < len(found.keys) < len(full.keys)
    assert {*found.keys} <= {*full.keys}
    for key in full.keys:
        assert math.dist(volume_at(found, key.frame).center, key.volume.center) <= TOLERANCE
    assert thinned(found) == found


def test_it_is_looked_at_where_it_is_seen_at_the_ends_of_clips_and_every_few_frames() -> None:
    sets = (PickedRows(0, "a", "static", pack_rows(np.arange(3))),)
    clips = (
        ObjectInClip(0, 12, sets),
        ObjectInClip(12, 24, sets, seen=((13, 15), (20, 24))),
        ObjectInClip(24, 36, ()),
    )
    one = SceneObject(1, "she", seeds=(ObjectSeed(0, sets),), clips=clips)
    asked = [frames_to_follow(one, Clip(i, 12 * i, 12, 12)) for i in range(4)]
    assert asked == [[0, 5, 10, 11], [13, 14, 20, 22, 23], [], []]
    begins = SceneObject(1, "she", clips=clips, first=3, stop=11)
    assert [frames_to_follow(begins, Clip(i, 12 * i, 12, 12)) for i in range(2)] == [[5, 10], []]


def test_its_gaussians_are_those_that_were_picked_and_are_there() -> None:
    model = make_clip()
    clip = edited(model)
    sets = (
        PickedRows(0, REFERENCE, "moving", pack_rows(np.arange(5, 20))),
        PickedRows(2, OWN, "residual", pack_rows(np.arange(0, 9))),
    )
    one = SceneObject(1, "she", clips=(ObjectInClip(CLIP.start, CLIP.stop, sets),))
    for frame in CLIP.frame_indices():
        crowd = crowd_of(one, clip, frame)
        hidden = Effects.made([Effect(Picked(sets), Hide(), is_inverted=True)])
        expected = clip.decode(CLIP.clip_time(frame), hidden).gaussians
        assert len(crowd.means) == len(expected) > 0
        np.testing.assert_allclose(np.sort(crowd.means, axis=0), np.sort(expected.means.numpy(), axis=0), atol=1e-6)
        assert crowd.frame_index == frame
