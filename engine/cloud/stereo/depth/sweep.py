"""Fronto-parallel plane sweep: how badly every plane of every camera matches its neighbours.

Owns source choice, plane spacing and the matching cost. Smoothing and the choice of a depth live in
engine.cloud.stereo.depth.smoothing. Textbook: Collins 1996 (sweep), Hirschmueller & Scharstein 2009 (costs).
Letters: H W working picture size, D planes, S sources of one camera.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.camera.projection import (
    is_in_picture,
    pixel_rays,
    project,
    projection_matrices,
    relative_homography,
    to_world,
)
from engine.camera.rig import CameraRig
from engine.kernels.fast_math import ALL, fast_math

N_SOURCES = 5
PATCH_RADIUS_PX = 2
STD_FLOOR = 3.0
"""Added to the product of standard deviations (grey levels squared): flat patches then vote for nothing."""
GREY_WEIGHT = 0.05
GREY_TRUNCATION = 24.0
UNKNOWN_COST = 1.0
"""Cost of a plane that no source sees: the same as an uncorrelated patch."""
BEST_ANGLES_DEG = (6.0, 18.0)
"""Preferred triangulation angle of a narrow (forward-facing) and of a wide (surrounding) rig."""
NEIGHBOR_SHARE = 0.75
WINDOW_PX = 8
"""Edge of the blocks in which wanted pixels are looked for; each costs a margin of the patch radius."""
WIDEST_ANGLE_DEG = 35.0
"""Preferred triangulation angle at most, where cameras stand far apart."""


def preferred_angle_deg(rig: CameraRig) -> float:
    """Triangulation angle worth aiming for, within BEST_ANGLES_DEG.

    A third of the median angle between a camera's viewing direction and the mean of all; where cameras are too few for
    that, three quarters of the median angle between neighbours.
    """
    mean = rig.forwards.mean(0)
    mean /= max(float(np.linalg.norm(mean)), 1e-9)
    spread = np.degrees(np.arccos(np.clip(rig.forwards @ mean, -1.0, 1.0)))
    preferred = float(np.clip(np.median(spread) / 3.0, *BEST_ANGLES_DEG))
    if len(rig) < 2 or np.ptp(rig.centers, axis=0).max() == 0:
        return preferred
    directions = rig.centers - rig.focus_point()
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-9)
    apart = np.degrees(np.arccos(np.clip(directions @ directions.T, -1.0, 1.0)))
    nearest = float(np.median(np.sort(apart, axis=1)[:, 1]))  # the first is the camera itself
    return min(max(preferred, NEIGHBOR_SHARE * nearest), WIDEST_ANGLE_DEG)


def choose_sources(
    rig: CameraRig, near: np.ndarray, far: np.ndarray, *, n_sources: int = N_SOURCES, angle_deg: float | None = None
) -> list[list[int]]:
    """For every camera the neighbours that share most of its frustum at a useful angle, best first.

    A probe grid of 8 x 6 pixels x 5 depths is projected into every other camera; each point it sees counts with a
    bell of its triangulation angle around `angle_deg`, falling faster towards zero baseline than towards wide ones.
    """
    angle_deg = preferred_angle_deg(rig) if angle_deg is None else angle_deg
    projections, centers = projection_matrices(rig), rig.centers
    chosen = []
    for camera in range(len(rig)):
        points = _probe_points(rig, camera, near[camera], far[camera])
        scores = np.zeros(len(rig))
        for other in range(len(rig)):
            if other == camera:
                continue
            pixels, depths = project(points, projections[other])
            is_seen = is_in_picture(pixels, depths, *rig.image_sizes[other])
            to_camera, to_other = points - centers[camera], points - centers[other]
            lengths = np.linalg.norm(to_camera, axis=1) * np.linalg.norm(to_other, axis=1)
            cosines = (to_camera * to_other).sum(1) / np.maximum(lengths, 1e-12)
            angles = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
            width = np.where(angles < angle_deg, 0.5 * angle_deg, 12.0)
            scores[other] = (is_seen * np.exp(-0.5 * ((angles - angle_deg) / width) ** 2)).mean()
        order = np.argsort(-scores, kind="stable")[:n_sources]
        chosen.append([int(other) for other in order if scores[other] > 0.02])
    return chosen


def _probe_points(rig: CameraRig, camera: int, near: float, far: float) -> np.ndarray:
    """World points on a coarse grid of pixels and inverse depths of one camera. [240, 3]"""
    width, height = rig.image_sizes[camera]
    coarse = rig.Ks[camera].copy()
    coarse[0] *= 8 / width
    coarse[1] *= 6 / height
    rays = pixel_rays(coarse, 8, 6).reshape(-1, 3)
    inverse_depths = 1 / far + (1 / near - 1 / far) * np.array([0.0, 0.125, 0.25, 0.375, 0.625])
    points_camera = (rays[None] / inverse_depths[:, None, None]).reshape(-1, 3)
    return to_world(points_camera, rig.world_to_camera[camera])


def plane_inverse_depths(rig: CameraRig, camera: int, sources: list[int], near: float, far: float) -> np.ndarray:
    """Planes uniform in inverse depth, at most one pixel of disparity apart in the sources. float32 [D], rising.

    Coarser steps skip the match altogether (steps of 3.4 px left a tenth of the points). D is kept in 24..192.
    """
    n_planes = 24.0
    for other in sources:
        matrix, shift = relative_homography(rig, camera, other)
        width, height = rig.image_sizes[camera]
        corners = np.array([[x * width, y * height, 1.0] for x in (0.1, 0.5, 0.9) for y in (0.1, 0.5, 0.9)])
        steps = np.linspace(1 / far, 1 / near, 33)
        track = corners[None] @ matrix.T + steps[:, None, None] * shift
        is_front = track[..., 2] > 1e-3
        pixels = track[..., :2] / np.where(is_front, track[..., 2], 1.0)[..., None]
        jumps = np.linalg.norm(np.diff(pixels, axis=0), axis=-1)
        other_size = rig.image_sizes[other]
        is_inside = is_front & (pixels >= 0).all(-1) & (pixels < other_size).all(-1)
        usable = jumps[is_inside[1:] & is_inside[:-1]]
        if len(usable):
            n_planes = max(n_planes, 32.0 * float(np.percentile(usable, 90)))
    return np.linspace(1 / far, 1 / near, int(np.clip(math.ceil(n_planes) + 1, 24, 192))).astype(np.float32)


def matching_costs(
    greys: np.ndarray,
    is_usable: np.ndarray,
    rig: CameraRig,
    *,
    camera: int,
    sources: list[int],
    inverse_depths: np.ndarray,
    is_wanted: np.ndarray | None = None,
) -> np.ndarray:
    """Cost of every plane at every pixel: mean over the better half of the sources of 1 - ZNCC (+ grey difference).

    Args:
        greys: White-balanced grey pictures of all cameras, 0..255. [C, H, W] float32
        is_usable: False where a background cannot be trusted. [C, H, W] bool
        rig: At the size of greys.
        is_wanted: Pixels whose costs are needed; of the others, only some get any. None for all. [H, W] bool
    Returns:
        float32 [H, W, D], about 0 (match) to 1 (no relation); UNKNOWN_COST where nothing can be said.
    """
    height, width = greys.shape[1:]
    costs = np.full((height, width, len(inverse_depths)), UNKNOWN_COST, dtype=np.float32)
    if not sources:
        return costs
    pairs = [relative_homography(rig, camera, other) for other in sources]
    matrices = np.stack([pair[0] for pair in pairs]).astype(np.float32)
    shifts = np.stack([pair[1] for pair in pairs]).astype(np.float32)
    sides = [np.ascontiguousarray(greys[other]) for other in sources], [is_usable[other] for other in sources]
    for top, bottom, left, right in [(0, height, 0, width)] if is_wanted is None else _windows(is_wanted):
        # a window is a small picture of its own, with a margin for the patches at its border
        y0, x0 = max(0, top - PATCH_RADIUS_PX), max(0, left - PATCH_RADIUS_PX)
        y1, x1 = min(height, bottom + PATCH_RADIUS_PX), min(width, right + PATCH_RADIUS_PX)
        move = np.array([[1, 0, x0], [0, 1, y0], [0, 0, 1]], dtype=np.float32)
        reference = np.ascontiguousarray(greys[camera, y0:y1, x0:x1])
        found = _window_costs(reference, *sides, matrices @ move, shifts, inverse_depths)
        costs[top:bottom, left:right] = found[top - y0 : bottom - y0, left - x0 : right - x0]
    costs[~is_usable[camera]] = UNKNOWN_COST
    return costs


def _windows(is_wanted: np.ndarray) -> list[tuple[int, int, int, int]]:
    """Blocks that cover the wanted pixels, those side by side joined: (top, bottom, left, right), without overlap."""
    height, width = is_wanted.shape
    found = []
    for top in range(0, height, WINDOW_PX):
        bottom = min(top + WINDOW_PX, height)
        padded = np.zeros(-(-width // WINDOW_PX) * WINDOW_PX, dtype=np.int8)
        padded[:width] = is_wanted[top:bottom].any(axis=0)
        steps = np.diff(padded.reshape(-1, WINDOW_PX).any(axis=1).astype(np.int8), prepend=0, append=0)
        for first, last in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1), strict=True):
            found.append((top, bottom, int(first) * WINDOW_PX, min(int(last) * WINDOW_PX, width)))
    return found


def _window_costs(
    reference: np.ndarray,
    sources: list[np.ndarray],
    are_usable: list[np.ndarray],
    matrices: np.ndarray,
    shifts: np.ndarray,
    inverse_depths: np.ndarray,
) -> np.ndarray:
    """Costs of a picture, or of a piece of one, against whole sources. float32 [h, w, D]"""
    height, width = reference.shape
    costs = np.full((height, width, len(inverse_depths)), UNKNOWN_COST, dtype=np.float32)
    moments, sums = np.empty((2, 6, height, width), np.float32)
    source_costs = np.empty((len(sources), height, width), np.float32)
    ranked = np.empty(len(sources), np.float32)
    for d, inverse_depth in enumerate(inverse_depths):
        for s, (source, usable) in enumerate(zip(sources, are_usable, strict=True)):
            _warped_moments(reference, source, usable, matrices[s], shifts[s] * inverse_depth, moments)
            _patch_sums(moments, sums)
            _zncc_cost(sums, source_costs[s])
        _mean_of_best_half(source_costs, ranked, costs, d)
    return costs


@njit(cache=True, nogil=True, error_model="numpy", fastmath=fast_math(*ALL))
def _warped_moments(reference, source, is_usable, matrix, shift, moments):
    """Per pixel: seen, warped grey, its square, product with the reference, reference, its square (0 if unseen)."""
    height, width = reference.shape
    source_height, source_width = source.shape
    half, one = np.float32(0.5), np.float32(1)
    for y in range(height):
        v = np.float32(y) + half
        base_x = matrix[0, 1] * v + matrix[0, 2] + shift[0]
        base_y = matrix[1, 1] * v + matrix[1, 2] + shift[1]
        base_w = matrix[2, 1] * v + matrix[2, 2] + shift[2]
        for x in range(width):
            u = np.float32(x) + half
            w = base_w + matrix[2, 0] * u
            seen, grey = np.float32(0), np.float32(0)
            if w > np.float32(1e-6):
                sx = (base_x + matrix[0, 0] * u) / w - half
                sy = (base_y + matrix[1, 0] * u) / w - half
                if sx >= 0 and sy >= 0 and sx < np.float32(source_width - 1) and sy < np.float32(source_height - 1):
                    ix, iy = int(sx), int(sy)
                    if is_usable[iy, ix]:
                        fx, fy = sx - np.float32(ix), sy - np.float32(iy)
                        top = source[iy, ix] * (one - fx) + source[iy, ix + 1] * fx
                        low = source[iy + 1, ix] * (one - fx) + source[iy + 1, ix + 1] * fx
                        grey = top * (one - fy) + low * fy - np.float32(128)  # centred: float32 sums stay exact enough
                        seen = one
            own = (reference[y, x] - np.float32(128)) * seen
            moments[0, y, x] = seen
            moments[1, y, x] = grey
            moments[2, y, x] = grey * grey
            moments[3, y, x] = grey * own
            moments[4, y, x] = own
            moments[5, y, x] = own * own


@njit(cache=True, nogil=True, error_model="numpy", fastmath=fast_math(*ALL))
def _patch_sums(moments, sums):
    """Sums over the square patch; patches are cut at the border."""
    _, height, width = moments.shape
    line = np.empty(width, np.float32)  # made here, it is known to overlap with nothing
    for m in range(6):
        for y in range(height):
            for x in range(width):
                line[x] = np.float32(0)
            for row in range(max(0, y - PATCH_RADIUS_PX), min(height, y + PATCH_RADIUS_PX + 1)):
                for x in range(width):
                    line[x] += moments[m, row, x]
            for x in range(width):
                sums[m, y, x] = line[x]
            for offset in range(1, PATCH_RADIUS_PX + 1):
                for x in range(width - offset):
                    sums[m, y, x] += line[x + offset]
                for x in range(offset, width):
                    sums[m, y, x] += line[x - offset]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=fast_math(*ALL))
def _zncc_cost(sums, costs):
    """Negative where fewer than 60 % of the patch is seen (no vote)."""
    _, height, width = sums.shape
    n_needed = np.float32(0.6 * (2 * PATCH_RADIUS_PX + 1) ** 2)
    zero, one = np.float32(0), np.float32(1)
    for y in range(height):
        for x in range(width):
            n_seen = sums[0, y, x]
            if n_seen < n_needed:
                costs[y, x] = np.float32(-1)
                continue
            inv = one / n_seen
            mean_source, mean_own = sums[1, y, x] * inv, sums[4, y, x] * inv
            var_source = max(sums[2, y, x] * inv - mean_source * mean_source, zero)
            var_own = max(sums[5, y, x] * inv - mean_own * mean_own, zero)
            covariance = sums[3, y, x] * inv - mean_source * mean_own
            similarity = covariance / (math.sqrt(var_source * var_own) + np.float32(STD_FLOOR))
            grey = min(abs(mean_source - mean_own), np.float32(GREY_TRUNCATION)) / np.float32(GREY_TRUNCATION)
            costs[y, x] = min(one - similarity, one) + np.float32(GREY_WEIGHT) * grey


@njit(cache=True, nogil=True, error_model="numpy", fastmath=fast_math(*ALL))
def _mean_of_best_half(source_costs, ranked, costs, d):
    """The better half of the voting sources: the others may be occluded. A lone vote counts half.

    ranked [sources] is scratch.
    """
    n_sources, height, width = source_costs.shape
    for y in range(height):
        for x in range(width):
            n = 0
            for s in range(n_sources):
                cost = source_costs[s, y, x]
                if cost >= 0:
                    j = n
                    while j > 0 and ranked[j - 1] > cost:
                        ranked[j] = ranked[j - 1]
                        j -= 1
                    ranked[j] = cost
                    n += 1
            if n == 1:
                costs[y, x, d] = np.float32(0.5) * ranked[0] + np.float32(0.4)
            elif n > 1:
                half = (n + 1) // 2
                total = np.float32(0)
                for j in range(half):
                    total += ranked[j]
                costs[y, x, d] = total / np.float32(half)
