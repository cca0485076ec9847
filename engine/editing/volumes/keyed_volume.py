"""Keyed volumes: where a volume is between its keys, and how keys are set, moved and taken away. Pure functions.

Middle and logarithms of sizes follow the curves of camera paths, so that keys are reached exactly and nothing swings
out between them; turns go the shorter way from key to key, evenly.
"""

from __future__ import annotations

from bisect import bisect_right
from functools import lru_cache

import numpy as np
from msgspec import structs

from engine.camera.key_curves import along_curve, tangents_of
from engine.camera.rotations import inverse_quats, quat_product, quats_of_turns, turns_of_quats
from engine.editing.actions import Quat, vector_of
from engine.editing.edit import (
    MIN_SPACING_FRAMES,
    Box,
    KeyedVolume,
    Prism,
    Sphere,
    Target,
    Volume,
    VolumeKey,
    is_same_shape,
)


def volume_at(keyed: KeyedVolume, frame: float) -> Volume:
    """The volume at a moment, in frames of the capture, between frames too; at a key exactly that of the key."""
    keys = keyed.keys
    place = bisect_right(keys, frame, key=lambda key: key.frame) - 1
    if place < 0 or place == len(keys) - 1 or frame == keys[place].frame:
        return keys[max(place, 0)].volume
    return _curves(keyed).at(place, frame)


def volume_of(target: Target, frame: float) -> Volume | None:
    """The volume that a target is at a moment; None where it is none."""
    if isinstance(target, KeyedVolume):
        return volume_at(target, frame)
    return target if isinstance(target, Box | Sphere | Prism) else None


def with_volume(target: Target, frame: float, volume: Volume) -> Volume | KeyedVolume:
    """A target that is another volume now: a keyed one at that frame only. Raises ValueError like `with_key`."""
    return with_key(target, frame, volume) if isinstance(target, KeyedVolume) else volume


def key_at(keyed: KeyedVolume, frame: float) -> int | None:
    """Number of the key of a frame: the one within half a frame of it."""
    near = [(abs(key.frame - frame), number) for number, key in enumerate(keyed.keys)]
    away, number = min(near)
    return number if away < 0.5 else None


def with_key(target: Volume | KeyedVolume, frame: float, volume: Volume) -> KeyedVolume:
    """A volume with another key; one that has been at that frame is replaced.

    Args:
        target: A volume that rests gets its first key.
    Raises:
        ValueError: The volume is not of the same shape.
    """
    if not isinstance(target, KeyedVolume):
        return KeyedVolume((VolumeKey(frame, volume),))
    if not is_same_shape(target.keys[0].volume, volume):
        raise ValueError("the new key is not of the shape of the others")
    there = key_at(target, frame)
    frame = frame if there is None else target.keys[there].frame
    others = [key for number, key in enumerate(target.keys) if number != there]
    return KeyedVolume(tuple(sorted([*others, VolumeKey(frame, volume)], key=lambda key: key.frame)))


def without_key(keyed: KeyedVolume, number: int) -> Volume | KeyedVolume:
    """A volume without one of its keys; without its last one it rests where that was."""
    others = keyed.keys[:number] + keyed.keys[number + 1 :]
    return KeyedVolume(others) if others else keyed.keys[number].volume


def timed(keyed: KeyedVolume, number: int, frame: float) -> KeyedVolume:
    """A volume with one of its keys at another time, between its neighbours."""
    keys = list(keyed.keys)
    if number > 0:
        frame = max(frame, keys[number - 1].frame + 1.0)
    if number + 1 < len(keys):
        frame = min(frame, keys[number + 1].frame - 1.0)
    fits = number == 0 or frame - keys[number - 1].frame >= MIN_SPACING_FRAMES
    keys[number] = VolumeKey(frame if fits else keys[number].frame, keys[number].volume)
    return KeyedVolume(tuple(keys))


class _Curves:
    """All that depends on all keys, worked out once. keyed: With two keys or more."""

    def __init__(self, keyed: KeyedVolume) -> None:
        volumes = [key.volume for key in keyed.keys]
        self._volumes = volumes
        self._times = np.array([key.frame for key in keyed.keys])
        self._lengths = np.diff(self._times)
        self._centers = _Curve(np.array([volume.center for volume in volumes]), self._lengths)
        self._sizes = _Curve(np.log([_sizes(volume) for volume in volumes]), self._lengths)
        apexes = [[one.apex] for one in volumes if isinstance(one, Prism) and one.apex is not None]
        self._apexes = _Curve(np.log(apexes), self._lengths) if apexes else None
        quats = np.array([(1.0, 0.0, 0.0, 0.0) if isinstance(one, Sphere) else one.quat for one in volumes])
        self._quats = quats / np.linalg.norm(quats, axis=1, keepdims=True)
        self._turns = turns_of_quats(quat_product(inverse_quats(self._quats[:-1]), self._quats[1:]))

    def at(self, piece: int, frame: float) -> Volume:
        """The volume at a frame of a piece."""
        share = (frame - self._times[piece]) / self._lengths[piece]
        center, sizes = vector_of(self._centers.at(piece, share)), np.exp(self._sizes.at(piece, share))
        volume = self._volumes[piece]
        if isinstance(volume, Sphere):
            return Sphere(center, float(sizes[0]))
        quat = quat_product(self._quats[piece], quats_of_turns(share * self._turns[piece]))
        changed = structs.replace(volume, center=center, half_sizes=vector_of(sizes), quat=_quat(quat))
        if isinstance(changed, Prism) and self._apexes is not None:
            return structs.replace(changed, apex=float(np.exp(self._apexes.at(piece, share))[0]))
        return changed


class _Curve:
    """A curve through values at keys [P + 1, D]; lengths: Of its pieces. [P]"""

    def __init__(self, values: np.ndarray, lengths: np.ndarray) -> None:
        self._values, self._lengths = values, lengths
        self._tangents = tangents_of(np.diff(values, axis=0), lengths)

    def at(self, piece: int, share: float) -> np.ndarray:
        """The values at a share of a piece. [D]"""
        return along_curve(self._values, self._tangents, self._lengths, np.array([piece]), np.array([share]))[0]


@lru_cache(maxsize=64)
def _curves(keyed: KeyedVolume) -> _Curves:
    return _Curves(keyed)


def _sizes(volume: Volume) -> tuple[float, ...]:
    return (volume.radius,) if isinstance(volume, Sphere) else volume.half_sizes


def _quat(values: np.ndarray) -> Quat:
    w, x, y, z = (float(value) for value in values / np.linalg.norm(values))
    return w, x, y, z
