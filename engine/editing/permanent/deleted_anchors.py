"""Which anchors of a clip the edits of a document delete in every frame in which they exist.

Edits act on each Gaussian by itself. So a Gaussian that is deleted wherever it exists can be left out of the clip, and
nothing else changes, however the other edits stand.
"""

from __future__ import annotations

import numpy as np

from engine.editing.actions import Delete, Hide
from engine.editing.edit import Edit
from engine.editing.edited_clip import EditedClip
from engine.editing.effects import EditStack, Effects
from engine.editing.scene_object import NO_OBJECTS, Objects


def deleted_anchors(clip: EditedClip, edits: tuple[Edit, ...], objects: Objects = NO_OBJECTS) -> dict[str, np.ndarray]:
    """Anchors all of whose Gaussians are deleted in all frames of the clip in which they exist, by role.

    What is only hidden counts as if it were seen: it is to come back when the edit that hides it is switched off. An
    anchor that stands still in another frame (Hold) or is spread over frames (Smooth) has to be deleted there, too.

    Args:
        clip: All of it.
        edits: The stack.
        objects: Of the document.
    Returns:
        By rows of the set. [A] bool
    Raises:
        ProjectError: An edit is damaged.
    """
    rows = clip.rows
    is_needed, is_deleted = np.zeros(rows.n, bool), np.zeros(rows.n, bool)
    stack = EditStack(tuple(edit for edit in edits if not isinstance(edit.action, Hide)), objects)
    for frame in clip.clip.frame_indices():
        deleted, left = _deleted_and_left(clip, frame, stack.at(frame))
        exists = _flags(clip, frame, Effects())
        is_needed |= left | (exists & ~deleted)
        is_deleted |= deleted
    found = {}
    for role in clip.model.roles():
        indices = rows.indices(role, np.arange(len(clip.model.anchor_set(role))))
        by_anchor = indices.reshape(-1, clip.model.decoder.gaussians_per_anchor)
        found[role] = is_deleted[by_anchor].any(1) & ~is_needed[by_anchor].any(1)
    return found


def deletes_something(clip: EditedClip, edits: tuple[Edit, ...], edit: Edit, objects: Objects = NO_OBJECTS) -> bool:
    """Whether an edit of the stack still deletes a Gaussian in some frame of a clip, hidden ones included."""
    rest = tuple(one for one in edits if not isinstance(one.action, Hide))
    before = rest[: rest.index(edit)]
    for frame in clip.clip.frame_indices():
        if not (edit.is_on and edit.scope.holds_at(frame)):
            continue
        without = EditStack(before, objects).at(frame)
        then = Effects.made((*without.all, *EditStack((edit,), objects).at(frame).all))
        if (_flags(clip, frame, without) != _flags(clip, frame, then)).any():
            return True
    return False


def _deleted_and_left(clip: EditedClip, frame: int, effects: Effects) -> tuple[np.ndarray, np.ndarray]:
    """Gaussians that one of the effects deletes at a frame, and those that are left after all of them. [n] bool each"""
    deleted = np.zeros(clip.rows.n, bool)
    for number, effect in enumerate(effects.all):
        if isinstance(effect.action, Delete):
            before = _flags(clip, frame, Effects.made(effects.all[:number]))
            deleted |= before & ~_flags(clip, frame, Effects.made(effects.all[: number + 1]))
    return deleted, _flags(clip, frame, effects)


def _flags(clip: EditedClip, frame: int, effects: Effects) -> np.ndarray:
    """Which Gaussians there are at a frame. [n] bool"""
    flags = np.zeros(clip.rows.n, bool)
    flags[clip.rows.indices_of(clip.decode(clip.clip.clip_time(frame), effects).rows)] = True
    return flags
