"""Keyed volumes: what lies between keys, and what changes of keys leave."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.camera.camera_path import CameraKey, CameraPath
from engine.camera.rotations import matrices_of
from engine.editing.edit import Box, KeyedVolume, Prism, Sphere, Volume, VolumeKey
from engine.editing.volumes.keyed_volume import key_at, timed, volume_at, with_key, without_key

HALF_TURN = (math.cos(0.7), 0.0, math.sin(0.7), 0.0)
OUTLINE = ((-1.0, -1.0), (1.0, -1.0), (0.0, 1.0))
_PLACES = st.tuples(*[st.floats(-50, 50)] * 3)
_SIZES = st.tuples(*[st.floats(0.01, 20)] * 3)
_QUATS = (
    st.tuples(*[st.floats(-1, 1)] * 4)
    .filter(lambda quat: math.hypot(*quat) > 0.1)
    .map(lambda quat: tuple(part / math.hypot(*quat) for part in quat))
)
_KINDS: Any = st.sampled_from(
    (
        st.builds(Box, _PLACES, _SIZES, _QUATS),
        st.builds(Sphere, _PLACES, st.floats(0.01, 20)),
        st.builds(Prism, _PLACES, _SIZES, st.just(OUTLINE), _QUATS, st.floats(1.01, 50)),
    )
)


@st.composite
def keyed_volumes(draw: Any) -> KeyedVolume:
    kind = draw(_KINDS)
    frames = draw(st.lists(st.integers(0, 400), min_size=1, max_size=7, unique=True))
    return KeyedVolume(tuple(VolumeKey(frame / 4, draw(kind)) for frame in sorted(frames)))


def quat_of(volume: Volume) -> np.ndarray:
    return np.array((1.0, 0.0, 0.0, 0.0) if isinstance(volume, Sphere) else volume.quat)


@given(keyed_volumes())
@settings(max_examples=150, deadline=None)
def test_keys_are_reached_exactly_and_it_rests_before_and_after_them(keyed: KeyedVolume) -> None:
    for key in keyed.keys:
        assert volume_at(keyed, key.frame) == key.volume
    first, last = keyed.keys[0], keyed.keys[-1]
    assert volume_at(keyed, first.frame - 3.0) == first.volume
    assert volume_at(keyed, last.frame + 0.1) == volume_at(keyed, 1e9) == last.volume


@given(keyed_volumes())
@settings(max_examples=100, deadline=None)
def test_nothing_jumps(keyed: KeyedVolume) -> None:
    for key in keyed.keys:
        there = volume_at(keyed, key.frame)
        for side in (-1e-6, 1e-6):
            near = volume_at(keyed, key.frame + side)
            np.testing.assert_allclose(near.center, there.center, atol=0.01)
            assert abs(quat_of(near) @ quat_of(there)) > 1.0 - 1e-6
            if isinstance(near, Sphere):
                assert isinstance(there, Sphere)
                assert near.radius == pytest.approx(there.radius, rel=0.01)


@given(keyed_volumes(), st.floats(-10, 110))
@settings(max_examples=150, deadline=None)
def test_it_stays_between_its_keys(keyed: KeyedVolume, frame: float) -> None:
    found = volume_at(keyed, frame)
    if isinstance(found, Sphere):
        radii = [key.volume.radius for key in keyed.keys if isinstance(key.volume, Sphere)]
        before = max(sum(key.frame <= frame for key in keyed.keys) - 1, 0)
        near = radii[before : before + 2]
        assert min(near) * (1 - 1e-9) <= found.radius <= max(near) * (1 + 1e-9)
    else:
        assert not isinstance(found, Sphere)
        assert abs(math.hypot(*found.quat) - 1.0) < 1e-6
        if isinstance(found, Prism):
            assert found.outline is OUTLINE
            assert found.apex is not None
            assert found.apex > 1.0


def test_between_two_keys_places_are_even_sizes_grow_by_factors_and_turns_are_even() -> None:
    keyed = KeyedVolume(
        (
            VolumeKey(10.0, Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))),
            VolumeKey(14.0, Box((4.0, 0.0, -2.0), (4.0, 1.0, 0.25), HALF_TURN)),
        )
    )
    for share in (0.25, 0.5, 0.8):
        found = volume_at(keyed, 10.0 + 4.0 * share)
        assert isinstance(found, Box)
        np.testing.assert_allclose(found.center, (4.0 * share, 0.0, -2.0 * share), atol=1e-12)
        np.testing.assert_allclose(found.half_sizes, (4.0**share, 1.0, 0.25**share))
        angle = 1.4 * share
        expected = [[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]]
        np.testing.assert_allclose(matrices_of(np.array(found.quat)), expected, atol=1e-12)


def test_its_middle_goes_the_way_of_a_camera_through_the_same_places() -> None:
    places = np.random.default_rng(0).normal(size=(6, 3)) * 5
    frames = (0.0, 3.0, 4.0, 10.0, 11.5, 20.0)
    keys = []
    for frame, place in zip(frames, places, strict=True):
        matrix = np.eye(4)
        matrix[:3, 3] = -place
        keys.append(CameraKey(frame, matrix, 1.0))
    path = CameraPath("way", tuple(keys))
    keyed = KeyedVolume(
        tuple(VolumeKey(frame, Sphere(tuple(place.tolist()), 1.0)) for frame, place in zip(frames, places, strict=True))
    )
    for frame in np.linspace(-1, 21, 45):
        np.testing.assert_allclose(volume_at(keyed, float(frame)).center, path.centers([frame])[0], atol=1e-9)


def test_keys_are_set_replaced_moved_and_removed() -> None:
    one, two, three = (Sphere((float(i), 0.0, 0.0), 1.0) for i in range(3))
    keyed = with_key(one, 5.0, one)
    assert keyed == KeyedVolume((VolumeKey(5.0, one),))
    keyed = with_key(with_key(keyed, 9.0, three), 7.0, two)
    assert [key.frame for key in keyed.keys] == [5.0, 7.0, 9.0]
    assert with_key(keyed, 7.0, one).keys[1] == VolumeKey(7.0, one)
    assert (key_at(keyed, 7), key_at(keyed, 6.6), key_at(keyed, 6)) == (1, 1, None)
    assert timed(keyed, 1, 100.0).keys[1].frame == 8.0
    assert timed(keyed, 1, -100.0).keys[1].frame == 6.0
    assert timed(keyed, 2, 30.0).keys[2].frame == 30.0
    rest = without_key(keyed, 0)
    assert isinstance(rest, KeyedVolume)
    rest = without_key(rest, 1)
    assert isinstance(rest, KeyedVolume)
    assert without_key(rest, 0) == two, "without keys it rests where the last one was"
    with pytest.raises(ValueError, match="not of the shape"):
        with_key(keyed, 1.0, Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))


def test_keys_too_close_to_part_stay_where_they_are() -> None:
    ball = Sphere((0.0, 0.0, 0.0), 1.0)
    keyed = KeyedVolume((VolumeKey(1.0, ball), VolumeKey(1.2, ball), VolumeKey(1.4, ball)))
    assert timed(keyed, 1, 5.0) == keyed


def test_values_that_no_keyed_volume_may_have() -> None:
    ball, box = Sphere((0.0, 0.0, 0.0), 1.0), Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    prism = Prism((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), OUTLINE)
    other = Prism((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), OUTLINE, apex=3.0)
    for keys, expected in (
        ((), "has 0 keys"),
        ((VolumeKey(2.0, ball), VolumeKey(2.0, ball)), "not in order or too close: frames 2 and 2"),
        ((VolumeKey(3.0, ball), VolumeKey(2.0, ball)), "not in order"),
        ((VolumeKey(1.0, ball), VolumeKey(2.0, box)), "frames 1 and 2 are not of one shape"),
        ((VolumeKey(1.0, prism), VolumeKey(2.0, other)), "not of one shape"),
    ):
        with pytest.raises(ValueError, match=expected):
            KeyedVolume(keys)
    for frame in (math.nan, math.inf, 1e10):
        with pytest.raises(ValueError, match="frame of a key"):
            VolumeKey(frame, ball)
