"""Key points of one camera: SIFT by pycolmap, in a process of its own (engine.calibration.matching.features_child)."""

from __future__ import annotations

from typing import Any

import numpy as np
from PIL import Image

from engine.calibration.matching.matching import KeyPoints
from engine.calibration.matching.pictures import CameraPictures

MAX_KEY_POINTS = 6000
"""Of a background; the largest are kept."""
MAX_MOVING_KEY_POINTS = 1500
"""Of what moves at one moment."""
PEAK = 0.004
"""Least contrast of a key point: below pycolmap's own, since rooms have plain walls."""


def extract(pictures: CameraPictures, *, is_thorough: bool = False) -> KeyPoints:
    """Key points of background and moving parts, moment after moment.

    Backgrounds get affine shapes and descriptors pooled over sizes, which find three times as many right matches
    between cameras 20 degrees apart, and cost a second each; moving parts get plain ones.

    Args:
        pictures: Of one camera.
        is_thorough: Whether moving parts get careful ones, too: for cameras far apart.
    """
    found = [_key_points(_extractor(MAX_KEY_POINTS, is_careful=True), pictures.background)]
    moments = [np.zeros(len(found[0][0]), dtype=np.int64)]
    of_parts = _extractor(MAX_MOVING_KEY_POINTS, is_careful=is_thorough) if pictures.moving else None
    for part in pictures.moving:
        pixels, descriptors = _key_points(of_parts, part.picture)
        columns, rows = pixels.astype(np.int64).T if len(pixels) else np.zeros((2, 0), np.int64)
        height, width = part.is_moving.shape
        is_kept = part.is_moving[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
        found.append((pixels[is_kept] + np.array(part.corner), descriptors[is_kept]))
        moments.append(np.full(int(is_kept.sum()), part.moment, dtype=np.int64))
    return KeyPoints(
        np.concatenate([pixels for pixels, _ in found]),
        np.concatenate(moments),
        np.concatenate([descriptors for _, descriptors in found]),
    )


def _extractor(max_key_points: int, *, is_careful: bool) -> Any:
    import pycolmap

    options = pycolmap.FeatureExtractionOptions()
    options.num_threads = 1  # cameras are spread over the cores instead
    options.sift.max_num_features = max_key_points
    options.sift.peak_threshold = PEAK
    options.sift.estimate_affine_shape = options.sift.domain_size_pooling = is_careful
    return pycolmap.FeatureExtractor.create(options, pycolmap.Device.cpu)


def _key_points(extractor: Any, picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels [K, 2], one per place and direction, and unit descriptors [K, 128]."""
    import pycolmap

    grey = np.ascontiguousarray(Image.fromarray(picture).convert("L"))
    if min(grey.shape) < 16:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    points, descriptors = extractor.extract_from_uint8_array(grey)
    if not len(points):
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    pixels = np.asarray(pycolmap.keypoints_to_matrix(points), dtype=np.float64)[:, :2]
    values = np.asarray(descriptors.data, dtype=np.float32)
    return pixels, values / np.maximum(np.linalg.norm(values, axis=-1, keepdims=True), 1e-12)
