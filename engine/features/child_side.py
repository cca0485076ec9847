"""Shared by modules that `engine.features.child.work_on_arrays` starts, and the SIFT features that all of them need.

Imported by child processes only: pycolmap must stay out of the program's own.
"""

from __future__ import annotations

import shutil
import zlib  # noqa: F401  must be loaded before pycolmap, whose own zlib symbols otherwise replace it
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from engine.features.sift_memory import MAX_SIDE_PX, n_at_once

MAX_FEATURES = 2048


def answer(shared: Path, work: Callable[[dict[str, np.ndarray], Path], dict[str, np.ndarray]]) -> None:
    """In the child: read the arrays, answer them by `work(arrays, empty folder)`, write the answer."""
    with np.load(shared / "job.npz") as found:
        arrays = dict(found)
    folder = shared / "colmap"
    shutil.rmtree(folder, ignore_errors=True)  # of an attempt before
    folder.mkdir()
    np.savez(shared / "result.npz", allow_pickle=False, **work(arrays, folder))


def extract_features(
    folder: Path,
    images: np.ndarray,
    max_features: int = MAX_FEATURES,
    least_contrast: float | None = None,
    *,
    is_valid: np.ndarray | None = None,
    max_bytes: int | None = None,
) -> tuple[Path, list[str]]:
    """Write pictures into folder/images and their SIFT features into a database. Returns it and the pictures' names.

    Args:
        images: [C, H, W, 3] uint8
        max_features: Of each picture, those with the largest extent.
        least_contrast: SIFT's peak threshold; None takes COLMAP's.
        is_valid: Pixels where features may lie; None for all. [C, H, W] bool
        max_bytes: Pictures are worked on side by side as long as they take no more; None for one per core.
    """
    import pycolmap

    pycolmap.set_random_seed(0)
    names = [f"{i:04d}.png" for i in range(len(images))]
    pictures, database = folder / "images", folder / "database.db"
    pictures.mkdir()
    for name, image in zip(names, images, strict=True):
        Image.fromarray(image).save(pictures / name, compress_level=1)
    reader = pycolmap.ImageReaderOptions(camera_model="PINHOLE")
    if is_valid is not None:
        masks = folder / "masks"
        masks.mkdir()
        for name, valid in zip(names, is_valid, strict=True):
            Image.fromarray(valid.astype(np.uint8) * 255).save(masks / f"{name}.png", compress_level=1)
        reader.mask_path = masks
    # images first: extraction alone would number them in the order in which its threads finish
    pycolmap.Database.open(database).close()
    pycolmap.import_images(database, pictures, pycolmap.CameraMode.PER_IMAGE, image_names=names, options=reader)
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.sift.max_num_features = max_features
    extraction.max_image_size = MAX_SIDE_PX
    if max_bytes is not None:
        extraction.num_threads = n_at_once(images.shape[2], images.shape[1], max_bytes)
    if least_contrast is not None:
        extraction.sift.peak_threshold = least_contrast
    pycolmap.extract_features(
        database,
        pictures,
        image_names=names,
        camera_mode=pycolmap.CameraMode.PER_IMAGE,
        reader_options=reader,
        extraction_options=extraction,
        device=pycolmap.Device.cpu,
    )
    return database, names


def steady_verification() -> Any:
    """Options of the geometric verification: else the outcome depends on which thread takes which pair."""
    import pycolmap

    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = 0
    return verification
