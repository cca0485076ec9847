"""From a solution to what is handed back: world, scale, figures per camera, and why cameras are missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.calibration.calibrated import CalibratedRig, Calibration, MissingCamera
from engine.calibration.matching.matching import KeyPoints, Pair, all_pairs
from engine.calibration.options import CalibrationOptions
from engine.calibration.pair_lines import FEW_MATCHES, PairCounts
from engine.calibration.solving.agreement import MIN_AGREEING, MatchAgreement, agreement
from engine.calibration.solving.cameras import Cameras
from engine.calibration.solving.links import is_held, surrounds
from engine.calibration.solving.solving import CalibrationSolution
from engine.calibration.solving.strain import is_strained
from engine.calibration.solving.world import find_up, known_scale, unit_scale, upright
from engine.calibration.videos import MIN_CAMERAS, PlainVideo
from engine.camera.lens import Lens, LensModel
from engine.camera.rig import CameraRig

FEW_KEY_POINTS = 150
WEAK_SIGHTINGS = 60
MAX_DOUBTFUL = 0.25
"""Share of the cameras that were found. Where matches contradict more, whole groups of cameras have been found in wrong
places, and those that agree may be such a group."""
MIN_FAR_SHARE = 0.5
"""Of all cameras far apart, that have to hold together: a few neighbours do not make a rig."""
FAR = (
    "Neighbouring cameras are far apart; they were found from what moves, pair by pair. Directions may be off by 3 "
    "degrees and positions by 4 % of the rig's radius; a board finds them exactly."
)
LENS_MODEL: dict[str, LensModel] = {"simple": "opencv", "opencv": "opencv", "fisheye": "fisheye"}
"""Names of engine.camera.lens."""


def finished(
    solution: CalibrationSolution,
    videos: list[PlainVideo],
    key_points: list[KeyPoints],
    verified: dict[Pair, np.ndarray],
    sizes: np.ndarray,
    options: CalibrationOptions,
    *,
    is_far: bool = False,
) -> Calibration:
    """The part of a solution to hand back. is_far: Whether cameras were joined pair by pair, being far apart."""
    rows, tracks, errors = solution.rows, solution.tracks, solution.errors
    names = [videos[row].name for row in rows]
    warnings: list[str] = []
    scale, is_metric = _scale(solution.cameras, tracks.points, names, options, warnings)
    up, origin, up_from = find_up(solution.cameras, tracks.points, options.up)
    if up_from != options.up:
        warnings.append("No floor was found below the cameras; up is the upper edge of most cameras' pictures.")
    cameras, points = upright(solution.cameras, tracks.points, up, origin, scale)
    n_sightings = np.bincount(tracks.seen.cameras, minlength=len(rows))
    agreed = agreement(rows, solution.cameras, key_points, verified, float(sizes.max()))
    if is_far:
        held = is_held(agreed, tracks)
        agreed = replace(agreed, held=held & surrounds(cameras.rotations[held]) if held.any() else held)
        warnings.append(FAR)
    strained = is_strained(rows, solution.cameras, key_points, verified, sizes, agreed.is_firm)
    doubts = _doubts(names, n_sightings, agreed, strained)
    native = np.array([videos[row].size for row in rows], dtype=np.int64)
    found = CalibratedRig(
        rig=CameraRig(tuple(names), poses(cameras), matrices(cameras, native / sizes[rows]), native),
        lenses=lenses(cameras),
        points=points,
        point_errors_px=_means(errors, tracks.seen.points, len(points)),
        camera_errors_px=medians(errors, tracks.seen.cameras, len(rows)) * (native / sizes[rows])[:, 0],
        n_sightings=n_sightings,
        explained_shares=agreed.shares,
        doubts=tuple(doubts),
        is_metric=is_metric,
        up=up_from,
    )
    missing = tuple(_missing(row, rows, videos, key_points, verified) for row in _absent(rows, len(videos)))
    n_least = max(MIN_CAMERAS, MIN_FAR_SHARE * len(videos)) if is_far else MIN_CAMERAS
    return Calibration(found, missing, tuple(warnings), _failure(agreed, n_least), _pairs(names, agreed))


def _doubts(names: list[str], n_sightings: np.ndarray, agreed: MatchAgreement, strained: np.ndarray) -> list[str]:
    """Why each camera may be misplaced; empty for those that nothing speaks against."""
    is_placed, doubts = agreed.is_placed, []
    for row, n in enumerate(n_sightings.tolist()):
        partners = [names[other] for other in np.flatnonzero(agreed.is_firm[row])]
        if is_placed[row] and strained[row]:
            doubts.append(
                "its lens was distorted to make its position fit: its matches miss and its principal point is far off"
            )
        elif is_placed[row]:
            doubts.append(f"only {n} points" if n < WEAK_SIGHTINGS else "")
        elif not partners:
            doubts.append(f"no camera agrees with its position; {_strongest(row, names, agreed)}")
        elif len(partners) < MIN_AGREEING:
            doubts.append(f"one camera agrees with its position ({partners[0]}); {MIN_AGREEING} are needed")
        else:
            doubts.append(f"those that agree with its position ({', '.join(partners)}) do not agree with the others")
    return doubts


def _strongest(row: int, names: list[str], agreed: MatchAgreement) -> str:
    other = int(agreed.n_matches[row].argmax())
    n, n_explained = int(agreed.n_matches[row, other]), int(agreed.n_explained[row, other])
    return f"{n_explained} of its {n} matches with {names[other]} are explained"


def _failure(agreed: MatchAgreement, n_least: float = MIN_CAMERAS) -> str:
    """Why nothing of it can be trusted; empty where most cameras hold together, and at least so many."""
    n, n_placed = len(agreed.is_placed), int(agreed.is_placed.sum())
    if n_placed >= max(n_least, (1 - MAX_DOUBTFUL) * n):
        return ""
    if n_placed >= (1 - MAX_DOUBTFUL) * n:
        return f"Only {n_placed} cameras hold together, so none of them can be trusted."
    return f"Matches contradict the positions of {n - n_placed} of {n} cameras, so none of them can be trusted."


def _pairs(names: list[str], agreed: MatchAgreement) -> tuple[PairCounts, ...]:
    return tuple(
        PairCounts(names[a], names[b], int(agreed.n_matches[a, b]), int(agreed.n_explained[a, b]))
        for a, b in all_pairs(len(names))
    )


def _scale(cameras: Cameras, points, names: list[str], options: CalibrationOptions, warnings: list[str]):
    known = options.distance
    if known is None:
        return unit_scale(cameras, points), False
    if known.first not in names or known.second not in names:
        missing = known.first if known.first not in names else known.second
        warnings.append(f"The known distance was not used: camera {missing} was not found.")
        return unit_scale(cameras, points), False
    return known_scale(cameras, names.index(known.first), names.index(known.second), known.metres), True


def lenses(cameras: Cameras) -> tuple[Lens, ...]:
    """Their lenses as captures have them."""
    return tuple(Lens(LENS_MODEL[cameras.lens], tuple(row)) for row in cameras.lens_params.tolist())


def poses(cameras: Cameras) -> np.ndarray:
    """World to camera. [C, 4, 4]"""
    poses = np.tile(np.eye(4), (len(cameras), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = cameras.rotations, cameras.translations
    return poses


def matrices(cameras: Cameras, ratios: np.ndarray) -> np.ndarray:
    """Intrinsics at the size of the videos; pixel centres lie at +0.5, so everything scales. [C, 3, 3]"""
    Ks = np.tile(np.eye(3), (len(cameras), 1, 1))
    focals, principal = cameras.focals_xy * ratios, cameras.principal * ratios
    Ks[:, 0, 0], Ks[:, 1, 1] = focals.T
    Ks[:, 0, 2], Ks[:, 1, 2] = principal.T
    return Ks


def _means(values: np.ndarray, groups: np.ndarray, n: int) -> np.ndarray:
    return np.bincount(groups, values, minlength=n) / np.maximum(np.bincount(groups, minlength=n), 1)


def medians(values: np.ndarray, groups: np.ndarray, n: int) -> np.ndarray:
    """Of the values [N] of each of n groups [N]; infinite where one has none. [n]"""
    return np.array([np.median(values[groups == i]) if (groups == i).any() else np.inf for i in range(n)])


def _absent(rows: np.ndarray, n: int) -> list[int]:
    return [row for row in range(n) if row not in set(rows.tolist())]


def _missing(row: int, rows: np.ndarray, videos, key_points, verified) -> MissingCamera:
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
    return MissingCamera(videos[row].name, reason, videos[nearest].name, n)
