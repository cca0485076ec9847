"""New copies of an object, where they are seen at once: buttons and actions run these."""

from __future__ import annotations

from app.session.duplicating.copy_commands import DuplicateObject, MakeCrowd
from app.session.duplicating.placing import ObjectPlace, place_of
from app.session.session_view import SessionView
from engine.editing.actions import Transform, Vector, vector_of
from engine.editing.copies.object_copy import ObjectCopy, span_of
from engine.editing.scene_object import SceneObject
from ui.panels.state import Dispatch, UiState

GAP = 1.1
"""From an object to its copy, in widths of the object."""
FASTER = 2.0
"""The first speed of an object that gets one of its own."""


def duplicate(session: SessionView, dispatch: Dispatch, ui: UiState, found: SceneObject) -> None:
    """A copy next to an object, in the picture to its right."""
    place = _place(session, found)
    by = (0.0, 0.0, 0.0) if place is None else vector_of(GAP * place.widths[0] * place.axes[0])
    _make(session, dispatch, ui, DuplicateObject(_copy(session, found, by, place)))


def give_speed(session: SessionView, dispatch: Dispatch, ui: UiState, found: SceneObject) -> None:
    """A faster copy in the place of an object."""
    first, _ = span_of(found) or (0, 1)
    copy = ObjectCopy(
        0, f"{found.name} faster", found.object_id, speed=FASTER, anchor_frame=float(first), is_in_place=True
    )
    _make(session, dispatch, ui, DuplicateObject(copy))


def make_crowd(session: SessionView, dispatch: Dispatch, ui: UiState, found: SceneObject) -> None:
    """Rows of copies, to the right of an object and behind it."""
    place, tool = _place(session, found), ui.copies
    if place is None:
        steps: list[Vector] = [(tool.spacing, 0.0, 0.0), (0.0, 0.0, tool.spacing)]
    else:
        width = tool.spacing * float(place.widths.max())
        steps = [vector_of(width * axis) for axis in place.axes]
    copy = _copy(session, found, (0.0, 0.0, 0.0), place)
    crowd = MakeCrowd(copy, tool.n_across, tool.n_along, steps[0], steps[1], tool.step_frames)
    _make(session, dispatch, ui, crowd)


def _make(session: SessionView, dispatch: Dispatch, ui: UiState, command: DuplicateObject | MakeCrowd) -> None:
    known = {copy.copy_id for copy in session.edits.copies}
    dispatch(command)
    ui.copies.chosen = next((copy.copy_id for copy in session.edits.copies if copy.copy_id not in known), None)


def _copy(session: SessionView, found: SceneObject, by: Vector, place: ObjectPlace | None) -> ObjectCopy:
    pivot = (0.0, 0.0, 0.0) if place is None else vector_of(place.middle)
    anchor = float(session.timeline.frame_index)
    return ObjectCopy(0, "", found.object_id, Transform(by, pivot=pivot), anchor_frame=anchor)


def _place(session: SessionView, found: SceneObject) -> ObjectPlace | None:
    gaussians, view = session.shown_gaussians(), session.view
    source = None if gaussians is None else gaussians.source.frame_index
    frame = session.timeline.frame_index if source is None else source
    return place_of(gaussians, found, frame, view.pose().rotation, view.up)
