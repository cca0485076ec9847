"""Writes sparse models byte by byte, and the shared scene with one of them and videos, folders or single images."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from engine.camera.lens import Lens
from tests.engine.capture.layouts.scene import Scene

MODELS = {
    "SIMPLE_PINHOLE": (0, "fcc"),
    "PINHOLE": (1, "ffcc"),
    "SIMPLE_RADIAL": (2, "fcc1"),
    "RADIAL": (3, "fcc2"),
    "OPENCV": (4, "ffcc4"),
    "OPENCV_FISHEYE": (5, "ffcc4"),
    "FULL_OPENCV": (6, "ffcc8"),
    "FOV": (7, "ffcc1"),
    "SIMPLE_RADIAL_FISHEYE": (8, "fcc1"),
    "RADIAL_FISHEYE": (9, "fcc2"),
    "THIN_PRISM_FISHEYE": (10, "ffcc8"),
}
"""Number and parameters of each model: focal lengths, principal point, how many of the lens."""
MODEL_OF = {"pinhole": "PINHOLE", "opencv4": "OPENCV", "opencv5": "FULL_OPENCV", "fisheye": "OPENCV_FISHEYE"}
"""What the lenses of the scene are called."""


def model_params(model: str, K: np.ndarray, lens: Lens) -> list[float]:
    """The numbers of a camera."""
    form = MODELS[model][1]
    n_lens = int(form.lstrip("fc") or 0)
    focals = [K[0, 0], K[1, 1]] if form.startswith("ff") else [K[0, 0]]
    return [*focals, K[0, 2], K[1, 2], *lens.params, *[0.0] * n_lens][: len(form.rstrip("0123456789")) + n_lens]


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """w x y z of a rotation [3, 3], by its largest eigenvector."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    matrix = np.array(
        [
            [xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, yy - xx - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, zz - xx - yy],
        ]
    )
    return np.linalg.eigh(matrix)[1][:, -1]


def write_model(
    folder: Path,
    scene: Scene,
    model: str,
    *,
    image_name: Callable[[str], str] = "{}.jpg".format,
    is_binary: bool = True,
    points: np.ndarray | None = None,
    n_features: int = 3,
) -> None:
    """cameras, images and points3D, images in an order that is not that of their names.

    Args:
        image_name: Of a camera.
        points: [P, 3]; grey, seen by two images each.
        n_features: Of each image.
    """
    folder.mkdir(parents=True, exist_ok=True)
    order = list(range(len(scene.names)))[::-1]
    cameras = [(row + 1, MODELS[model][0], *scene.size, model_params(model, *_own(scene, row))) for row in order]
    images = [
        (
            7 * row + 3,
            *quaternion(scene.world_to_camera[row, :3, :3]),
            *scene.world_to_camera[row, :3, 3],
            row + 1,
            image_name(scene.names[row]),
        )
        for row in order
    ]
    cloud = np.zeros((0, 3)) if points is None else points
    if is_binary:
        _write_binary(folder, cameras, images, cloud, n_features)
    else:
        _write_text(folder, model, cameras, images, cloud, n_features)


def _own(scene: Scene, row: int) -> tuple[np.ndarray, Lens]:
    return scene.Ks[row], scene.lenses[row]


def _write_binary(folder: Path, cameras: Sequence, images: Sequence, cloud: np.ndarray, n_features: int) -> None:
    data = struct.pack("<Q", len(cameras))
    for number, model_id, width, height, params in cameras:
        data += struct.pack(f"<IiQQ{len(params)}d", number, model_id, width, height, *params)
    (folder / "cameras.bin").write_bytes(data)
    data = struct.pack("<Q", len(images))
    for number, *pose, camera, name in images:
        data += struct.pack("<I7dI", number, *pose, camera) + name.encode() + b"\0"
        data += struct.pack("<Q", n_features) + struct.pack("<ddq", 1.5, 2.5, -1) * n_features
    (folder / "images.bin").write_bytes(data)
    data = struct.pack("<Q", len(cloud))
    for row, point in enumerate(cloud):
        data += struct.pack("<Q3d3BdQ4I", row + 1, *point, 10, 20, row % 256, 0.5, 2, 3, 0, 10, 1)
    (folder / "points3D.bin").write_bytes(data)


def _write_text(
    folder: Path, model: str, cameras: Sequence, images: Sequence, cloud: np.ndarray, n_features: int
) -> None:
    lines = ["# Camera list", "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    lines += [
        " ".join(map(str, (number, model, width, height, *map(float, params))))
        for number, _, width, height, params in cameras
    ]
    (folder / "cameras.txt").write_text("\n".join(lines) + "\n")
    lines = ["# Image list with two lines of data per image:"]
    for number, *pose, camera, name in images:
        lines += [" ".join(map(str, (number, *map(float, pose), camera, name))), "1.5 2.5 -1 " * n_features]
    (folder / "images.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    lines = ["# 3D point list"]
    lines += [
        " ".join(map(str, (row + 1, *map(float, point), 10, 20, row % 256, 0.5, 3, 0, 10, 1)))
        for row, point in enumerate(cloud)
    ]
    (folder / "points3D.txt").write_text("\n".join(lines) + "\n")


def write_frames(folder: Path, scene: Scene, frames: str) -> None:
    """Frames of all cameras: "videos" beside the model, "folders" in images/, or "images" in images/, one each."""
    for row, name in enumerate(scene.names):
        if frames == "videos":
            scene.write_video(folder / f"{name}.mp4", row)
        elif frames == "folders":
            scene.write_images(folder / "images" / name, row)
        else:
            (folder / "images").mkdir(parents=True, exist_ok=True)
            Image.fromarray(scene.picture(row, 0)).save(folder / "images" / f"{name}.png")


def write(folder: Path, scene: Scene, *, lens: str, is_binary: bool = True, frames: str = "videos") -> None:
    """The scene as a rig of COLMAP. lens: what it was made with."""
    write_model(folder / "sparse" / "0", scene, MODEL_OF[lens], is_binary=is_binary)
    write_frames(folder, scene, frames)
