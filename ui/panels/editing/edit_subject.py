"""The subject of editing in the picture: the chosen edit, or the box or sphere that the user has drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from msgspec import structs

from app.session.editing.edit_commands import ChangeEdit
from app.session.editing.selection import Selection
from app.session.editing.selection_commands import InvertSelection
from app.session.session_view import SessionView
from engine.editing.actions import Transform, Vector
from engine.editing.edit import Box, Edit, ObjectTarget, Sphere
from engine.text import one_line
from ui.panels.state import Dispatch, UiState
from ui.viewport.editing.handles import Thing, axes_of, middle_of


@dataclass(frozen=True, slots=True)
class Subject:
    """A thing with handles.

    Attributes:
        thing: A box, a sphere or a movement.
        edit: The edit it belongs to; None of what the user has drawn to select.
    """

    thing: Thing
    edit: Edit | None = None

    def with_thing(self, thing: Thing, gesture: int, verb: str) -> ChangeEdit | None:
        """The command that gives the edit another one; None without an edit."""
        if self.edit is None:
            return None
        part = {"action": thing} if isinstance(thing, Transform) else {"target": thing}
        return ChangeEdit(structs.replace(self.edit, **part), gesture, verb)


def drawn_volume(ui: UiState) -> Box | Sphere | None:
    """The box or sphere that the user has drawn to select, while that tool is in use."""
    tool = ui.selecting
    return tool.volume if tool.kind in ("box", "sphere") and not tool.is_dragging else None


def invert_selection(dispatch: Dispatch, ui: UiState) -> None:
    """Select all that is not selected; of a box or sphere that was drawn, everything outside of it is meant then."""
    dispatch(InvertSelection())
    if drawn_volume(ui) is not None:
        ui.editing.is_outside = not ui.editing.is_outside


def subject_of(session: SessionView, ui: UiState) -> Subject | None:
    """The thing with handles now: the drawn one, else that of the chosen edit."""
    volume = drawn_volume(ui)
    if volume is not None:
        return Subject(volume)
    edit = session.edits.edit(ui.editing.chosen)
    thing = ui.editing.shown_thing(edit)
    return None if thing is None else Subject(thing, edit)


Meant = Box | Sphere | ObjectTarget | None
"""What a new edit acts on; None stands for the selection."""


def meant(session: SessionView, ui: UiState) -> tuple[Meant, str]:
    """Target of a new edit, with its words: the box or sphere that was drawn, else the selection, else the chosen
    object. No words where there is none of them."""
    volume = drawn_volume(ui)
    if volume is not None:
        return volume, "the box" if isinstance(volume, Box) else "the sphere"
    one = session.edits.object(ui.objects.chosen)
    if one is None or session.selection.n_gaussians:
        return None, "the selection" if session.selection.n_gaussians else ""
    return ObjectTarget(one.object_id), one_line(one.name)


def pivot_of(session: SessionView, target: Meant) -> Vector:
    """Where a movement turns about: the middle of the things it moves, as shown. Scene units"""
    if isinstance(target, Box | Sphere):
        return _vector(middle_of(target))
    means = _means(session, target)
    return _vector(np.median(means, axis=0)) if len(means) else (0.0, 0.0, 0.0)


def bounds_of(session: SessionView, target: Meant) -> tuple[Vector, Vector] | None:
    """The box along the axes of the scene around a volume, else around the centres of what is meant and shown; None
    where nothing is, or its box has no room in it. Scene units"""
    if isinstance(target, Box | Sphere):
        reach = target.radius if isinstance(target, Sphere) else abs(axes_of(target)) @ target.half_sizes
        low, high = middle_of(target) - reach, middle_of(target) + reach
    else:
        means = _means(session, target)
        if not len(means):
            return None
        low, high = means.min(axis=0), means.max(axis=0)
    return (_vector(low), _vector(high)) if (high > low).all() else None


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


def _vector(values: np.ndarray) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
