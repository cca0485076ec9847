"""Writes a rig as a sparse model of COLMAP, as text or binary: cameras with their lenses, one image per camera."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from engine.camera.rotations import quats_of
from engine.capture.colmap.camera_models import MODELS, model_of
from engine.capture.frames import ImageFrames
from engine.capture.layout.format_result import Layout
from engine.capture.points import CapturePoints
from engine.capture.writers.frame_files import plain_source, safe_names
from engine.capture.writers.point_files import write_colmap_points
from engine.errors import CaptureError

MODEL_FOLDER = "sparse/0"


def write_colmap(layout: Layout, folder: Path, points: CapturePoints | None, *, is_binary: bool = False) -> Path:
    """Write sparse/0 into a folder. Returns its path.

    Args:
        layout: Its frames may lie anywhere; images are named as those below images/ in the folder, or as the camera.
        points: In the cameras' world; None for none.
        is_binary: Binary files instead of text.
    Raises:
        CaptureError: A lens that COLMAP has no model for, listing all of them.
        OSError: The disk refused.
    """
    cameras: list[tuple[int, np.ndarray]] = []
    problems: list[CaptureError] = []
    for entry in layout.cameras:
        try:
            cameras.append(model_of(entry.K, entry.lens))
        except CaptureError as error:
            problems.append(CaptureError(f'Camera "{entry.name}": {error.message}', hint=error.hint, path=folder))
    if problems:
        raise CaptureError("The capture cannot be written for COLMAP.", path=folder, problems=problems)
    model_folder = folder / MODEL_FOLDER
    model_folder.mkdir(parents=True, exist_ok=True)
    names = _image_names(layout, folder)
    poses = [(quats_of(entry.world_to_camera[:3, :3]), entry.world_to_camera[:3, 3]) for entry in layout.cameras]
    if is_binary:
        _write_binary(model_folder, layout, cameras, poses, names)
    else:
        _write_text(model_folder, layout, cameras, poses, names)
    cloud = points or CapturePoints(np.zeros((0, 3)), None)
    write_colmap_points(model_folder, cloud, is_binary=is_binary)
    return model_folder


def _image_names(layout: Layout, folder: Path) -> list[str]:
    """Names relative to images/, as COLMAP wants them; of videos, the name of the camera as an image."""
    safe = safe_names(tuple(entry.name for entry in layout.cameras))
    names = []
    for entry in layout.cameras:
        source, _ = plain_source(entry.source, layout.n_frames)
        name = f"{safe[entry.name]}.png"
        if isinstance(source, ImageFrames):
            first = source.files[0]
            inside = folder / "images"
            is_inside = first.is_relative_to(inside)
            name = first.relative_to(inside).as_posix() if is_inside else f"{safe[entry.name]}/{first.name}"
        names.append(name)
    return names


def _write_binary(
    folder: Path,
    layout: Layout,
    cameras: list[tuple[int, np.ndarray]],
    poses: list[tuple[np.ndarray, np.ndarray]],
    names: list[str],
) -> None:
    data = [struct.pack("<Q", len(cameras))]
    for row, (entry, (model_id, params)) in enumerate(zip(layout.cameras, cameras, strict=True)):
        data.append(struct.pack(f"<IiQQ{len(params)}d", row + 1, model_id, *entry.image_size, *params))
    (folder / "cameras.bin").write_bytes(b"".join(data))
    data = [struct.pack("<Q", len(cameras))]
    for row, ((quaternion, translation), name) in enumerate(zip(poses, names, strict=True)):
        data.append(struct.pack("<I7dI", row + 1, *quaternion, *translation, row + 1))
        data.append(name.encode("utf-8") + b"\0" + struct.pack("<Q", 0))
    (folder / "images.bin").write_bytes(b"".join(data))


def _write_text(
    folder: Path,
    layout: Layout,
    cameras: list[tuple[int, np.ndarray]],
    poses: list[tuple[np.ndarray, np.ndarray]],
    names: list[str],
) -> None:
    lines = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    for row, (entry, (model_id, params)) in enumerate(zip(layout.cameras, cameras, strict=True)):
        width, height = entry.image_size
        lines.append(f"{row + 1} {MODELS[model_id].name} {width} {height} {_numbers(params)}")
    (folder / "cameras.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    lines = ["# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME; then a line of POINTS2D[]"]
    for row, ((quaternion, translation), name) in enumerate(zip(poses, names, strict=True)):
        lines += [f"{row + 1} {_numbers(quaternion)} {_numbers(translation)} {row + 1} {name}", ""]
    (folder / "images.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _numbers(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
