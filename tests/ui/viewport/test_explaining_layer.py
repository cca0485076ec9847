"""Spheres as circles: each touches its sphere where it is seen, and there are never too many."""

from __future__ import annotations

import numpy as np

from ui.viewport.layers.explaining_layer import MAX_SPHERES, N_SEGMENTS, sphere_outlines


def test_an_outline_is_where_lines_of_sight_touch_the_sphere() -> None:
    random = np.random.default_rng(0)
    centers, radii, eye = random.normal(size=(9, 3)), random.uniform(0.05, 0.4, 9), np.array([0.5, -6.0, 1.0])
    vertices, colors = sphere_outlines(centers, radii, eye)
    assert len(vertices) == len(colors) == 9 * N_SEGMENTS * 2
    points = vertices.reshape(9, -1, 3)
    offsets = points - centers[:, None]
    np.testing.assert_allclose(
        np.linalg.norm(offsets, axis=2), np.repeat(radii[:, None], points.shape[1], 1), rtol=1e-4
    )
    np.testing.assert_allclose(((eye - points) * offsets).sum(-1), 0.0, atol=1e-4)


def test_spheres_around_the_eye_and_points_have_no_outline() -> None:
    centers = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 3.0], [0.0, 0.0, 0.0]])
    radii = np.array([1.0, 0.0, 0.5])
    vertices, _ = sphere_outlines(centers, radii, np.array([0.0, 0.0, 0.6]))
    assert len(vertices) == N_SEGMENTS * 2


def test_many_spheres_are_thinned() -> None:
    centers = np.random.default_rng(1).normal(size=(3 * MAX_SPHERES, 3))
    vertices, _ = sphere_outlines(centers, np.full(len(centers), 0.01), np.array([9.0, 0.0, 0.0]))
    assert len(vertices) == MAX_SPHERES * N_SEGMENTS * 2
