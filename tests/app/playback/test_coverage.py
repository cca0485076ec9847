"""What inherited anchors cover, and how far residual anchors lie from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.playback.modes.arrays import AnchorArrays
from app.playback.modes.coverage import CoverageRequest, coverage_of
from engine.clip_files.roles import ROLES


def anchors(moving: np.ndarray, residual: np.ndarray, *, role: str = "moving") -> AnchorArrays:
    """Of a source clip: static ones, these, and residual ones."""
    static = np.zeros((2, 3), np.float32)
    inherited = moving if role == "moving" else moving[:0]
    own = np.concatenate([moving[:0] if role == "moving" else moving, residual])
    n_adapted = len(own) - len(residual)
    return AnchorArrays(
        np.concatenate([static, inherited]).astype(np.float32),
        own.astype(np.float32),
        ("anchors", role),
        inherited_roles=np.array([0, 0] + [ROLES.index("moving")] * len(inherited), np.uint8),
        own_roles=np.array([ROLES.index("adapted")] * n_adapted + [ROLES.index("residual")] * len(residual), np.uint8),
    )


@pytest.mark.parametrize("role", ["moving", "adapted"])
def test_distances_are_those_to_the_union_of_spheres(role: str) -> None:
    random = np.random.default_rng(0)
    centers, points = random.random((40, 3)), random.random((25, 3)) * 1.4 - 0.2
    found = coverage_of(CoverageRequest("key", anchors(centers, points, role=role)))
    centers = centers.astype(np.float32)
    apart = np.linalg.norm(centers[:, None] - centers[None], axis=2)
    radii = np.sort(apart, axis=1)[:, 1:4].mean(axis=1)
    np.testing.assert_allclose(found.radii, radii, rtol=1e-5)
    expected = (np.linalg.norm(points.astype(np.float32)[:, None] - centers[None], axis=2) - radii).min(axis=1)
    np.testing.assert_allclose(found.distances, expected, atol=1e-5)
    assert (found.distances < 0).any()
    assert (found.distances > 0).any()
    assert found.range == pytest.approx(10 * np.median(radii), rel=0.05)


def test_a_reference_clip_covers_nothing_of_another_one() -> None:
    own = np.random.default_rng(1).random((6, 3)).astype(np.float32)
    roles = np.full(6, ROLES.index("moving"), np.uint8)
    reference_anchors = AnchorArrays(own[:0], own, "key", np.zeros(0, np.uint8), roles)
    found = coverage_of(CoverageRequest("key", reference_anchors))
    assert len(found.centers) == len(found.points) == 0
    assert found.range == 1.0


def test_points_without_any_sphere_are_infinitely_far() -> None:
    found = coverage_of(CoverageRequest("key", anchors(np.zeros((0, 3)), np.ones((2, 3)))))
    assert np.isposinf(found.distances).all()


def test_static_anchors_that_change_have_spheres_too() -> None:
    plain = anchors(np.random.default_rng(2).random((5, 3)), np.ones((2, 3)))
    found, all_of_them = (
        coverage_of(CoverageRequest("key", replace(plain, has_changing_static=does_change)))
        for does_change in (False, True)
    )
    assert len(found.centers) == 5
    np.testing.assert_array_equal(all_of_them.centers, plain.inherited_positions)
    assert (all_of_them.distances <= found.distances).any()
