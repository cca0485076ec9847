"""Excluding: carries out commands that exclude parts of the capture, on the document of the open project."""

from __future__ import annotations

from collections.abc import Sequence

from app.document.changes.exclusion_changes import (
    with_cameras_excluded,
    with_frames_excluded,
    with_stroke,
    without_masks,
)
from app.document.project_document import ProjectDocument
from app.session.editing.kept_document import KeptDocument
from app.session.exclusions.exclusion_commands import (
    ExcludeCameras,
    ExcludeFrames,
    ExclusionCommand,
    PaintMask,
    RemoveMasks,
)


def apply_exclusion(
    command: ExclusionCommand, document: KeptDocument, camera_names: Sequence[str], n_frames: int
) -> None:
    """Carry out a command as one step of the history.

    Args:
        camera_names, n_frames: Of the open capture.
    Raises:
        ProjectError: It cannot be done; states the cause.
    """
    before = document.checked().document
    after = excluded_document(before, command, camera_names, n_frames)
    if after != before:
        document.change(after, exclusion_words(command, camera_names))


def excluded_document(
    document: ProjectDocument, command: ExclusionCommand, camera_names: Sequence[str], n_frames: int
) -> ProjectDocument:
    """The document as the command wants it.

    Raises:
        ProjectError: That cannot be.
    """
    match command:
        case ExcludeCameras(camera_indices=indices, is_excluded=is_excluded):
            names = [_name(camera_names, index) for index in indices]
            return with_cameras_excluded(document, names, camera_names, is_excluded=is_excluded)
        case ExcludeFrames(first=first, stop=stop, camera_index=index, is_excluded=is_excluded):
            return with_frames_excluded(
                document,
                first,
                stop,
                camera=None if index is None else _name(camera_names, index),
                camera_names=camera_names,
                n_frames=n_frames,
                is_excluded=is_excluded,
            )
        case PaintMask(camera_index=index, first=first, stop=stop, stroke=stroke):
            name = _name(camera_names, index)
            return with_stroke(
                document, stroke, camera=name, first=first, stop=stop, camera_names=camera_names, n_frames=n_frames
            )
        case RemoveMasks(camera_index=index, frame_index=frame):
            return without_masks(document, camera=_name(camera_names, index), frame=frame)


def exclusion_words(command: ExclusionCommand, camera_names: Sequence[str]) -> str:
    """The command as words that can follow "Undo"."""
    match command:
        case ExcludeCameras(camera_indices=indices, is_excluded=is_excluded):
            what = f"camera {_name(camera_names, indices[0])}" if len(indices) == 1 else f"{len(indices)} cameras"
            return f"{'exclude' if is_excluded else 'include'} {what}"
        case ExcludeFrames(first=first, stop=stop, is_excluded=is_excluded):
            what = f"frame {first}" if stop == first + 1 else f"frames {first} to {stop - 1}"
            return f"{'exclude' if is_excluded else 'include'} {what}"
        case PaintMask(stroke=stroke):
            return "erase from a mask" if stroke.is_erasing else "paint a mask"
        case RemoveMasks():
            return "remove painted masks"


def _name(camera_names: Sequence[str], index: int) -> str:
    return camera_names[index] if 0 <= index < len(camera_names) else f"number {index}"
