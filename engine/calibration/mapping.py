"""First estimates of all cameras from matches alone, by pycolmap's incremental mapping, in a process of its own."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from engine.calibration.cameras import Cameras
from engine.calibration.matching import KeyPoints, Pair

SEED = 0
FOCAL_PER_SIDE = 0.85
"""Focal length to begin with, per longer side of the picture: a view of 61 degrees."""
FISHEYE_FOCAL_PER_SIDE = 0.5
MIN_CAMERAS = 3
MODELS = {"simple": "SIMPLE_RADIAL", "opencv": "SIMPLE_RADIAL", "fisheye": "SIMPLE_RADIAL_FISHEYE"}
"""COLMAP's names of the lenses of first estimates, which have one number at most."""


@dataclass(frozen=True, slots=True)
class FirstEstimate:
    """Some of the cameras, roughly.

    Attributes:
        rows: Which cameras, rising. [R]
        cameras: Their estimates, in this order.
    """

    rows: np.ndarray
    cameras: Cameras


def verified_matches(
    folder: Path, key_points: list[KeyPoints], matches: dict[Pair, np.ndarray], sizes: np.ndarray, lens: str
) -> dict[Pair, np.ndarray]:
    """Matches that one motion of the camera explains, pair by pair; left in a database in `folder` for `map_cameras`.

    Args:
        folder: Empty.
        sizes: Width and height of the pictures. [C, 2]
        lens: Of CalibrationOptions.
    """
    import pycolmap

    pycolmap.set_random_seed(SEED)
    with pycolmap.Database.open(folder / "database.db") as tables:
        ids = []
        for row, points in enumerate(key_points):
            camera = tables.write_camera(_camera(pycolmap, sizes[row], lens))
            image = tables.write_image(pycolmap.Image(name=_name(row), camera_id=camera))
            tables.write_keypoints(image, points.pixels.astype(np.float32))
            ids.append(image)
        for (a, b), rows in matches.items():
            if len(rows):
                tables.write_matches(ids[a], ids[b], rows.astype(np.uint32))
    pairs = folder / "pairs.txt"
    pairs.write_text("".join(f"{_name(a)} {_name(b)}\n" for a, b in matches))
    options = pycolmap.TwoViewGeometryOptions()
    options.ransac.random_seed = SEED
    options.ransac.max_error = max(2.0, float(sizes.max()) / 320)
    pycolmap.verify_matches(folder / "database.db", pairs, options)
    with pycolmap.Database.open(folder / "database.db") as tables:
        found = {}
        for a, b in matches:
            has_any = tables.exists_two_view_geometry(ids[a], ids[b])
            rows = tables.read_two_view_geometry(ids[a], ids[b]).inlier_matches if has_any else np.zeros((0, 2))
            found[a, b] = np.asarray(rows).astype(np.int64).reshape(-1, 2)
        return found


def map_cameras(folder: Path, n_cameras: int, lens: str, *, seed: int = SEED) -> list[FirstEstimate]:
    """Estimates of groups of cameras that hang together, the largest group first. Empty where nothing does."""
    import pycolmap

    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads = 1  # sums in another order would make it another result
    options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = seed
    options.min_model_size = MIN_CAMERAS
    options.extract_colors = False
    model = folder / f"model{seed}"
    shutil.rmtree(model, ignore_errors=True)
    model.mkdir()
    found = pycolmap.incremental_mapping(folder / "database.db", folder, model, options)
    estimates = [_estimate(reconstruction, lens) for reconstruction in found.values()]
    return sorted(estimates, key=lambda estimate: -len(estimate.rows))


def _estimate(reconstruction: Any, lens: str) -> FirstEstimate:
    images = sorted((i for i in reconstruction.images.values() if i.has_pose), key=lambda image: image.name)
    cameras = [reconstruction.cameras[image.camera_id] for image in images]
    params = np.array([camera.params for camera in cameras])
    poses = [image.cam_from_world() for image in images]
    model = "fisheye" if lens == "fisheye" else "simple"
    lens_params = np.zeros((len(images), 4)) if model == "fisheye" else np.zeros((len(images), 1))
    lens_params[:, 0] = params[:, 3]
    return FirstEstimate(
        np.array([int(image.name) for image in images]),
        Cameras(
            lens=model,
            rotations=np.array([pose.rotation.matrix() for pose in poses]),
            translations=np.array([pose.translation for pose in poses]),
            focals=params[:, 0],
            aspects=np.ones(len(images)),
            principal=params[:, 1:3],
            lens_params=lens_params,
        ),
    )


def _camera(pycolmap: Any, size: np.ndarray, lens: str) -> Any:
    width, height = (int(side) for side in size)
    focal = (FISHEYE_FOCAL_PER_SIDE if lens == "fisheye" else FOCAL_PER_SIDE) * max(width, height)
    return pycolmap.Camera(model=MODELS[lens], width=width, height=height, params=[focal, width / 2, height / 2, 0.0])


def _name(row: int) -> str:
    return f"{row:05d}"
