"""Finding an object in all clips, from what somebody has said of it in one frame or a few.

From the clip of a seed it is carried to the clips before and after, one after the other: the parts of a clip that lie
where the object was at the border are known, and bonds within the clip decide for the rest. A correction is carried on
from its own clip, in both directions up to the next seed; between two seeds each counts the more the nearer it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from engine.capture.clip import Clip
from engine.editing.clip_rows import ClipRows
from engine.editing.edit import Picked, PickedRows
from engine.editing.edited_clip import EditedClip
from engine.editing.picks import pack_rows
from engine.editing.scene_object import Doubt, ObjectInClip, ObjectSeed, SceneObject
from engine.objects.belonging import belonging
from engine.objects.carrying import carried
from engine.objects.moving_parts import ROLES, MovingParts, moving_parts
from engine.objects.neighbours import bonds
from engine.objects.returning import Looks, looks_of, returned

SAID, UNSAID, BEFORE = 2.0, 0.1, 0.3
"""Weight of parts that somebody has selected, of those that were not selected along with them, and of what was known
of a clip before it was corrected. Parts at the border of a clip weigh 1 at most."""
LEAST_SHARE = 0.12
"""An object with less of its former mass than this is gone."""
LEAST_MOVING = 0.03
"""A selection of which less than this share travels is of something that stands still: the same in all clips."""
SEEN_SHARE = 0.1
"""In frames with less of its mass than this share of the most, an object is not there."""
TOUCHING = 0.02
"""Share of an object's bonds that lead to something else, from which on it touches that."""
Report = Callable[[int, int], None]
"""Told how many clips are done, of how many; its exceptions end the search."""


@dataclass(frozen=True, slots=True)
class SearchedClip:
    """A trained clip, and how to load it."""

    clip: Clip
    load: Callable[[], EditedClip]


@dataclass(slots=True, eq=False)
class _Ground:
    """A clip while it is searched: what moves in it, how that hangs together, and what was found."""

    clip: Clip
    rows: ClipRows
    parts: MovingParts
    bonds: csr_matrix
    values: np.ndarray
    surety: float = 0.0
    doubt: Doubt = ""

    @property
    def mass(self) -> float:
        """Of the object."""
        return float((self.parts.mass * (self.values > 0.5)).sum())


def find_object(
    one: SceneObject, clips: Sequence[SearchedClip], report: Report = lambda n_done, n_all: None
) -> tuple[ObjectInClip, ...]:
    """Find an object in every clip.

    Args:
        one: The object; of it, the seeds count.
        clips: The trained clips, by time. Each is loaded once; what moves in it is kept, some megabytes.
        report: See Report.
    Returns:
        Of every clip, by time; nothing where no seed lies in a trained clip.
    Raises:
        ProjectError: Picks are damaged, or a clip is.
    """
    seeded = [seed for seed in one.seeds if any(_holds(found.clip, seed) for found in clips)]
    if not seeded:
        return ()
    grounds = []
    for number, found in enumerate(clips):
        report(number, len(clips))
        edited = found.load()
        if not grounds and (still := _standing_still(seeded, edited.rows, clips)):
            return still
        parts = moving_parts(edited)
        grounds.append(_Ground(found.clip, edited.rows, parts, bonds(parts), np.zeros(len(parts))))
    search = _Search(grounds)
    for seed in seeded:
        search.take(seed)
    report(len(clips), len(clips))
    return tuple(_result(ground) for ground in grounds)


class _Search:
    """The walk over the clips. Seeds are taken one after the other, as they were made."""

    def __init__(self, grounds: list[_Ground]) -> None:
        self._grounds = grounds
        self._seeded: list[int] = []
        self._looks: Looks | None = None

    def take(self, seed: ObjectSeed) -> None:
        """Take in what somebody has said, and carry it on."""
        place = next(place for place, ground in enumerate(self._grounds) if _holds(ground.clip, seed))
        ground = self._grounds[place]
        added, removed = (_among(ground, sets) for sets in (seed.added, seed.removed))
        said, weight = added.astype(np.float64), np.full(len(added), UNSAID)
        if self._seeded:  # a correction: what it leaves out stays as it was
            said, weight = ground.values.copy(), np.full(len(added), BEFORE)
            said[added] = 1.0
        said[removed] = 0.0
        weight[added | removed] = SAID
        ground.values = belonging(ground.bonds, said, weight, ground.values)
        ground.values[added], ground.values[removed] = 1.0, 0.0
        ground.surety, ground.doubt = 1.0, ""
        self._looks = looks_of(ground.parts, ground.values)
        for step in (1, -1):
            self._carry(place, step)
        self._seeded.append(place)

    def _carry(self, origin: int, step: int) -> None:
        """From one clip on, in one direction, up to the next clip of which somebody has said something."""
        stops = [place for place in self._seeded if (place - origin) * step > 0]
        stop = min(stops, key=lambda place: abs(place - origin), default=None)
        end = (len(self._grounds) if step > 0 else -1) if stop is None else stop
        last_there = origin
        for place in range(origin + step, end, step):
            ground, before = self._grounds[place], self._grounds[place - step]
            said, surety = carried(before.parts, before.values, ground.parts)
            known = ground.values
            values = belonging(ground.bonds, said, surety, said)
            if stop is not None:  # the other seed has been here before
                near = abs(place - stop) / abs(stop - origin)
                values = near * values + (1.0 - near) * known
            ground.values, ground.doubt = values, ""
            ground.surety = self._surety(ground, surety)
            if ground.mass < LEAST_SHARE * self._grounds[last_there].mass:
                self._lose_or_regain(ground, surety)
            if ground.doubt != "gone":
                last_there = place

    def _lose_or_regain(self, ground: _Ground, surety: np.ndarray) -> None:
        """Of a clip in which little of the object was found: it has left, or something like it has come."""
        assert self._looks is not None
        found = returned(ground.parts, ground.bonds, surety, self._looks)
        if found is None:
            ground.doubt = "gone"
        else:
            ground.values, ground.surety = np.maximum(ground.values, found.is_in), found.likeness
            ground.doubt = "returning"

    @staticmethod
    def _surety(ground: _Ground, surety: np.ndarray) -> float:
        mass, values = ground.parts.mass, ground.values
        concerned = values > 0.1
        if not concerned.any():
            return 1.0
        shares = mass[concerned] / max(mass[concerned].sum(), 1e-12)
        clear = float((shares * np.abs(2 * values[concerned] - 1)).sum())
        at_border = concerned & (surety > 0)
        if not at_border.any():
            return 0.0
        matched = float((mass * surety)[at_border].sum() / max(mass[at_border].sum(), 1e-12))
        return clear * matched


