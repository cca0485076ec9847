"""Picks that no longer stand for anything: their clip was trained anew since, so that its anchors are others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from engine.editing.edit import Edit, Picked


@dataclass(frozen=True, slots=True)
class LostPicks:
    """An edit that does nothing in some clips, because its picks there are gone.

    Attributes:
        edit_id: Of the edit.
        clip_indices: The clips, as they were numbered when somebody picked.
        is_all: Whether nothing of what was picked is left, so that the edit does nothing at all.
    """

    edit_id: int
    clip_indices: tuple[int, ...]
    is_all: bool


def lost_picks(edits: tuple[Edit, ...], origins: Mapping[int, str]) -> tuple[LostPicks, ...]:
    """Edits with picks that match no clip as it is now.

    Args:
        origins: Of the finished clips, by index; see ClipHeader.origin.
    """
    known, found = set(origins.values()), []
    for edit in edits:
        if not isinstance(edit.target, Picked):
            continue
        matching = {(one.clip_index, one.role) for one in edit.target.sets if one.origin in known}
        lost = {
            one.clip_index
            for one in edit.target.sets
            # the same anchors may be named as they were and as they are, see engine.editing.permanent.renumbering
            if one.origin not in known and (one.clip_index, one.role) not in matching
        }
        if lost:
            found.append(LostPicks(edit.edit_id, tuple(sorted(lost)), is_all=not matching))
    return tuple(found)
