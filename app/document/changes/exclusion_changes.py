"""Changes to the exclusions: cameras, pictures and painted parts of pictures. Documents in, documents out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from app.document.project_document import ProjectDocument
from engine.capture.exclusions import ExcludedFrames, Exclusions, PaintedMask, Stroke
from engine.errors import ProjectError

MIN_TRAINING_CAMERAS = 2
MAX_POINTS = 500_000
"""Of all strokes together; the project file then has some 20 MB."""


def with_cameras_excluded(
    document: ProjectDocument, names: Sequence[str], camera_names: Sequence[str], *, is_excluded: bool = True
) -> ProjectDocument:
    """Cameras are left out altogether, or take part again.

    Args:
        names: Which.
        camera_names: Of the whole capture.
    Raises:
        ProjectError: There is no such camera, or too few are left.
    """
    _check_names(names, camera_names)
    kept = [name for name in document.exclusions.cameras if name not in names]
    excluded = tuple(name for name in camera_names if name in kept or (is_excluded and name in names))
    n_left = len(set(camera_names) - set(document.settings.holdout) - set(excluded))
    if is_excluded and n_left < MIN_TRAINING_CAMERAS:
        raise ProjectError(
            f"This leaves {n_left} cameras for training; {MIN_TRAINING_CAMERAS} are needed.",
            hint="Hold out fewer cameras, or exclude fewer.",
        )
    return _with(document, lambda one: Exclusions(excluded, one.frames, one.masks))


def with_frames_excluded(
    document: ProjectDocument,
    first: int,
    stop: int,
    *,
    camera: str | None,
    camera_names: Sequence[str],
    n_frames: int,
    is_excluded: bool = True,
) -> ProjectDocument:
    """Pictures are left out, or take part again.

    Args:
        first, stop: Frames [first, stop).
        camera: Of this camera; None for all. Frames that all cameras leave out cannot take part again for one.
        camera_names, n_frames: Of the whole capture.
    Raises:
        ProjectError: There is no such camera or frame.
    """
    if camera is not None:
        _check_names((camera,), camera_names)
    _check_frames(first, stop, n_frames)
    old = [one for one in document.exclusions.frames if one.camera == camera or (camera is None and not is_excluded)]
    rest = [one for one in document.exclusions.frames if one not in old]
    if is_excluded:
        spans = _joined([*((one.first, one.stop) for one in old), (first, stop)])
        changed = [ExcludedFrames(camera, *span) for span in spans]
    else:
        changed = [
            ExcludedFrames(one.camera, *part) for one in old for part in _cut((one.first, one.stop), (first, stop))
        ]
    order = {name: place for place, name in enumerate((None, *camera_names))}
    frames = sorted([*rest, *changed], key=lambda one: (order.get(one.camera, len(order)), one.first))
    return _with(document, lambda one: Exclusions(one.cameras, tuple(frames), one.masks))


def with_stroke(
    document: ProjectDocument,
    stroke: Stroke,
    *,
    camera: str,
    first: int,
    stop: int,
    camera_names: Sequence[str],
    n_frames: int,
) -> ProjectDocument:
    """Something is painted over pictures of a camera, or erased again. Strokes of the same frames are one mask, and one
    that erases acts on that alone.

    Raises:
        ProjectError: There is no such camera or frame, or there are too many points.
    """
    _check_names((camera,), camera_names)
    _check_frames(first, stop, n_frames)
    masks = list(document.exclusions.masks)
    n_points = sum(len(one.points) for mask in masks for one in mask.strokes) + len(stroke.points)
    if n_points > MAX_POINTS:
        raise ProjectError(
            f"The painted masks have {n_points} points; {MAX_POINTS} are kept.",
            hint="Remove masks that are not needed.",
        )
    known = next((i for i, one in enumerate(masks) if (one.camera, one.first, one.stop) == (camera, first, stop)), None)
    if known is None:
        if stroke.is_erasing:
            raise ProjectError("There is nothing to erase.", hint="Check the frames it is for.")
        masks.append(PaintedMask(camera, first, stop, (stroke,)))
    else:
        masks[known] = PaintedMask(camera, first, stop, (*masks[known].strokes, stroke))
    return _with(document, lambda one: Exclusions(one.cameras, one.frames, tuple(masks)))


def without_masks(document: ProjectDocument, *, camera: str | None = None, frame: int | None = None) -> ProjectDocument:
    """Painted masks are removed.

    Args:
        camera: Only of this camera; None for all.
        frame: Only those that cover this frame; None for all.
    """
    kept = tuple(
        one
        for one in document.exclusions.masks
        if (camera is not None and one.camera != camera) or (frame is not None and not one.first <= frame < one.stop)
    )
    return _with(document, lambda one: Exclusions(one.cameras, one.frames, kept))


def without_exclusions(document: ProjectDocument) -> ProjectDocument:
    """Everything takes part again."""
    return _with(document, lambda one: Exclusions())


def _with(document: ProjectDocument, change: Callable[[Exclusions], Exclusions]) -> ProjectDocument:
    changed = change(document.exclusions)
    return document if changed == document.exclusions else replace(document, exclusions=changed)


def _joined(spans: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    joined: list[tuple[int, int]] = []
    for first, stop in sorted(spans):
        if joined and first <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(joined[-1][1], stop))
        else:
            joined.append((first, stop))
    return joined


def _cut(span: tuple[int, int], taken: tuple[int, int]) -> list[tuple[int, int]]:
    """The remaining parts of a span."""
    parts = [(span[0], min(span[1], taken[0])), (max(span[0], taken[1]), span[1])]
    return [part for part in dict.fromkeys(parts) if part[0] < part[1]]


def _check_names(names: Sequence[str], camera_names: Sequence[str]) -> None:
    unknown = [name for name in names if name not in camera_names]
    if unknown:
        shown = ", ".join(camera_names[:8]) + (" and more" if len(camera_names) > 8 else "")
        raise ProjectError(f"There is no camera called {', '.join(unknown)}.", hint=f"Cameras are {shown}.")


def _check_frames(first: int, stop: int, n_frames: int) -> None:
    if not 0 <= first < stop <= n_frames:
        raise ProjectError(f"Frames {first} to {stop - 1} are not all there; frames are 0 to {n_frames - 1}.")
