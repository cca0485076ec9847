"""Slanted patches: their cost against a plain float64 one, and planes that the sweep cannot follow."""

from __future__ import annotations

import numpy as np
import pytest

from app.lab.synthetic.rigs import rig_at
from app.lab.synthetic.textures import noise
from engine.camera.projection import pixel_rays, project, projection_matrices, to_world, unproject
from engine.camera.rig import CameraRig
from engine.cloud.stereo.depth import slanted
from engine.cloud.stereo.depth.slanted import refine_slanted
from engine.cloud.stereo.depth.sweep import GREY_TRUNCATION, GREY_WEIGHT, STD_FLOOR, UNKNOWN_COST

SIZE = (48, 36)
LOW, HIGH = 1 / 6.0, 1 / 1.5


@pytest.fixture(scope="module")
def rig() -> CameraRig:
    """Three cameras 30 degrees apart, high over the floor."""
    angles = np.radians([-120.0, -90.0, -60.0])
    return rig_at(np.column_stack([2.5 * np.cos(angles), 2.5 * np.sin(angles), [1.2, 1.3, 1.2]]), SIZE)


@pytest.fixture(scope="module")
def floor(rig: CameraRig) -> tuple[np.ndarray, np.ndarray]:
    """Greys [C, H, W] float32 of a floor with texture at z = 0, and inverse depths [C, H, W]; 0 above the horizon."""
    greys, inverse = [], []
    for camera in range(len(rig)):
        rays = pixel_rays(rig.Ks[camera], *SIZE)
        directions = to_world(rays.reshape(-1, 3), rig.world_to_camera[camera]) - rig.centers[camera]
        found = (-directions[:, 2] / rig.centers[camera, 2]).reshape(SIZE[::-1])
        depths = 1 / np.maximum(found, LOW)
        points = unproject(depths, rig.Ks[camera], rig.world_to_camera[camera])
        greys.append(60 + 140 * noise(points[..., :2] * 4.0, 3))
        inverse.append(np.maximum(found, 0))
    return np.stack(greys).astype(np.float32), np.stack(inverse)


def refine(rig: CameraRig, greys: np.ndarray, prior: np.ndarray, **changes) -> tuple[np.ndarray, np.ndarray]:
    arguments = {"is_usable": np.ones(greys.shape, bool), "camera": 1, "sources": [0, 2], "seeds": prior[None]}
    return refine_slanted(greys, rig=rig, prior=prior, low=LOW, high=HIGH, **(arguments | changes))


def test_a_floor_is_found_from_a_flat_beginning(rig: CameraRig, floor: tuple[np.ndarray, np.ndarray]) -> None:
    greys, truth = floor
    inverse, costs = refine(rig, greys, np.full(SIZE[::-1], 1 / 2.8))
    is_floor = truth[1] > 1 / 4.0
    is_floor[:, :6] = is_floor[:, -6:] = is_floor[-6:] = False
    error = np.abs(inverse / np.maximum(truth[1], LOW) - 1)[is_floor]
    assert is_floor.mean() > 0.2
    assert np.median(error) < 0.01
    assert (error < 0.03).mean() > 0.85
    assert np.median(costs[is_floor]) < 0.2
    assert LOW <= inverse.min() <= inverse.max() <= HIGH


def test_the_outcome_is_the_same_each_time(rig: CameraRig, floor: tuple[np.ndarray, np.ndarray]) -> None:
    first, second = (refine(rig, floor[0], np.full(SIZE[::-1], 1 / 2.8)) for _ in range(2))
    assert np.array_equal(first[0], second[0])
    assert np.array_equal(first[1], second[1])


def test_without_texture_depths_stay_as_they_were(rig: CameraRig) -> None:
    prior = np.tile(np.linspace(1 / 3.0, 1 / 2.5, SIZE[0]), (SIZE[1], 1))
    inverse, _ = refine(rig, np.full((3, *SIZE[::-1]), 128, np.float32), prior)
    assert np.abs(inverse / prior - 1).max() < 0.02


