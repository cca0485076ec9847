"""From a solution to what is handed back: world, scale, figures per camera, and why cameras are missing."""

from __future__ import annotations

from typing import Any

import numpy as np

from engine.calibration.agreement import MIN_AGREEING, Agreement, agreement
from engine.calibration.cameras import Cameras
from engine.calibration.matching import KeyPoints, Pair
from engine.calibration.options import CalibrationOptions
from engine.calibration.solving import Solution
from engine.calibration.videos import PlainVideo
from engine.calibration.world import find_up, known_scale, unit_scale, upright

FEW_KEY_POINTS = 150
FEW_MATCHES = 30
WEAK_SIGHTINGS = 60
ODD_FOCAL = 0.2
"""Of ln(focal length) from the median: cameras of one rig rarely differ by more, misplaced ones do."""
LENS_MODEL = {"simple": "opencv", "opencv": "opencv", "fisheye": "fisheye"}
"""Names of engine.camera.lens."""


def finished(
    solution: Solution,
    videos: list[PlainVideo],
    key_points: list[KeyPoints],
    verified: dict[Pair, np.ndarray],
    sizes: np.ndarray,
    options: CalibrationOptions,
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays and the document of a result, as engine.calibration.calibrate reads them."""
    rows, tracks, errors = solution.rows, solution.tracks, solution.errors
    names = [videos[row].name for row in rows]
    warnings: list[str] = []
    scale, is_metric = _scale(solution.cameras, tracks.points, names, options, warnings)
    up, origin, up_from = find_up(solution.cameras, tracks.points, options.up)
    if up_from != options.up:
        warnings.append("No floor was found below the cameras; up is where most of them have their upper edge.")
    cameras, points = upright(solution.cameras, tracks.points, up, origin, scale)
    n_sightings = np.bincount(tracks.seen.cameras, minlength=len(rows))
    agreed = agreement(rows, solution.cameras, key_points, verified, float(sizes.max()))
    doubts = _doubts(solution, n_sightings, agreed, sizes)
    named = ", ".join(name for name, doubt in zip(names, doubts, strict=True) if doubt)
    if named:
        warnings.append(
            f"The places of these cameras cannot be trusted: {named}. Look at them before you train, and leave out "
            "those that are wrong, or film again with more that they and their neighbours both see."
        )
    native = np.array([videos[row].size for row in rows], dtype=np.int64)
    arrays = {
        "world_to_camera": _poses(cameras),
        "Ks": _matrices(cameras, native / sizes[rows]),
        "image_sizes": native,
        "lens_params": cameras.lens_params,
        "points": points,
        "point_errors_px": _means(errors, tracks.seen.points, len(points)),
        "camera_errors_px": _medians(errors, tracks.seen.cameras, len(rows)) * (native / sizes[rows])[:, 0],
        "n_sightings": n_sightings,
        "explained_shares": agreed.shares,
    }
    document = {
        "names": names,
        "lens_model": LENS_MODEL[options.lens],
        "is_metric": is_metric,
        "up": up_from,
        "doubts": doubts,
        "missing": [_missing(row, rows, videos, key_points, verified) for row in _absent(rows, len(videos))],
        "warnings": warnings,
    }
    return arrays, document


def _doubts(solution: Solution, n_sightings: np.ndarray, agreed: Agreement, sizes: np.ndarray) -> list[str]:
    """Why each camera may be misplaced; empty for those that nothing speaks against."""
    shares = solution.cameras.focals / sizes[solution.rows].max(1)
    is_odd = np.abs(np.log(shares / np.median(shares))) > ODD_FOCAL
    doubts = []
    for row, n in enumerate(n_sightings.tolist()):
        against, n_for = int(agreed.n_contradicting[row]), int(agreed.n_agreeing[row])
        if agreed.n_neighbours[row] < MIN_AGREEING:
            doubts.append(f"{agreed.n_neighbours[row]} cameras agree with its place; {MIN_AGREEING} are needed")
        elif agreed.is_doubtful[row]:
            doubts.append(f"{against} matches with one camera speak against its place, {n_for} with another for it")
        elif is_odd[row]:
            doubts.append("its focal length is far from those of the others; right only if its lens or zoom is another")
        else:
            doubts.append(f"only {n} points" if n < WEAK_SIGHTINGS else "")
    return doubts


def _scale(cameras: Cameras, points, names: list[str], options: CalibrationOptions, warnings: list[str]):
    known = options.distance
    if known is None:
        return unit_scale(cameras, points), False
    if known.first not in names or known.second not in names:
        missing = known.first if known.first not in names else known.second
        warnings.append(f"The known distance was not used: camera {missing} was not found.")
        return unit_scale(cameras, points), False
    return known_scale(cameras, names.index(known.first), names.index(known.second), known.metres), True


def _poses(cameras: Cameras) -> np.ndarray:
    poses = np.tile(np.eye(4), (len(cameras), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = cameras.rotations, cameras.translations
    return poses


def _matrices(cameras: Cameras, ratios: np.ndarray) -> np.ndarray:
    """Intrinsics at the size of the videos; pixel centres lie at +0.5, so everything scales. [C, 3, 3]"""
    Ks = np.tile(np.eye(3), (len(cameras), 1, 1))
    focals, principal = cameras.focals_xy * ratios, cameras.principal * ratios
    Ks[:, 0, 0], Ks[:, 1, 1] = focals.T
    Ks[:, 0, 2], Ks[:, 1, 2] = principal.T
    return Ks


def _means(values: np.ndarray, groups: np.ndarray, n: int) -> np.ndarray:
    return np.bincount(groups, values, minlength=n) / np.maximum(np.bincount(groups, minlength=n), 1)


def _medians(values: np.ndarray, groups: np.ndarray, n: int) -> np.ndarray:
    return np.array([np.median(values[groups == i]) if (groups == i).any() else np.inf for i in range(n)])


def _absent(rows: np.ndarray, n: int) -> list[int]:
    return [row for row in range(n) if row not in set(rows.tolist())]


def _missing(row: int, rows: np.ndarray, videos, key_points, verified) -> dict[str, Any]:
    """Why a camera has no place: too little to see in it, or too little in common with the others."""
    counts = {other: len(verified[min(row, other), max(row, other)]) for other in rows.tolist()}
    nearest = max(counts, key=lambda other: counts[other])
    n_points, n = int((key_points[row].moments == 0).sum()), counts[nearest]
    if n_points < FEW_KEY_POINTS:
        reason = f"only {n_points} distinct points in its picture; it may be dark, blurred, or show a plain wall"
    elif n < FEW_MATCHES:
        reason = f"it has at most {n} matches with another camera ({videos[nearest].name}); {FEW_MATCHES} are needed"
    else:
        reason = (
            f"its {n} matches with {videos[nearest].name} do not agree with what the other cameras see; the pattern "
            "may repeat"
        )
    return {"name": videos[row].name, "reason": reason, "nearest": videos[nearest].name, "n_matches": n}
