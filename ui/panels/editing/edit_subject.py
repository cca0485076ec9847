"""The subject of editing in the picture: the chosen edit, or the box or sphere that the user has drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from msgspec import structs

from app.session.editing.edit_commands import ChangeEdit
from app.session.editing.selection import Selection
from app.session.editing.selection_commands import InvertSelection
from app.session.session_view import SessionView
from engine.editing.actions import Transform, Vector, vector_of
from engine.editing.edit import Edit, ObjectTarget, Prism, Sphere, Volume
from engine.editing.volumes.keyed_volume import with_volume
from engine.editing.volumes.prisms import widths_at
from engine.text import one_line
from ui.panels.state import Dispatch, UiState
from ui.viewport.editing.handles import Thing, axes_of, middle_of
from ui.viewport.editing.select_tool import VOLUME_TOOLS


@dataclass(frozen=True, slots=True)
class Subject:
    """A thing with handles.

    Attributes:
        thing: A volume or a movement.
        edit: The edit it belongs to; None of what the user has drawn to select.
        frame: The shown frame: a keyed volume that is changed gets a key there.
    """

    thing: Thing
    edit: Edit | None = None
    frame: int = 0

    def with_thing(self, thing: Thing, gesture: int, verb: str) -> ChangeEdit | None:
        """The command that gives the edit another one; None without an edit."""
        if self.edit is None:
            return None
        if isinstance(thing, Transform):
            return ChangeEdit(structs.replace(self.edit, action=thing), gesture, verb)
        target = with_volume(self.edit.target, self.frame, thing)
        return ChangeEdit(structs.replace(self.edit, target=target), gesture, verb)


def drawn_volume(ui: UiState) -> Volume | None:
    """The volume that the user has drawn to select, while that tool is in use."""
    tool = ui.selecting
    return tool.volume if tool.kind in VOLUME_TOOLS and not tool.is_dragging else None


def invert_selection(dispatch: Dispatch, ui: UiState) -> None:
    """Select all that is not selected; of a volume that was drawn, everything outside of it is meant then."""
    dispatch(InvertSelection())
    if drawn_volume(ui) is not None:
        ui.editing.is_outside = not ui.editing.is_outside


def subject_of(session: SessionView, ui: UiState) -> Subject | None:
    """The thing with handles now: the drawn one, else that of the chosen edit."""
    volume = drawn_volume(ui)
    if volume is not None:
        return Subject(volume)
    edit = session.edits.edit(ui.editing.chosen)
    frame = session.timeline.frame_index
    thing = ui.editing.shown_thing(edit, frame)
    return None if thing is None else Subject(thing, edit, frame)


Meant = Volume | ObjectTarget | None
"""What a new edit acts on; None stands for the selection."""


def meant(session: SessionView, ui: UiState) -> tuple[Meant, str]:
    """Target of a new edit, with its words: the volume that was drawn, else the selection, else the chosen object. No
    words where there is none of them."""
    volume = drawn_volume(ui)
    if volume is not None:
        return volume, f"the {type(volume).__name__.lower()}"
    one = session.edits.object(ui.objects.chosen)
    if one is None or session.selection.n_gaussians:
        return None, "the selection" if session.selection.n_gaussians else ""
    return ObjectTarget(one.object_id), one_line(one.name)


def pivot_of(session: SessionView, target: Meant) -> Vector:
    """Where a movement turns about: the middle of the things it moves, as shown. Scene units"""
    if isinstance(target, Volume):
        return vector_of(middle_of(target))
    means = _means(session, target)
    return vector_of(np.median(means, axis=0)) if len(means) else (0.0, 0.0, 0.0)


def bounds_of(session: SessionView, target: Meant) -> tuple[Vector, Vector] | None:
    """The box along the axes of the scene around a volume, else around the centres of what is meant and shown; None
    where nothing is, or its box has no room in it. Scene units"""
    if isinstance(target, Volume):
        reach = _reach(target)
        low, high = middle_of(target) - reach, middle_of(target) + reach
    else:
        means = _means(session, target)
        if not len(means):
            return None
        low, high = means.min(axis=0), means.max(axis=0)
    return (vector_of(low), vector_of(high)) if (high > low).all() else None


def _reach(volume: Volume) -> float | np.ndarray:
    """How far a volume reaches from its middle along the axes of the scene, to either side. Scene units"""
    if isinstance(volume, Sphere):
        return volume.radius
    sizes = np.array(volume.half_sizes)
    if isinstance(volume, Prism):
        sizes[:2] *= widths_at(volume, np.ones(1))  # its far end is the wider one
    return abs(axes_of(volume)) @ sizes


def _means(session: SessionView, target: ObjectTarget | None) -> np.ndarray:
    """Centres of the selection or of an object, as far as it is shown. [N, 3]"""
    gaussians = session.shown_gaussians()
    if gaussians is None or gaussians.rows is None or (target is None and not session.selection.n_gaussians):
        return np.zeros((0, 3))
    one = None if target is None else session.edits.object(target.object_id)
    if one is None:
        is_meant = session.selected(gaussians)
    else:
        is_meant = Selection.of_target(one.picked(session.timeline.frame_index)).mask(gaussians.rows)
    means = gaussians.means[is_meant]
    return means[np.isfinite(means).all(axis=1)]