def test_nothing_to_compare_with_leaves_the_beginning(rig: CameraRig, floor: tuple[np.ndarray, np.ndarray]) -> None:
    prior = np.full(SIZE[::-1], 1 / 2.8)
    inverse, costs = refine(rig, floor[0], prior, sources=[])
    assert np.array_equal(inverse, prior)
    assert (costs == UNKNOWN_COST).all()
    inverse, costs = refine(rig, floor[0], prior, is_usable=np.zeros(floor[0].shape, bool))
    assert np.allclose(inverse, prior)
    assert np.allclose(costs, UNKNOWN_COST)


@pytest.mark.parametrize(("x", "y"), [(24, 25), (1, 33), (40, 20)])
def test_the_cost_of_a_patch_is_that_of_plain_sums(
    rig: CameraRig, floor: tuple[np.ndarray, np.ndarray], x: int, y: int
) -> None:
    grey, source = floor[0][1], floor[0][2]
    plane = np.array([1 / 2.6, 0.001, 0.008])
    n_most = (2 * (slanted.RADIUS_PX // slanted.STRIDE_PX) + 1) ** 2
    own, weights, places = np.empty(n_most), np.empty(n_most), np.empty((n_most, 2))
    n, n_weight = slanted._gather(grey, x, y, own, weights, places)
    patch = own, weights, places, n, n_weight
    matrix, shift = slanted.relative_homography(rig, 1, 2)
    found = slanted._source_cost(patch, source, np.ones(source.shape, bool), matrix, shift, x, y, plane)
    assert found == pytest.approx(plain_cost(rig, grey.astype(float), source.astype(float), x, y, plane), abs=1e-9)


def plain_cost(rig: CameraRig, grey: np.ndarray, source: np.ndarray, x: int, y: int, plane: np.ndarray) -> float:
    """The same, by way of points in space; -1 without a vote."""
    total, rows = 0.0, []
    for j in range(-slanted.RADIUS_PX, slanted.RADIUS_PX + 1, slanted.STRIDE_PX):
        for i in range(-slanted.RADIUS_PX, slanted.RADIUS_PX + 1, slanted.STRIDE_PX):
            if not (0 <= x + i < SIZE[0] and 0 <= y + j < SIZE[1]):
                continue
            edge = abs(grey[y + j, x + i] - grey[y, x]) / slanted.EDGE_GREY_LEVELS
            weight = np.exp(-edge - np.hypot(i, j) / slanted.RADIUS_PX)
            total += weight
            ray = np.linalg.inv(rig.Ks[1]) @ [x + i + 0.5, y + j + 0.5, 1.0]
            point = to_world(ray[None] / (plane @ [1, i, j]), rig.world_to_camera[1])
            pixels, depths = project(point, projection_matrices(rig)[2])
            u, v = pixels[0] - 0.5
            if depths[0] <= 0 or not (0 <= u < SIZE[0] - 1 and 0 <= v < SIZE[1] - 1):
                continue
            c, r = int(u), int(v)
            top = source[r, c] + (u - c) * (source[r, c + 1] - source[r, c])
            low = source[r + 1, c] + (u - c) * (source[r + 1, c + 1] - source[r + 1, c])
            rows.append((weight, grey[y + j, x + i], top + (v - r) * (low - top)))
    weights, mine, theirs = np.array(rows).T
    if weights.sum() < slanted.MIN_SEEN * total:
        return -1.0
    mean, other = np.average(mine, weights=weights), np.average(theirs, weights=weights)
    spread = np.sqrt(
        np.average((mine - mean) ** 2, weights=weights) * np.average((theirs - other) ** 2, weights=weights)
    )
    likeness = np.average((mine - mean) * (theirs - other), weights=weights) / (spread + STD_FLOOR)
    return min(1 - likeness, 1.0) + GREY_WEIGHT * min(abs(mean - other), GREY_TRUNCATION) / GREY_TRUNCATION


def test_pixels_that_are_not_wanted_keep_the_first_seed(rig: CameraRig, floor: tuple[np.ndarray, np.ndarray]) -> None:
    greys, truth = floor
    known = np.maximum(truth[1], LOW)
    is_wanted = np.zeros(SIZE[::-1], dtype=bool)
    is_wanted[20:28, 14:34] = True
    prior = np.where(is_wanted, 1 / 4.5, known)
    inverse, _ = refine(rig, greys, prior, is_wanted=is_wanted)
    assert np.array_equal(inverse[~is_wanted], prior[~is_wanted])
    assert np.median(np.abs(inverse / known - 1)[is_wanted]) < 0.01
