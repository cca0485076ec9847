"""Changes of time as the window asks for them."""

from __future__ import annotations

from app.document.changes.timing_changes import ChangeSegment, TimeEdit, timing_changed
from app.session.editing.kept_document import KeptDocument


def apply_time_edit(edit: TimeEdit, document: KeptDocument, n_frames: int) -> None:
    """Carry out a change as one step of the history; the moves of one drag are one step.

    Args:
        n_frames: Of the open capture.
    Raises:
        ProjectError: It cannot be done; states the cause.
    """
    before = document.checked().document
    after = timing_changed(before, edit, n_frames)
    if after != before:
        gesture = edit.gesture if isinstance(edit, ChangeSegment) else 0
        document.change(after, edit.title, ("timing", gesture) if gesture else None)
