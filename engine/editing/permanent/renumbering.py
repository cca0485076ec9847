"""Picks of clips that have lost anchors: the same Gaussians under the numbers that they have now."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from engine.editing.edit import Edit, Picked, PickedRows
from engine.editing.fills.fill import fill_key, fits
from engine.editing.picks import pack_rows, unpack_rows
from engine.editing.scene_object import Objects, SceneObject


@dataclass(frozen=True, slots=True, eq=False)
class Renumbered:
    """An anchor set that has lost anchors.

    Attributes:
        origin: Fingerprint that its clip has now.
        is_kept: Which of its anchors are left. [A] bool
        k: Gaussians per anchor.
    """

    origin: str
    is_kept: np.ndarray
    k: int

    def numbers(self, numbers: np.ndarray) -> np.ndarray:
        """New numbers of those Gaussians that are left. [n] int64"""
        anchors, among_k = np.divmod(numbers, self.k)
        is_there = anchors < len(self.is_kept)
        anchors, among_k = anchors[is_there], among_k[is_there]
        places = np.cumsum(self.is_kept) - 1
        is_left = self.is_kept[anchors]
        return places[anchors[is_left]] * self.k + among_k[is_left]


def with_new_numbers(edits: tuple[Edit, ...], sets: Mapping[tuple[str, str], Renumbered]) -> tuple[Edit, ...]:
    """Edits that hold for clips as they are now, and as before where a version of a clip is brought back.

    Args:
        sets: By the origin that they had, and their role.
    Raises:
        ValueError: The numbers of picks are damaged.
    """
    return tuple(_renumbered(edit, sets) for edit in edits)


def _renumbered(edit: Edit, sets: Mapping[tuple[str, str], Renumbered]) -> Edit:
    now, fill = edit, edit.fill
    if isinstance(edit.target, Picked):
        picked = _with_new_sets(edit.target.sets, sets)
        now = edit if picked is edit.target.sets else replace(edit, target=Picked(picked))
    if fill is None or not fits(edit):
        return now
    traces = _with_new_sets(fill.traces, sets)
    return replace(now, fill=replace(fill, made_for=fill_key(now), traces=traces))


def objects_with_new_numbers(objects: Objects, sets: Mapping[tuple[str, str], Renumbered]) -> Objects:
    """Likewise objects: they need not be looked for again in the clips as they are now. Raises ValueError."""
    origins = {origin: now.origin for (origin, _), now in sets.items()}
    return tuple(_renumbered_object(one, sets, origins) for one in objects)


def _renumbered_object(
    one: SceneObject, sets: Mapping[tuple[str, str], Renumbered], origins: Mapping[str, str]
) -> SceneObject:
    seeds = tuple(
        replace(seed, added=_with_new_sets(seed.added, sets), removed=_with_new_sets(seed.removed, sets))
        for seed in one.seeds
    )
    clips = tuple(
        replace(clip, sets=_with_new_sets(clip.sets, sets), origin=origins.get(clip.origin, clip.origin))
        for clip in one.clips
    )
    return replace(one, seeds=seeds, clips=clips)


def _with_new_sets(
    picked: tuple[PickedRows, ...], sets: Mapping[tuple[str, str], Renumbered]
) -> tuple[PickedRows, ...]:
    """Picks, and the same under their new numbers; the same object where there are none."""
    known = {(one.origin, one.role) for one in picked}
    added: list[PickedRows] = []
    for one in picked:
        now = sets.get((one.origin, one.role))
        if now is not None and (now.origin, one.role) not in known:
            added.append(
                PickedRows(one.clip_index, now.origin, one.role, pack_rows(now.numbers(unpack_rows(one.rows))))
            )
    return (*picked, *added) if added else picked
