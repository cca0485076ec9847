"""Wire of regions: where the lines run, what is dashed, what is faint."""

from __future__ import annotations

import numpy as np
import pytest

from engine.gate.regions import GateRegion, sphere_region
from ui.style.colors import REGION_COLORS
from ui.viewport.layers.region_lines import BACK_ALPHA, region_lines

EYE = np.array([0.0, 0.0, -5.0])
CENTER = (1.0, 2.0, 3.0)


@pytest.mark.parametrize("is_fine", [False, True])
def test_lines_of_a_sphere_lie_on_it(is_fine: bool) -> None:
    vertices, colors = region_lines(sphere_region("static", CENTER, 0.5), EYE, is_fine=is_fine)
    assert vertices.dtype == colors.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(vertices - CENTER, axis=1), 0.5, rtol=1e-5)
    np.testing.assert_allclose(
        np.sort(vertices, axis=0)[[0, -1]].round(4), [np.array(CENTER) - 0.5, np.array(CENTER) + 0.5]
    )


def test_lines_of_a_box_run_along_its_edges() -> None:
    box = GateRegion("static", (0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    vertices, _ = region_lines(box, EYE)
    is_at_border = np.isclose(vertices, box.low) | np.isclose(vertices, box.high)
    assert (is_at_border.sum(axis=1) >= 2).all(), "on an edge two coordinates are at a border"
    lengths = np.linalg.norm(vertices[1::2] - vertices[::2], axis=1)
    assert lengths.sum() == pytest.approx(4 * (1 + 2 + 3), rel=1e-5)


@pytest.mark.parametrize("shape", ["sphere", "box"])
def test_where_everything_may_change_half_of_each_line_is_left_out(shape: str) -> None:
    def length(treat: str) -> float:
        box = GateRegion(treat, (0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
        vertices, _ = region_lines(sphere_region(treat, CENTER, 0.5) if shape == "sphere" else box, EYE)
        return float(np.linalg.norm(vertices[1::2] - vertices[::2], axis=1).sum())

    assert length("dynamic") == pytest.approx(0.5 * length("static"), rel=1e-5)


def test_the_far_half_is_fainter_whichever_side_one_looks_from() -> None:
    for eye in (EYE, -EYE):
        vertices, colors = region_lines(sphere_region("dynamic", (0.0, 0.0, 0.0), 1.0), eye)
        np.testing.assert_allclose(colors[:, :3], np.tile(REGION_COLORS["dynamic"][:3], (len(colors), 1)), atol=1e-6)
        is_far = vertices @ eye < -1e-3
        np.testing.assert_allclose(colors[is_far, 3], BACK_ALPHA, rtol=1e-6)
        np.testing.assert_allclose(colors[vertices @ eye > 1e-3, 3], 1.0)
        assert is_far.any()
