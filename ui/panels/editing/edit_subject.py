"""The subject of editing in the picture: the chosen edit, or the box or sphere that the user has drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from msgspec import structs

from app.session.editing.edit_commands import ChangeEdit
from app.session.editing.selection_commands import InvertSelection
from app.session.session_view import SessionView
from engine.editing.actions import Transform, Vector
from engine.editing.edit import Edit, Prism, Sphere, Volume
from engine.editing.volumes.keyed_volume import with_volume
from engine.editing.volumes.prisms import widths_at
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


def meant(session: SessionView, ui: UiState) -> tuple[Volume | None, str]:
    """Target of a new edit: the volume that was drawn, with its words; None stands for the selection.
    No words where there is neither."""
    volume = drawn_volume(ui)
    if volume is not None:
        return volume, f"the {type(volume).__name__.lower()}"
    return None, "the selection" if session.selection.n_gaussians else ""


def pivot_of(session: SessionView, volume: Volume | None) -> Vector:
    """Where a movement turns about: the middle of the things it moves, as shown. Scene units"""
    if volume is not None:
        return _vector(middle_of(volume))
    means = _selected_means(session)
    return _vector(np.median(means, axis=0)) if len(means) else (0.0, 0.0, 0.0)


def bounds_of(session: SessionView, volume: Volume | None) -> tuple[Vector, Vector] | None:
    """The box along the axes of the scene around a volume, else around the centres of what is selected and shown; None
    where nothing is, or its box has no room in it. Scene units"""
    if volume is not None:
        reach = _reach(volume)
        low, high = middle_of(volume) - reach, middle_of(volume) + reach
    else:
        means = _selected_means(session)
        if not len(means):
            return None
        low, high = means.min(axis=0), means.max(axis=0)
    return (_vector(low), _vector(high)) if (high > low).all() else None


def _reach(volume: Volume) -> float | np.ndarray:
    """How far a volume reaches from its middle along the axes of the scene, to either side. Scene units"""
    if isinstance(volume, Sphere):
        return volume.radius
    sizes = np.array(volume.half_sizes)
    if isinstance(volume, Prism):
        sizes[:2] *= widths_at(volume, np.ones(1))  # its far end is the wider one
    return abs(axes_of(volume)) @ sizes


def _selected_means(session: SessionView) -> np.ndarray:
    """Centres of the selection, as far as it is shown. [N, 3]"""
    gaussians = session.shown_gaussians()
    if gaussians is None or gaussians.rows is None or not session.selection.n_gaussians:
        return np.zeros((0, 3))
    means = gaussians.means[session.selected(gaussians)]
    return means[np.isfinite(means).all(axis=1)]


def _vector(values: np.ndarray) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
