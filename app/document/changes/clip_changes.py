"""Other clips: where they are cut, and which of them the others inherit from. Documents in, documents out.

Files of clips are named by their frames (app.project.clips.clip_names), so that nothing on disk has to follow: a clip
that keeps its frames keeps its files, and those of one that is gone are there again when the change is taken back.
"""

from __future__ import annotations

from dataclasses import replace

from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from engine.capture.clip import split_clips
from engine.errors import ProjectError


def with_split(document: ProjectDocument, frame_index: int, n_frames: int) -> ProjectDocument:
    """A clip begins at this frame; the one that held it ends before.

    Args:
        n_frames: Of the capture.
    Raises:
        ProjectError: A clip begins there already, there is no such frame, or one field covers everything.
    """
    bounds = _bounds(document.settings, n_frames)
    if not 0 < frame_index < n_frames:
        raise ProjectError(f"No clip can begin at frame {frame_index}; frames are 0 to {n_frames - 1}.")
    if frame_index in bounds:
        raise ProjectError(f"A clip begins at frame {frame_index} already.", hint="Move the playhead into a clip.")
    return _with_bounds(document, tuple(sorted((*bounds, frame_index))))


def with_merge(document: ProjectDocument, clip_index: int, n_frames: int) -> ProjectDocument:
    """A clip and the one after it are one clip.

    Args:
        n_frames: Of the capture.
    Raises:
        ProjectError: There is no such clip, or none after it.
    """
    bounds = _bounds(document.settings, n_frames)
    if not 0 <= clip_index < len(bounds) - 2:
        raise ProjectError(f"There is no clip {clip_index} with another one after it to merge it with.")
    return _with_bounds(document, (*bounds[: clip_index + 1], *bounds[clip_index + 2 :]))


def with_reference(document: ProjectDocument, clip_index: int, n_frames: int) -> ProjectDocument:
    """The other clips inherit from this one.

    Args:
        n_frames: Of the capture.
    Raises:
        ProjectError: There is no such clip.
    """
    n_clips = len(document.settings.clips(n_frames))
    if not 0 <= clip_index < n_clips:
        raise ProjectError(f"There is no clip {clip_index}; clips are 0 to {n_clips - 1}.")
    return replace(document, settings=replace(document.settings, reference_clip=clip_index))


def _bounds(settings: ProjectSettings, n_frames: int) -> tuple[int, ...]:
    if settings.config().field == "joint":
        raise ProjectError("One field covers all frames of this project; there are no clips to split or merge.")
    return (*tuple(clip.start for clip in settings.clips(n_frames)), n_frames)


def _with_bounds(document: ProjectDocument, bounds: tuple[int, ...]) -> ProjectDocument:
    """The reference stays the clip with the frame with which it begins now."""
    settings, n_frames = document.settings, bounds[-1]
    first_frame = settings.clips(n_frames)[settings.reference_clip].start
    reference = max(index for index, start in enumerate(bounds[:-1]) if start <= first_frame)
    regular = [clip.start for clip in split_clips(n_frames, settings.clip_length)]
    kept = None if list(bounds[:-1]) == regular else bounds
    return replace(document, settings=replace(settings, clip_bounds=kept, reference_clip=reference))
