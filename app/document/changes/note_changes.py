"""Changes to the markers and labels of a document: functions from one document to another."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from app.document.checked_text import checked_text
from app.document.project_document import Label, Marker, ProjectDocument
from engine.errors import ProjectError

MAX_MARKERS = 1000
"""More are not taken: a list that long is no longer for finding anything."""
MAX_FRAME = 2**31 - 1
LabelKind = Literal["clip", "camera"]


def put_marker(document: ProjectDocument, frame_index: int, text: str = "") -> ProjectDocument:
    """Mark a frame, or give its marker another name.

    Raises:
        ProjectError: The frame or the name cannot be, or there are too many markers.
    """
    if not 0 <= frame_index <= MAX_FRAME:
        raise ProjectError(f"There is no frame {frame_index} to mark.")
    others = tuple(marker for marker in document.markers if marker.frame_index != frame_index)
    if len(others) >= MAX_MARKERS:
        raise ProjectError(f"There are {len(others)} markers, which is the limit.", hint="Remove some first.")
    marker = Marker(frame_index, checked_text(text))
    return replace(document, markers=tuple(sorted((*others, marker), key=lambda one: one.frame_index)))


def remove_marker(document: ProjectDocument, frame_index: int) -> ProjectDocument:
    """Forget the marker of a frame.

    Raises:
        ProjectError: It has none.
    """
    gone = _marker_at(document, frame_index)
    return replace(document, markers=tuple(marker for marker in document.markers if marker is not gone))


def move_marker(document: ProjectDocument, frame_index: int, to_frame: int) -> ProjectDocument:
    """Bring the marker of a frame to another one, which has none yet.

    Raises:
        ProjectError: The frame has no marker, or the other one has, or cannot be.
    """
    moved = _marker_at(document, frame_index)
    if to_frame == frame_index:
        return document
    if any(marker.frame_index == to_frame for marker in document.markers):
        raise ProjectError(f"Frame {to_frame} has a marker already.")
    return put_marker(remove_marker(document, frame_index), to_frame, moved.text)


def set_label(document: ProjectDocument, kind: LabelKind, name: str, text: str) -> ProjectDocument:
    """Give a clip or a camera a name of the user's own; an empty one takes it away.

    Args:
        name: See Label.
    Raises:
        ProjectError: The name cannot be kept.
    """
    others = tuple(label for label in document.labels if (label.kind, label.name) != (kind, name))
    text = checked_text(text.strip())
    labels = (*others, Label(kind, checked_text(name), text)) if text else others
    return replace(document, labels=tuple(sorted(labels, key=lambda one: (one.kind, one.name))))


def _marker_at(document: ProjectDocument, frame_index: int) -> Marker:
    for marker in document.markers:
        if marker.frame_index == frame_index:
            return marker
    raise ProjectError(f"Frame {frame_index} has no marker.")
