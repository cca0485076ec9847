"""A capture written anew in another layout: into a folder that is complete or not there at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from engine.capture.frames import VideoFrames
from engine.capture.layout.format_result import CameraEntry, Layout
from engine.capture.points import points_of, said_of
from engine.capture.writers.capture_json import capture_document, write_capture_json
from engine.capture.writers.colmap import write_colmap
from engine.capture.writers.frame_files import Frames, Report, plain_source, with_frames_in
from engine.capture.writers.point_files import write_ply
from engine.capture.writers.transforms_json import POINTS_FILE, write_transforms
from engine.errors import CaptureError
from engine.storage.files import atomic_folder, disk_error

Target = Literal["colmap", "transforms", "capture.json"]
TARGETS: tuple[Target, ...] = ("colmap", "transforms", "capture.json")
"""Layouts that are written."""


@dataclass(frozen=True, slots=True)
class Conversion:
    """The outcome of a conversion. lines: sentences about facts that the new layout cannot hold, or were left out."""

    folder: Path
    lines: tuple[str, ...]


def convert(
    layout: Layout,
    out: Path,
    target: Target,
    *,
    frames: Frames = "none",
    is_binary: bool = False,
    report: Report = lambda done, of: None,
) -> Conversion:
    """Write a capture into a new folder.

    Args:
        layout: As it was read.
        out: Must not exist, or be an empty folder.
        target: The layout to write.
        frames: The treatment of the frames; see `with_frames_in`.
        is_binary: COLMAP's files as binary instead of text.
        report: Called with how many files of frames are done, and of how many.
    Raises:
        CaptureError: The folder is there already, the layout cannot say what the capture is, or a frame is damaged.
        DiskError: The disk refused. Nothing is left behind, whatever is raised.
    """
    if out.exists() and not (out.is_dir() and _is_empty(out)):
        raise CaptureError("This name is already taken.", hint="Give a new folder.", path=out)
    try:
        with atomic_folder(out) as partial:
            lines = _write(layout, partial, target, frames=frames, is_binary=is_binary, report=report)
    except OSError as error:
        raise disk_error(error, what="The capture", path=out) from error
    return Conversion(out, tuple(lines))


def _write(
    layout: Layout, folder: Path, target: Target, *, frames: Frames, is_binary: bool, report: Callable[[int, int], None]
) -> list[str]:
    if (
        target == "transforms"
        and frames == "none"
        and any(_is_part_of_a_video(entry, layout) for entry in layout.cameras)
    ):
        text = "transforms.json cannot state which frames of the videos the capture uses."
        raise CaptureError(
            text, hint="Write them as pictures with --frames png, or convert to capture.json.", path=folder
        )
    lines = list(_unsaid(layout, target, frames))
    cloud = points_of(layout)
    if cloud is not None and layout.points is not None:
        lines += said_of(cloud, layout.points)
    moved = with_frames_in(layout, folder, frames, report)
    if target == "colmap":
        write_colmap(moved, folder, cloud, is_binary=is_binary)
    elif target == "transforms":
        write_transforms(moved, folder, cloud)
    else:
        if cloud is not None and frames != "none":
            write_ply(folder / POINTS_FILE, cloud)
            moved = replace(moved, points=folder / POINTS_FILE, points_to_world=None)
        write_capture_json(folder, capture_document(moved, folder))
    return lines


def _is_part_of_a_video(entry: CameraEntry, layout: Layout) -> bool:
    source, indices = plain_source(entry.source, layout.n_frames)
    return isinstance(source, VideoFrames) and indices is not None


def _unsaid(layout: Layout, target: Target, frames: Frames) -> list[str]:
    """Sentences about the facts that the new layout cannot hold."""
    lines = []
    if target != "capture.json":
        if any(entry.color_matrix is not None for entry in layout.cameras):
            lines.append("Colour matrices of cameras are left out.")
        if any(entry.masks is not None for entry in layout.cameras):
            lines.append("Masks are left out.")
        if target == "colmap" and layout.default_holdout:
            lines.append("The list of held-out cameras is not written.")
    if frames == "none" and target == "colmap":
        lines.append(
            "The image names in the model are placeholders, so the folder does not open as a capture; --frames link "
            "makes one that does."
        )
    elif frames in ("none", "link"):
        lines.append("Frames are not copied; open the folder with --follow-links.")
    return lines


def _is_empty(folder: Path) -> bool:
    return not any(folder.iterdir())
