"""Copies of objects in the making. State of the window; no ImGui, no GL."""

from __future__ import annotations

from dataclasses import dataclass

from app.session.edit_status import EditsStatus
from engine.editing.copies.object_copy import ObjectCopy
from engine.editing.scene_object import SceneObject


@dataclass(eq=False)
class CopyTool:
    """What the section of copies holds between frames.

    Attributes:
        object_id: Of the object that is copied next; None for the first one.
        chosen: Number of the copy whose details are shown; None without one.
        n_across, n_along: How many stand in a row of a crowd, and how many rows; the object counts.
        spacing: From one to the next in a crowd, in widths of the object.
        step_frames: So much later is each of a crowd than the one before.
    """

    object_id: int | None = None
    chosen: int | None = None
    n_across: int = 3
    n_along: int = 3
    spacing: float = 1.5
    step_frames: float = 4.0

    def object(self, edits: EditsStatus) -> SceneObject | None:
        """The object that is copied next; None where there are none."""
        return edits.object(self.object_id) or next(iter(edits.objects), None)

    def copy(self, edits: EditsStatus) -> ObjectCopy | None:
        """The chosen copy; None without one."""
        return next((copy for copy in edits.copies if copy.copy_id == self.chosen), None)
