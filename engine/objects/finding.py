"""Finding an object in all clips, from what somebody has said of it in one frame or a few.

From the clip of a seed it is carried to the clips before and after, one after the other: the parts of a clip that lie
where the object was at the border are known, and bonds within the clip decide for the rest. A correction is carried on
from its own clip, in both directions up to the next seed; between two seeds each counts the more the nearer it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from engine.capture.clip import Clip
from engine.editing.clip_rows import ClipRows
from engine.editing.edit import Picked, PickedRows
from engine.editing.edited_clip import EditedClip
from engine.editing.picks import pack_rows
from engine.editing.scene_object import ObjectInClip, ObjectSeed, SceneObject
from engine.editing.selection.projected import project_gaussians
from engine.editing.selection.visibility import seen_rows
from engine.model.host_array import host_array
from engine.objects.moving_parts import ROLES, MovingParts, moving_parts
from engine.objects.search import ObjectSearch, SearchGround

LEAST_MOVING = 0.15
"""A selection of which less than this share travels is of something that stands still: the same in all clips."""
SEEN_SHARE = 0.1
"""In frames with less of its mass than this share of the most, an object is not there."""
TOUCHING = 0.02
"""Share of an object's bonds that lead to something else, from which on it touches that."""
Report = Callable[[int, int], None]
"""Told how many clips are done, of how many; its exceptions end the search."""


_Said = tuple[int, np.ndarray, np.ndarray, np.ndarray | None]
"""The place of a seed's clip among all, and its Gaussians that belong to the object, that do not, that were seen."""


@dataclass(frozen=True, slots=True)
class SearchedClip:
    """A trained clip, and how to load it."""

    clip: Clip
    load: Callable[[], EditedClip]


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
    grounds: list[SearchGround] = []
    rows: list[ClipRows] = []
    said: dict[ObjectSeed, _Said] = {}
    for number, found in enumerate(clips):
        report(number, len(clips))
        edited = found.load()
        grounds.append(SearchGround(moving_parts(edited)))
        rows.append(edited.rows)
        for seed in seeded:
            if _holds(found.clip, seed):
                said[seed] = number, *_said(edited, seed)
    if still := _standing_still(seeded, said, rows, clips):
        return still
    search = ObjectSearch(grounds)
    for seed in seeded:
        place, added, removed, seen = said[seed]
        index = grounds[place].parts.index
        search.take(place, seed.frame_index, added[index], removed[index], None if seen is None else seen[index])
    report(len(clips), len(clips))
    results = []
    for place, (of, ground) in enumerate(zip(rows, grounds, strict=True)):
        results.append(_result(of, ground, [flags[1:3] for flags in said.values() if flags[0] == place]))
    return tuple(results)


# ---------------------------------------------------------------- pieces


def _holds(clip: Clip, seed: ObjectSeed) -> bool:
    return clip.start <= seed.frame_index < clip.stop


def _said(edited: EditedClip, seed: ObjectSeed) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Which Gaussians of a clip were meant, of those that were added and removed, and which could be seen where that is
    known. [n] bool each"""
    added, removed = (edited.rows.is_picked(Picked(sets)) for sets in (seed.added, seed.removed))
    if seed.view is None:
        return added, removed, None
    found = edited.decode(edited.clip.clip_time(seed.frame_index))
    gaussians, view = found.gaussians, seed.view.view()
    means, quats, scales, opacities = map(
        host_array, (gaussians.means, gaussians.quats, gaussians.scales, gaussians.opacities)
    )
    is_seen = np.zeros(edited.rows.n, bool)
    is_seen[edited.rows.indices_of(found.rows)] = seen_rows(project_gaussians(means, quats, scales, view), opacities)
    if not ((added | removed) & is_seen).any():  # selected through something, as through a wall
        return added, removed, None
    return added & is_seen, removed & is_seen, is_seen


def _standing_still(
    seeds: Sequence[ObjectSeed],
    said: dict[ObjectSeed, _Said],
    rows: Sequence[ClipRows],
    clips: Sequence[SearchedClip],
) -> tuple[ObjectInClip, ...]:
    """Of a selection of what stands still, which is the same in all clips; empty for others."""
    place, added, *_ = said[seeds[0]]
    moves = np.array([one.role in ROLES for one in rows[place].sets])[rows[place].set_of]
    if not added.any() or (added & moves).sum() > LEAST_MOVING * added.sum():
        return ()
    still = tuple(one for seed in seeds for one in seed.added if one.role not in ROLES)
    is_meant = rows[place].is_picked(Picked(still)) & ~moves
    is_meant &= ~rows[place].is_picked(Picked(tuple(one for seed in seeds for one in seed.removed)))
    sets = _packed(rows[place], np.flatnonzero(is_meant))
    return tuple(ObjectInClip(one.clip.start, one.clip.stop, sets, ((one.clip.start, one.clip.stop),)) for one in clips)


def _packed(rows: ClipRows, indices: np.ndarray) -> tuple[PickedRows, ...]:
    named = rows.named(indices)
    return tuple(
        PickedRows(row_set.clip_index, row_set.origin, row_set.role, pack_rows(named.number[named.set_index == place]))
        for place, row_set in enumerate(named.sets)
        if (named.set_index == place).any()
    )


def _result(rows: ClipRows, ground: SearchGround, said: Sequence[tuple[np.ndarray, np.ndarray]]) -> ObjectInClip:
    """What was found in a clip. said: Gaussians of it that somebody has added and removed."""
    parts = ground.parts
    is_in = ground.values > 0.5
    if not is_in.any():
        return ObjectInClip(parts.start, parts.stop, confidence=round(ground.surety, 3), doubt=ground.doubt or "gone")
    mass = (parts.opacities[:, is_in] * parts.sizes[is_in] ** 2).sum(1)
    there = mass > SEEN_SHARE * mass.max()
    doubt = ground.doubt or ("touching" if _touching(ground, is_in) > TOUCHING else "")
    return ObjectInClip(
        parts.start,
        parts.stop,
        _packed(rows, np.concatenate([parts.index[is_in], _faint(rows, parts, is_in, said)])),
        _runs(parts.frames, there, parts.stop),
        round(min(max(ground.surety, 0.0), 1.0), 3),
        doubt,
    )


def _touching(ground: SearchGround, is_in: np.ndarray) -> float:
    inside = ground.bonds[is_in]
    whole = inside.sum()
    return float(inside[:, ~is_in].sum() / whole) if whole > 0 else 0.0


def _faint(
    rows: ClipRows, parts: MovingParts, is_in: np.ndarray, said: Sequence[tuple[np.ndarray, np.ndarray]]
) -> np.ndarray:
    """Gaussians too faint to be followed: of anchors that mostly belong to the object, and as was said. [n] int64"""
    k = rows.gaussians_per_anchor
    anchors, place = np.unique(parts.anchor, return_inverse=True)
    share = np.bincount(place, is_in) / np.bincount(place)
    whole = anchors[share > 0.5]
    chosen = np.zeros(rows.n, bool)
    chosen[(whole[:, None] * k + np.arange(k)).reshape(-1)] = True
    moves = np.array([one.role in ROLES for one in rows.sets])[rows.set_of]
    for added, removed in said:
        chosen = (chosen | (added & moves)) & ~removed
    chosen[parts.index] = False
    return np.flatnonzero(chosen)


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
