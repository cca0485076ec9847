"""Rows that files can hold: what is dropped, and what is made fit."""

from __future__ import annotations

import numpy as np
import torch

from engine.export.splats import OPACITY_MARGIN, Splats, colors_of, opacities_of
from engine.raster.gaussians import Gaussians
from tests.engine.export.scenes import chance_splats, one_splat


def test_rows_that_cannot_be_drawn_are_dropped_and_counted():
    columns = {
        name: getattr(chance_splats(8), name).copy() for name in ("means", "quats", "scales", "opacities", "colors")
    }
    columns["means"][0, 1] = np.nan
    columns["means"][1, 0] = np.inf
    columns["quats"][2] = 0.0
    columns["scales"][3] = 0.0
    columns["scales"][4, 2] = -0.1
    columns["opacities"][5] = np.nan
    columns["colors"][6, 0] = -np.inf
    found = Splats.from_arrays(*columns.values())
    assert (len(found), found.n_dropped) == (1, 7)
    np.testing.assert_array_equal(found.means, columns["means"][7:])


def test_numbers_beyond_float32_are_dropped():
    found = Splats.from_arrays(
        np.array([[1e39, 0, 0], [0, 0, 0]]), np.ones((2, 4)), np.ones((2, 3)), np.ones(2), np.ones((2, 3))
    )
    assert (len(found), found.n_dropped) == (1, 1)


def test_rotations_become_unit_and_thin_sides_get_a_logarithm():
    splats = one_splat(quats=[[0.0, 3.0, 0.0, 4.0]], scales=[[0.1, 0.0, 0.2]], opacities=[1.5])
    np.testing.assert_allclose(splats.quats, [[0.0, 0.6, 0.0, 0.8]], rtol=1e-6)
    assert splats.n_dropped == 0
    assert np.isfinite(np.log(splats.scales)).all()
    assert splats.scales[0, 1] < 1e-9
    assert splats.opacities[0] == 1.0


def test_colours_and_opacities_survive_their_coefficients():
    splats = chance_splats(500)
    np.testing.assert_allclose(colors_of(splats.f_dc), splats.colors, atol=1e-6)
    np.testing.assert_allclose(opacities_of(splats.opacity_logits), splats.opacities, atol=1e-6)
    edges = one_splat(
        means=np.zeros((2, 3)),
        quats=np.ones((2, 4)),
        scales=np.ones((2, 3)),
        opacities=[0.0, 1.0],
        colors=np.ones((2, 3)),
    )
    assert np.isfinite(edges.opacity_logits).all()
    np.testing.assert_allclose(opacities_of(edges.opacity_logits), [0.0, 1.0], atol=2 * OPACITY_MARGIN)


def test_gaussians_go_both_ways():
    splats = chance_splats(20)
    gaussians = splats.gaussians()
    assert isinstance(gaussians, Gaussians)
    back = Splats.of(gaussians)
    for name in ("means", "scales", "opacities", "colors"):
        np.testing.assert_array_equal(getattr(back, name), getattr(splats, name))
    np.testing.assert_allclose(back.quats, splats.quats, atol=1e-6)
    assert Splats.of(gaussians[torch.zeros(0, dtype=torch.long)]).means.shape == (0, 3)
