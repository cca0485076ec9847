"""Writes capture.json: any capture in our own words, and corrections to it, the only thing ever written into one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from engine.capture.formats.capture_json import FILE, SCHEMA
from engine.capture.frames import FrameSource, ImageFrames, IndexedFrames
from engine.capture.layout.format_checks import read_json_object
from engine.capture.layout.format_result import CameraEntry, Layout
from engine.capture.pixels.frame_fit import FrameFit
from engine.capture.pixels.transfer_curves import CurveName
from engine.capture.writers.frame_files import name_in
from engine.errors import CaptureError
from engine.storage.files import checked_path
from engine.storage.json_files import json_text


@dataclass(frozen=True, slots=True)
class Corrections:
    """The changes that a user, or a check that the user agreed to, makes to a capture.

    Attributes:
        is_excluded: By camera name.
        offset_frames: By camera name; replaces what was there.
        holdout: Names of cameras kept out of training; None leaves them.
        masks: By camera name: a pattern or video relative to the folder.
        world_scale, up: See `CaptureDocument`; None leaves them.
        fps: None leaves it.
        fisheye_fov_deg: Horizontal view that fisheye pictures are brought to, 10 to 150; None leaves it.
        fit: The fit of frames of another shape than their calibration; None leaves it.
        curve: Transfer curve of all frames; None leaves it.
    """

    is_excluded: Mapping[str, bool] = field(default_factory=dict)
    offset_frames: Mapping[str, float] = field(default_factory=dict)
    holdout: Sequence[str] | None = None
    masks: Mapping[str, str] = field(default_factory=dict)
    world_scale: float | None = None
    up: tuple[float, float, float] | None = None
    fps: float | None = None
    fisheye_fov_deg: float | None = None
    fit: FrameFit | None = None
    curve: CurveName | None = None


def capture_document(layout: Layout, folder: Path) -> dict[str, Any]:
    """The content of capture.json for a layout.

    Args:
        folder: Where the file shall lie: files are named relative to it, those outside of it by their absolute path.
    """
    document: dict[str, Any] = {"schema": SCHEMA, "fps": layout.fps, "pixel_center": 0.5}
    if layout.default_holdout:
        document["holdout"] = list(layout.default_holdout)
    if layout.points is not None:
        document["points"] = name_in(layout.points, folder)
    if layout.points_to_world is not None:
        document["points_to_world"] = layout.points_to_world.tolist()
    if layout.fisheye_fov_deg is not None:
        document["fisheye_fov_deg"] = layout.fisheye_fov_deg
    if layout.fit is not None:
        document["fit"] = layout.fit
    if layout.curve is not None:
        document["curve"] = layout.curve
    is_resampled = any(not _is_one_by_one(entry.source) for entry in layout.cameras)
    document["cameras"] = [_camera(entry, folder, is_resampled=is_resampled) for entry in layout.cameras]
    return document


def write_capture_json(folder: Path, document: Mapping[str, Any]) -> Path:
    """Write capture.json into a folder, replacing the file at once. Returns its path.

    Raises:
        DiskError: The folder cannot be written.
    """
    path = folder / FILE
    with checked_path(path, what="The description of the capture") as partial:
        partial.write_text(json_text(document, indent=1) + "\n", encoding="utf-8")
    return path


def write_corrections(layout: Layout, folder: Path, corrections: Corrections, *, target: Path | None = None) -> Path:
    """Correct a capture: its capture.json with these changes, or a new one. Returns its path.

    Args:
        layout: The capture as it was read.
        folder: Of the capture.
        target: Folder to write to; None takes the capture's own. In another one, files are named by absolute paths,
            and it opens with follow_links only.
    Raises:
        CaptureError: A camera is unknown, or the capture.json that is there cannot be read.
        DiskError: The folder cannot be written.
    """
    place = folder if target is None else target
    has_own = (folder / FILE).is_file() and place == folder
    document = read_json_object(folder / FILE) if has_own else capture_document(layout, place)
    rows = {row["name"]: row for row in document["cameras"]}
    named = {*corrections.is_excluded, *corrections.offset_frames, *corrections.masks, *(corrections.holdout or ())}
    unknown = sorted(named - set(rows))
    if unknown:
        raise CaptureError(
            f"The capture has no camera called {', '.join(unknown)}.",
            hint=f"Its cameras are {', '.join(rows)}.",
            path=folder,
        )
    for key, values in (
        ("is_excluded", corrections.is_excluded),
        ("offset_frames", corrections.offset_frames),
        ("masks", corrections.masks),
    ):
        for name, value in values.items():
            rows[name][key] = value
    for key in ("holdout", "world_scale", "up", "fps", "fisheye_fov_deg", "fit", "curve"):
        value = getattr(corrections, key)
        if value is not None:
            document[key] = list(value) if isinstance(value, tuple | list) else value
    return write_capture_json(place, document)


def _camera(entry: CameraEntry, folder: Path, *, is_resampled: bool) -> dict[str, Any]:
    size, K = (entry.image_size, entry.K) if entry.calibrated is None else (entry.calibrated.size, entry.calibrated.K)
    row: dict[str, Any] = {
        "name": entry.name,
        "width": size[0],
        "height": size[1],
        "K": K.tolist(),
        "world_to_camera": entry.world_to_camera.tolist(),
    }
    if not entry.lens.is_pinhole:
        row["lens"] = {"model": entry.lens.model, "params": list(entry.lens.params)}
    source, offset = _unmoved(entry.source)
    if isinstance(source, ImageFrames):
        row["images"] = [name_in(path, folder) for path in source.files]
    else:
        row["video"] = name_in(source.path, folder)
    if is_resampled:
        shown = entry.source.frame_indices if isinstance(entry.source, IndexedFrames) else range(source.n_frames)
        row["frames"] = [int(index) for index in shown]
    elif offset:
        row["offset_frames"] = offset
    if entry.masks is not None:
        masks, _ = _unmoved(entry.masks)
        is_images = isinstance(masks, ImageFrames)
        row["masks"] = [name_in(path, folder) for path in masks.files] if is_images else name_in(masks.path, folder)
    if entry.color_matrix is not None:
        row["color_matrix"] = np.asarray(entry.color_matrix).tolist()
    return row


def _is_one_by_one(source: FrameSource) -> bool:
    return not isinstance(source, IndexedFrames) or bool((np.diff(source.frame_indices) == 1).all())


def _unmoved(source: FrameSource) -> tuple[FrameSource, int]:
    """The source behind another numbering, and by how many frames it was moved."""
    if isinstance(source, IndexedFrames):
        return source.source, int(source.frame_indices[0])
    return source, 0
