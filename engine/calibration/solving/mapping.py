"""First estimates of all cameras from matches alone, by pycolmap's incremental mapping, in a process of its own."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from engine.calibration.matching.matching import KeyPoints, Pair
from engine.calibration.solving.cameras import Cameras

SEED = 0
FOCALS_PER_SIDE = (0.8, 0.65, 1.0, 1.4)
"""Focal lengths to begin with, per longer side of the picture: views of 64, 75, 53 and 39 degrees. The first estimate
holds on to one of them for all cameras: where each could have its own, misplaced cameras would be made to fit by it."""
FISHEYE_FOCALS_PER_SIDE = (0.5, 0.4, 0.3)
REACH_PX = 6.0
"""That sightings may be off at a width of 640, since focal lengths are only alike."""
MIN_CAMERAS = 3
MIN_MATCHES = 15
"""Of two cameras; fewer say nothing about them."""
MAX_TRIALS = 2000
"""Of a motion that matches fit: enough for a quarter of right ones."""
MODELS = {"simple": "SIMPLE_RADIAL", "opencv": "SIMPLE_RADIAL", "fisheye": "SIMPLE_RADIAL_FISHEYE"}
"""COLMAP's names of the lenses of first estimates, which have one number at most."""


@dataclass(frozen=True, slots=True)
class FirstEstimate:
    """Some of the cameras, roughly.

    Attributes:
        rows: Which cameras, rising. [R]
        cameras: Their estimates, in this order.
        are_alike: Whether all were taken to have one focal length per size of picture.
    """

    rows: np.ndarray
    cameras: Cameras
    are_alike: bool


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
            camera = tables.write_camera(_camera(pycolmap, sizes[row], lens, focals_to_try(lens)[0]))
            image = tables.write_image(pycolmap.Image(name=_name(row), camera_id=camera))
            tables.write_keypoints(image, points.pixels.astype(np.float32))
            ids.append(image)
        for (a, b), rows in matches.items():
            if len(rows) >= MIN_MATCHES:
                tables.write_matches(ids[a], ids[b], rows.astype(np.uint32))
    pairs = folder / "pairs.txt"
    pairs.write_text(
        "".join(f"{_name(a)} {_name(b)}\n" for (a, b), rows in matches.items() if len(rows) >= MIN_MATCHES)
    )
    options = pycolmap.TwoViewGeometryOptions()
    options.ransac.random_seed = SEED
    options.ransac.max_num_trials = MAX_TRIALS
    options.ransac.max_error = max(2.0, float(sizes.max()) / 320)
    pycolmap.verify_matches(folder / "database.db", pairs, options)
    with pycolmap.Database.open(folder / "database.db") as tables:
        found = {}
        for a, b in matches:
            has_any = tables.exists_two_view_geometry(ids[a], ids[b])
            rows = tables.read_two_view_geometry(ids[a], ids[b]).inlier_matches if has_any else np.zeros((0, 2))
            found[a, b] = np.asarray(rows).astype(np.int64).reshape(-1, 2)
        return found


def focals_to_try(lens: str) -> tuple[float, ...]:
    """Focal lengths per longer side of the picture that a lens model begins with."""
    return FISHEYE_FOCALS_PER_SIDE if lens == "fisheye" else FOCALS_PER_SIDE


def map_cameras(
    folder: Path,
    sizes: np.ndarray,
    lens: str,
    *,
    focal: float,
    are_alike: bool,
    seed: int = SEED,
    progress: Callable[[float], None] = lambda _: None,
) -> list[FirstEstimate]:
    """Estimates of groups of cameras that hang together, the largest group first. Empty where nothing does.

    Args:
        folder: Where `verified_matches` left the database.
        sizes: Width and height of the pictures. [C, 2]
        lens: Of CalibrationOptions.
        focal: Per longer side of the picture.
        are_alike: Hold on to this focal length; otherwise every camera's own is sought from there.
        seed: Of all that is tried at random.
        progress: Called with the share of the cameras that has been placed.
    """
    import pycolmap

    n_placed = 0

    def placed(n: int) -> None:
        nonlocal n_placed
        n_placed += n
        progress(min(n_placed / len(sizes), 1.0))

    pycolmap.set_random_seed(seed)
    with pycolmap.Database.open(folder / "database.db") as tables:
        for camera in tables.read_all_images():
            fresh = _camera(pycolmap, sizes[int(camera.name)], lens, focal)
            fresh.camera_id = camera.camera_id
            tables.update_camera(fresh)
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads = 1  # sums in another order would make it another result
    options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = seed
    options.min_model_size = MIN_CAMERAS
    options.extract_colors = False
    options.ba_global_max_refinements = 2
    if are_alike:
        options.ba_refine_focal_length = options.ba_refine_extra_params = False
        options.mapper.abs_pose_refine_focal_length = options.mapper.abs_pose_refine_extra_params = False
        reach_px = max(REACH_PX * float(sizes.max()) / 640, REACH_PX)
        options.mapper.filter_max_reproj_error = reach_px
        options.triangulation.merge_max_reproj_error = options.triangulation.complete_max_reproj_error = reach_px
    model = folder / "model"
    shutil.rmtree(model, ignore_errors=True)
    model.mkdir()
    found = pycolmap.incremental_mapping(
        folder / "database.db",
        folder,
        model,
        options,
        initial_image_pair_callback=lambda: placed(2),
        next_image_callback=lambda: placed(1),
    )
    estimates = [_estimate(reconstruction, lens, are_alike) for reconstruction in found.values()]
    return sorted(estimates, key=lambda estimate: -len(estimate.rows))


def _estimate(reconstruction: Any, lens: str, are_alike: bool) -> FirstEstimate:
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
        are_alike,
    )


def _camera(pycolmap: Any, size: np.ndarray, lens: str, focal: float) -> Any:
    width, height = (int(side) for side in size)
    params = [focal * max(width, height), width / 2, height / 2, 0.0]
    camera = pycolmap.Camera(model=MODELS[lens], width=width, height=height, params=params)
    camera.has_prior_focal_length = True
    return camera


def _name(row: int) -> str:
    return f"{row:05d}"
