"""Writes a rig as transforms.json of nerfstudio: a row per camera and frame with a time, or one per camera."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from engine.camera.lens import Lens
from engine.capture.frames import ImageFrames
from engine.capture.layout.format_result import CameraEntry, Layout
from engine.capture.points import CapturePoints
from engine.capture.writers.frame_files import name_in, plain_source
from engine.capture.writers.point_files import write_ply
from engine.errors import CaptureError
from engine.storage.json_files import json_text

FILE = "transforms.json"
POINTS_FILE = "points3D.ply"
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""From OpenCV's axes of a camera to those of OpenGL."""
OPENCV_NAMES = ("k1", "k2", "p1", "p2", "k3")
FISHEYE_NAMES = ("k1", "k2", "k3", "k4")


def write_transforms(layout: Layout, folder: Path, points: CapturePoints | None) -> Path:
    """Write transforms.json, and points3D.ply where there are points, into a folder. Returns the path of the former.

    Where all cameras have images, each image gets a row with its time from 0 to 1. A video has one row, which names
    the video: nerfstudio itself does not read those.

    Args:
        points: In the cameras' world; None for none.
    Raises:
        CaptureError: A lens that the layout has no words for, listing all of them.
        OSError: The disk refused.
    """
    frames: list[dict[str, Any]] = []
    problems: list[CaptureError] = []
    sources = [plain_source(entry.source, layout.n_frames) for entry in layout.cameras]
    is_timed = layout.n_frames > 1 and all(isinstance(source, ImageFrames) for source, _ in sources)
    for entry, (source, indices) in zip(layout.cameras, sources, strict=True):
        try:
            row = _row(entry)
        except CaptureError as error:
            problems.append(CaptureError(f'Camera "{entry.name}": {error.message}', hint=error.hint, path=folder))
            continue
        paths = source.files if isinstance(source, ImageFrames) else (source.path,)
        if not is_timed:
            frames.append({"file_path": name_in(paths[0], folder), **row})
            continue
        for t, index in enumerate(range(layout.n_frames) if indices is None else indices):
            time = t / (layout.n_frames - 1)
            frames.append({"file_path": name_in(paths[int(index)], folder), "time": time, **row})
    if problems:
        raise CaptureError("The capture cannot be written as transforms.json.", path=folder, problems=problems)
    document: dict[str, Any] = {"fps": layout.fps}
    models = {row["camera_model"] for row in frames}
    if len(models) == 1:
        document["camera_model"] = models.pop()
    if layout.default_holdout:
        held_out = set(layout.default_holdout)
        names = [entry.name for entry in layout.cameras for _ in range(layout.n_frames if is_timed else 1)]
        for key, is_wanted in (("train_filenames", False), ("test_filenames", True)):
            document[key] = [
                row["file_path"] for row, name in zip(frames, names, strict=True) if (name in held_out) == is_wanted
            ]
    if points is not None:
        write_ply(folder / POINTS_FILE, points)
        document["ply_file_path"] = POINTS_FILE
    document["frames"] = frames
    path = folder / FILE
    path.write_text(json_text(document, indent=1) + "\n", encoding="utf-8")
    return path


def _row(entry: CameraEntry) -> dict[str, Any]:
    """A row's facts about the camera."""
    width, height = entry.image_size
    return {
        "transform_matrix": (np.linalg.inv(entry.world_to_camera) @ FLIP).tolist(),
        "w": width,
        "h": height,
        "fl_x": float(entry.K[0, 0]),
        "fl_y": float(entry.K[1, 1]),
        "cx": float(entry.K[0, 2]),
        "cy": float(entry.K[1, 2]),
        **_lens(entry.lens),
    }


def _lens(lens: Lens) -> dict[str, Any]:
    names = FISHEYE_NAMES if lens.model == "fisheye" else OPENCV_NAMES
    if lens.is_pinhole:
        values: tuple[float, ...] = ()
    elif lens.model not in ("opencv", "fisheye") or any(lens.params[len(names) :]):
        hint = "Convert to capture.json or to colmap instead."
        raise CaptureError(f"transforms.json cannot express all parameters of its {lens.model} lens.", hint=hint)
    else:
        values = lens.params[: len(names)]
    model = "OPENCV_FISHEYE" if lens.model == "fisheye" else "OPENCV"
    return {"camera_model": model, **{name: float(value) for name, value in zip(names, values, strict=False)}}
