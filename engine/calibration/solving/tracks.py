"""Tracks: matches joined over many cameras, and the points they show, with what does not fit left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from engine.calibration.matching.matching import KeyPoints, Pair, epipolar_px
from engine.calibration.solving.bundle import Observations, errors_px
from engine.calibration.solving.cameras import Cameras

MIN_ANGLE_DEG = 1.5
"""Between the rays to a point: less says nothing about its distance."""


@dataclass(frozen=True, slots=True)
class Tracks:
    """Points [M, 3] and where they were seen; every point by at least two cameras."""

    points: np.ndarray
    seen: Observations

    @staticmethod
    def none() -> Tracks:
        """No tracks."""
        return Tracks(np.zeros((0, 3)), Observations(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2))))


def fitting_matches(
    matches: dict[Pair, np.ndarray], key_points: list[KeyPoints], cameras: Cameras, reach_px: float
) -> dict[Pair, np.ndarray]:
    """Matches whose two ends lie within reach_px of each other's epipolar line."""
    planes = [cameras.plane(row, points.pixels) for row, points in enumerate(key_points)]
    kept = {}
    for pair, rows in matches.items():
        off = epipolar_px(cameras, pair, planes[pair[0]][rows[:, 0]], planes[pair[1]][rows[:, 1]])
        kept[pair] = rows[off <= reach_px]
    return kept


def build_tracks(
    matches: dict[Pair, np.ndarray], key_points: list[KeyPoints], cameras: Cameras, reach_px: float
) -> Tracks:
    """Join matches to tracks, triangulate them, leave out sightings farther than reach_px from their point.

    Each match of a track proposes a point; the one that most sightings of the track agree with wins, so that a wrong
    match costs a sighting and not the track.
    """
    offsets = np.concatenate([[0], np.cumsum([len(points) for points in key_points])])
    edges = [(pair, rows) for pair, rows in sorted(matches.items()) if len(rows)]
    if not edges:
        return Tracks.none()
    a = np.concatenate([rows[:, 0] + offsets[pair[0]] for pair, rows in edges])
    b = np.concatenate([rows[:, 1] + offsets[pair[1]] for pair, rows in edges])
    graph = sparse.coo_matrix((np.ones(len(a)), (a, b)), shape=(offsets[-1], offsets[-1]))
    _, labels = connected_components(graph, directed=False)
    nodes = np.unique(np.concatenate([a, b]))
    tracks, members = np.unique(labels[nodes], return_inverse=True)
    camera_of = np.repeat(np.arange(len(key_points)), np.diff(offsets))
    pixels = np.concatenate([points.pixels for points in key_points])
    planes = np.concatenate([cameras.plane(row, points.pixels) for row, points in enumerate(key_points)])
    seen = Observations(camera_of[nodes], members, pixels[nodes])
    proposals = midpoints(cameras, camera_of[a], planes[a], camera_of[b], planes[b])
    owner = np.searchsorted(tracks, labels[a])
    best = _best_proposal(proposals, owner, seen, cameras, reach_px, len(tracks))
    has_point = best >= 0
    points = proposals[np.maximum(best, 0)]
    return cleaned(cameras, points, seen.chosen(has_point[seen.points]), reach_px)


def midpoints(cameras: Cameras, a: np.ndarray, plane_a: np.ndarray, b: np.ndarray, plane_b: np.ndarray) -> np.ndarray:
    """Points nearest to two rays each, of cameras a and b [N]. [N, 3]"""
    centers = cameras.centers
    rays = []
    for rows, plane in ((a, plane_a), (b, plane_b)):
        ray = np.einsum("nji,nj->ni", cameras.rotations[rows], np.concatenate([plane, np.ones((len(plane), 1))], 1))
        rays.append(ray / np.linalg.norm(ray, axis=-1, keepdims=True))
    baseline = centers[b] - centers[a]
    cosine = (rays[0] * rays[1]).sum(-1)
    along_a, along_b = (rays[0] * baseline).sum(-1), (rays[1] * baseline).sum(-1)
    sine2 = np.maximum(1 - cosine**2, 1e-12)
    reach_a = (along_a - cosine * along_b) / sine2
    reach_b = (cosine * along_a - along_b) / sine2
    return (centers[a] + reach_a[:, None] * rays[0] + centers[b] + reach_b[:, None] * rays[1]) / 2


def cleaned(cameras: Cameras, points: np.ndarray, seen: Observations, reach_px: float) -> Tracks:
    """Without sightings that do not fit, second sightings by one camera, and points too few or too narrow."""
    errors = errors_px(cameras, points, seen)
    order = np.lexsort([errors, seen.cameras, seen.points])
    first = np.ones(len(order), bool)
    first[1:] = (np.diff(seen.points[order]) != 0) | (np.diff(seen.cameras[order]) != 0)
    kept = np.sort(order[first])
    kept = kept[errors[kept] <= reach_px]
    seen = Observations(seen.cameras[kept], seen.points[kept], seen.pixels[kept])
    is_good = np.bincount(seen.points, minlength=len(points)) >= 2
    is_good &= widest_angles_deg(cameras, points, seen) >= MIN_ANGLE_DEG
    is_good &= np.isfinite(points).all(1)
    numbers = np.cumsum(is_good) - 1
    seen = seen.chosen(is_good[seen.points])
    return Tracks(points[is_good], Observations(seen.cameras, numbers[seen.points], seen.pixels))


def widest_angles_deg(cameras: Cameras, points: np.ndarray, seen: Observations) -> np.ndarray:
    """Twice the largest angle between a ray to a point and the mean of its rays: at most the widest there is. [M]"""
    rays = points[seen.points] - cameras.centers[seen.cameras]
    rays /= np.maximum(np.linalg.norm(rays, axis=-1, keepdims=True), 1e-12)
    sums = np.stack([np.bincount(seen.points, column, minlength=len(points)) for column in rays.T], axis=-1)
    mean = sums / np.maximum(np.linalg.norm(sums, axis=-1, keepdims=True), 1e-12)
    widest = np.zeros(len(points))
    chord = np.linalg.norm(rays - mean[seen.points], axis=-1)
    np.maximum.at(widest, seen.points, 2 * np.degrees(2 * np.arcsin(np.clip(chord / 2, 0, 1))))
    return widest


def _best_proposal(proposals, owner, seen, cameras, reach_px, n_tracks) -> np.ndarray:
    """Row of the proposal that most sightings of its track agree with; -1 where none has two. [tracks]"""
    by_track = np.argsort(seen.points, kind="stable")
    counts = np.bincount(seen.points, minlength=n_tracks)
    starts = np.cumsum(counts) - counts
    sizes = counts[owner]
    rows = np.repeat(np.arange(len(proposals)), sizes)
    within = np.arange(len(rows)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    nodes = by_track[starts[owner[rows]] + within]
    errors = errors_px(cameras, proposals, Observations(seen.cameras[nodes], rows, seen.pixels[nodes]))
    gains = np.maximum(1 - (errors / reach_px) ** 2, 0.0)
    score = np.bincount(rows, gains, minlength=len(proposals))
    n_agree = np.bincount(rows, errors <= reach_px, minlength=len(proposals))
    order = np.lexsort([-score, owner])
    firsts = order[np.concatenate([[True], np.diff(owner[order]) != 0])]
    best = np.full(n_tracks, -1)
    best[owner[firsts]] = np.where(n_agree[firsts] >= 2, firsts, -1)
    return best
