"""Following an object: the keys of a volume that stays around it, from where its Gaussians are in some frames. Pure
functions.

A few Gaussians that stray from an object, and faint ones, count little. A box keeps its turn while that fits: it takes
another one only where it becomes clearly smaller, so that it does not tremble.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from msgspec import structs

from engine.camera.rotations import inverse_quats, matrices_of, quat_product, quats_of, turns_of_quats
from engine.capture.clip import Clip
from engine.editing.actions import Quat, vector_of
from engine.editing.edit import Box, KeyedVolume, Prism, Sphere, Volume, VolumeKey
from engine.editing.edited_clip import EditedClip
from engine.editing.scene_object import SceneObject
from engine.editing.volumes.keyed_volume import volume_at
from engine.editing.volumes.prisms import LOW, MARGIN, weighted_quantiles
from engine.errors import ProjectError
from engine.model.host_array import host_array

EVERY_FRAMES = 5
"""From one frame that is looked at to the next; first and last frames of clips are looked at, too."""
TOLERANCE = 0.05
"""What a key less may change: the middle by this share of the largest half size, sizes by this share, turns by as many
radians."""
CLEARLY_SMALLER = 0.85
"""A box is turned where this makes its volume smaller by this factor."""
LEAST_GAUSSIANS = 4
LEAST_SHARE = 1e-3
"""Smallest half size, as a share of the largest one."""


@dataclass(frozen=True, slots=True, eq=False)
class Crowd:
    """The Gaussians of an object in one frame.

    Attributes:
        frame_index: The frame.
        means: Scene units. [N, 3]
        opacities: 0..1. [N]
    """

    frame_index: int
    means: np.ndarray
    opacities: np.ndarray


def followed(crowds: Iterable[Crowd], like: Volume | None = None) -> KeyedVolume:
    """A volume that goes along with an object: one that shares its kind with `like`.

    Args:
        crowds: By frame, rising; frames in which hardly anything is there are left out.
        like: A box or a sphere goes around the object; a prism keeps its form and goes along with its middle. None for
            a box.
    Returns:
        With as few keys as TOLERANCE allows.
    Raises:
        ProjectError: There is nothing in any of the frames.
    """
    keys: list[VolumeKey] = []
    quat: Quat = like.quat if isinstance(like, Box) else (1.0, 0.0, 0.0, 0.0)
    for crowd in crowds:
        volume = _around(crowd, like, quat)
        if volume is not None:
            keys.append(VolumeKey(float(crowd.frame_index), volume))
            quat = volume.quat if isinstance(volume, Box) else quat
    if not keys:
        raise ProjectError(
            "The object has no Gaussians in the frames that were looked at.",
            hint="Find it again, or correct it.",
        )
    return thinned(KeyedVolume(tuple(keys)))


def frames_to_follow(one: SceneObject, clip: Clip) -> list[int]:
    """Frames of a clip in which to look where an object is: those where it is seen, some of them."""
    found = one.in_clip(clip.start)
    if found is None:  # it begins within the clip
        found = one.in_clip(max(clip.start, one.first))
    if found is None or not found.sets:
        return []
    wanted = sorted({*range(clip.start, clip.stop, EVERY_FRAMES), clip.stop - 1})
    runs = found.seen or ((clip.start, clip.stop),)
    ends = [frame for first, stop in runs for frame in (first, stop - 1) if clip.start <= frame < clip.stop]
    is_seen = {frame for first, stop in runs for frame in range(first, stop)}
    return [frame for frame in sorted({*wanted, *ends}) if frame in is_seen and one.in_clip(frame) is not None]


def crowd_of(one: SceneObject, edited: EditedClip, frame_index: int) -> Crowd:
    """The Gaussians of an object in a frame of a clip, as they were trained.

    Raises:
        ProjectError: Its picks are damaged.
    """
    decoded = edited.decode(edited.clip.clip_time(frame_index))
    is_of_it = edited.rows.is_picked(one.picked(frame_index))[edited.rows.indices_of(decoded.rows)]
    means, opacities = host_array(decoded.gaussians.means), host_array(decoded.gaussians.opacities)
    return Crowd(frame_index, means[is_of_it], opacities[is_of_it])


def thinned(keyed: KeyedVolume) -> KeyedVolume:
    """A keyed volume without keys that change it by less than TOLERANCE."""
    keys = keyed.keys
    kept = sorted({0, len(keys) - 1})
    while True:
        fewer = KeyedVolume(tuple(keys[number] for number in kept))
        errors = np.array([_difference(key.volume, volume_at(fewer, key.frame)) for key in keys])
        worst = [
            first + 1 + int(errors[first + 1 : last].argmax())
            for first, last in pairwise(kept)
            if last - first > 1 and errors[first + 1 : last].max() > TOLERANCE
        ]
        if not worst:
            return fewer
        kept = sorted({*kept, *worst})


def _difference(a: Volume, b: Volume) -> float:
    """How different two volumes of one shape are, as TOLERANCE counts."""
    sizes = [np.atleast_1d(one.radius if isinstance(one, Sphere) else one.half_sizes) for one in (a, b)]
    away = math.dist(a.center, b.center) / float(sizes[0].max())
    found = max(away, float(np.abs(np.log(sizes[0] / sizes[1])).max()))
    if isinstance(a, Sphere) or isinstance(b, Sphere):
        return found
    turn = quat_product(inverse_quats(np.array(a.quat)), np.array(b.quat))
    return max(found, float(np.linalg.norm(turns_of_quats(turn))))


def _around(crowd: Crowd, like: Volume | None, quat: Quat) -> Volume | None:
    """The volume around Gaussians; None where there are hardly any. quat: Of a box before."""
    is_sound = np.isfinite(crowd.means).all(axis=1) & (crowd.opacities > 0.0)
    means, weights = crowd.means[is_sound].astype(np.float64), crowd.opacities[is_sound].astype(np.float64)
    if len(means) < LEAST_GAUSSIANS:
        return None
    if isinstance(like, Sphere):
        center = np.array([weighted_quantiles(column, weights, (0.5,))[0] for column in means.T])
        (radius,) = weighted_quantiles(np.linalg.norm(means - center, axis=1), weights, (1.0 - LOW,))
        return Sphere(vector_of(center), max((1.0 + MARGIN) * radius, 1e-9))
    turned = _box(means, weights, np.array(quat))
    if isinstance(like, Prism):
        return structs.replace(like, center=turned.center)
    other = _box(means, weights, _main_quat(means, weights, turned, np.array(quat)))
    return other if math.prod(other.half_sizes) < CLEARLY_SMALLER * math.prod(turned.half_sizes) else turned


def _box(means: np.ndarray, weights: np.ndarray, quat: np.ndarray) -> Box:
    """The box of a turn around nearly all of the weight."""
    axes = matrices_of(quat / np.linalg.norm(quat))
    ends = np.array([weighted_quantiles(column, weights, (LOW, 1.0 - LOW)) for column in (means @ axes).T])
    halves = (0.5 + MARGIN) * (ends[:, 1] - ends[:, 0])
    halves = np.maximum(halves, max(LEAST_SHARE * float(halves.max()), 1e-9))
    w, x, y, z = (float(value) for value in quat / np.linalg.norm(quat))
    return Box(vector_of(axes @ ends.mean(axis=1)), vector_of(halves), (w, x, y, z))


def _main_quat(means: np.ndarray, weights: np.ndarray, within: Box, near: np.ndarray) -> np.ndarray:
    """The turn along the main axes of what lies in a box, of all those that give the same box the one nearest to
    another turn."""
    axes = matrices_of(np.array(within.quat))
    is_in = (np.abs((means - within.center) @ axes) <= within.half_sizes).all(axis=1)
    kept, share = means[is_in], weights[is_in] / max(float(weights[is_in].sum()), 1e-300)
    if len(kept) < LEAST_GAUSSIANS:
        return near
    centred = kept - share @ kept
    main = np.linalg.eigh((centred * share[:, None]).T @ centred)[1]
    found, best = near, -1.0
    for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
        for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            first, second = signs[0] * main[:, order[0]], signs[1] * main[:, order[1]]
            quat = quats_of(np.stack([first, second, np.cross(first, second)], axis=1))
            if (likeness := abs(float(quat @ near))) > best:
                found, best = quat, likeness
    return found