# ---------------------------------------------------------------- pieces


def _holds(clip: Clip, seed: ObjectSeed) -> bool:
    return clip.start <= seed.frame_index < clip.stop


def _among(ground: _Ground, sets: tuple[PickedRows, ...]) -> np.ndarray:
    """Which parts of a clip were picked. [N] bool"""
    return ground.rows.is_picked(Picked(sets))[ground.parts.index]


def _standing_still(
    seeds: Sequence[ObjectSeed], rows: ClipRows, clips: Sequence[SearchedClip]
) -> tuple[ObjectInClip, ...]:
    """Of a selection of what stands still, which is the same in all clips; empty for others."""
    added = [one for seed in seeds for one in seed.added]
    moving = sum(len(one.rows) for one in added if one.role in ROLES)
    if not added or moving > LEAST_MOVING * sum(len(one.rows) for one in added):
        return ()
    is_meant = rows.is_picked(Picked(tuple(one for one in added if one.role not in ROLES)))
    is_meant &= ~rows.is_picked(Picked(tuple(one for seed in seeds for one in seed.removed)))
    sets = _packed(rows, np.flatnonzero(is_meant))
    return tuple(ObjectInClip(one.clip.start, one.clip.stop, sets, ((one.clip.start, one.clip.stop),)) for one in clips)


def _packed(rows: ClipRows, indices: np.ndarray) -> tuple[PickedRows, ...]:
    named = rows.named(indices)
    return tuple(
        PickedRows(row_set.clip_index, row_set.origin, row_set.role, pack_rows(named.number[named.set_index == place]))
        for place, row_set in enumerate(named.sets)
        if (named.set_index == place).any()
    )


def _result(ground: _Ground) -> ObjectInClip:
    clip, parts = ground.clip, ground.parts
    is_in = ground.values > 0.5
    if not is_in.any():
        return ObjectInClip(clip.start, clip.stop, confidence=round(ground.surety, 3), doubt=ground.doubt or "gone")
    mass = (parts.opacities[:, is_in] * parts.sizes[is_in] ** 2).sum(1)
    there = mass > SEEN_SHARE * mass.max()
    doubt = ground.doubt or ("touching" if _touching(ground, is_in) > TOUCHING else "")
    return ObjectInClip(
        clip.start,
        clip.stop,
        _packed(ground.rows, np.concatenate([parts.index[is_in], _faint(ground, is_in)])),
        _runs(parts.frames, there, clip.stop),
        round(min(max(ground.surety, 0.0), 1.0), 3),
        doubt,
    )


def _touching(ground: _Ground, is_in: np.ndarray) -> float:
    inside = ground.bonds[is_in]
    whole = inside.sum()
    return float(inside[:, ~is_in].sum() / whole) if whole > 0 else 0.0


def _faint(ground: _Ground, is_in: np.ndarray) -> np.ndarray:
    """Gaussians too faint to be followed, of anchors whose others all belong to the object. [n] int64"""
    k, parts = ground.rows.gaussians_per_anchor, ground.parts
    anchors, place = np.unique(parts.anchor, return_inverse=True)
    share = np.bincount(place, is_in) / np.bincount(place)
    whole = anchors[share > 0.5]
    every = (whole[:, None] * k + np.arange(k)).reshape(-1)
    return np.setdiff1d(every, parts.index)


def _runs(frames: Sequence[int], there: np.ndarray, stop: int) -> tuple[tuple[int, int], ...]:
    """Runs of frames in which something is there; a frame stands for all up to the next that was looked at."""
    runs: list[tuple[int, int]] = []
    for place, frame in enumerate(frames):
        after = frames[place + 1] if place + 1 < len(frames) else stop
        if not there[place]:
            continue
        if runs and runs[-1][1] == frame:
            runs[-1] = (runs[-1][0], after)
        else:
            runs.append((frame, after))
    return tuple(runs)
