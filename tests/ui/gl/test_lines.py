"""Lines cover the pixels they should, stop at the near plane, and frusta stand where the cameras do."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from engine.camera.rig import CameraRig
from tests.ui.gl.keep import Keep
from tests.ui.gl.pixels import read_color
from tests.ui.gl.scenes import Camera, centered_camera, make_ring_rig
from ui.gl.lines import (
    CHOSEN_CAMERA_COLOR,
    HELD_OUT_CAMERA_COLOR,
    LINES_PER_FRUSTUM,
    TRAINING_CAMERA_COLOR,
    LineRenderer,
    frusta_lines,
)
from ui.gl.targets import Target

WHITE = np.ones(3)


class TestFrusta:
    def test_every_camera_has_its_lines_in_its_colour(self) -> None:
        vertices, colors = frusta_lines(make_ring_rig(6), 0.3, held_out=[1, 4], chosen=2)
        assert vertices.shape == (6 * LINES_PER_FRUSTUM * 2, 3)
        assert vertices.dtype == colors.dtype == np.float32
        per_camera = colors.reshape(6, LINES_PER_FRUSTUM * 2, 4)
        expected = [TRAINING_CAMERA_COLOR] * 6
        expected[1] = expected[4] = HELD_OUT_CAMERA_COLOR
        expected[2] = CHOSEN_CAMERA_COLOR
        np.testing.assert_allclose(per_camera, np.array(expected)[:, None].repeat(LINES_PER_FRUSTUM * 2, 1), rtol=1e-6)

    def test_held_out_is_okabe_ito_purple(self) -> None:
        assert [round(255 * c) for c in HELD_OUT_CAMERA_COLOR] == [204, 121, 167, 255]

    def test_lines_start_at_the_centre_and_end_at_the_picture_corners(self) -> None:
        rig = make_ring_rig(5, width=64, height=48)
        vertices, _ = frusta_lines(rig, 0.3)
        lines = vertices.reshape(5, LINES_PER_FRUSTUM, 2, 3)
        for row in range(5):
            camera = Camera(rig.world_to_camera[row], rig.Ks[row], 64, 48)
            np.testing.assert_allclose(lines[row, :4, 0], np.tile(rig.centers[row], (4, 1)), atol=1e-6)
            corners = camera.project(lines[row, :4, 1].astype(np.float64))
            np.testing.assert_allclose(corners, [[0, 0], [64, 0], [64, 48], [0, 48]], atol=1e-3)
            roof_px = camera.project(lines[row, 8, 1][None].astype(np.float64))[0]
            assert roof_px[0] == pytest.approx(32, abs=1e-3)
            assert roof_px[1] < 0, "the roof stands above the picture"

    def test_size_scales_about_the_centres(self) -> None:
        rig = make_ring_rig(3)
        centers = rig.centers.repeat(2 * LINES_PER_FRUSTUM, axis=0)
        small, large = (frusta_lines(rig, size)[0] - centers for size in (0.1, 0.4))
        np.testing.assert_allclose(large, 4 * small, atol=1e-5)

    def test_rig_without_cameras_has_no_lines(self) -> None:
        rig = make_ring_rig(3).subset([])
        vertices, colors = frusta_lines(rig, 0.1)
        assert vertices.shape == (0, 3)
        assert colors.shape == (0, 4)

    def test_unknown_camera_is_an_error(self) -> None:
        with pytest.raises(IndexError):
            frusta_lines(make_ring_rig(3), 0.1, held_out=[3])


def alpha_of(
    ctx: moderngl.Context, keep: Keep, vertices: list[list[float]], camera: Camera, **settings: float
) -> np.ndarray:
    target = keep(Target(ctx, (camera.width, camera.height), precision="f4"))
    lines = keep(LineRenderer(ctx))
    lines.set(np.array(vertices), WHITE)
    lines.draw(target, *camera.arguments, **settings)  # type: ignore[arg-type]
    return read_color(target)[..., 3]


@pytest.mark.gl
@pytest.mark.parametrize("width_px", [1.0, 3.0])
def test_level_line_covers_its_width(ctx: moderngl.Context, keep: Keep, width_px: float) -> None:
    alpha = alpha_of(ctx, keep, [[-9, 0, 0], [9, 0, 0]], centered_camera(), width_px=width_px)
    column = alpha[:, 20]
    assert column.sum() == pytest.approx(width_px, abs=1e-3)
    assert column[32] == pytest.approx(1.0, abs=1e-4)
    np.testing.assert_allclose(alpha, np.tile(column[:, None], (1, 64)), atol=1e-3)


@pytest.mark.gl
def test_line_ends_where_its_ends_project(ctx: moderngl.Context, keep: Keep) -> None:
    camera = centered_camera()
    ends = np.array([[-1.0, 0, 0], [0.5, 0, 0]])
    alpha = alpha_of(ctx, keep, ends.tolist(), camera, width_px=1.0)
    covered = np.flatnonzero(alpha[32] > 0.5)
    x_px = camera.project(ends)[:, 0]
    assert covered.min() == pytest.approx(x_px[0] - 0.5, abs=1.0)  # half a width beyond the end
    assert covered.max() + 1 == pytest.approx(x_px[1] + 0.5, abs=1.0)


@pytest.mark.gl
@pytest.mark.parametrize("is_reversed", [False, True])
def test_line_through_the_near_plane_shows_its_front_part(ctx: moderngl.Context, keep: Keep, is_reversed: bool) -> None:
    """From behind the viewer to a point on the right: without the cut it would be mirrored to the left."""
    camera = centered_camera(distance=0.0)
    ends = [[0.3, 0.0, -1.0], [0.3, 0.0, 2.0]]
    alpha = alpha_of(ctx, keep, ends[::-1] if is_reversed else ends, camera, width_px=2.0)
    far_end_px = 32.5 + 64 * 0.3 / 2.0
    covered = np.flatnonzero(alpha[32] > 0.5)
    assert covered.min() == pytest.approx(far_end_px - 1, abs=1.5)
    assert covered.max() == 63


@pytest.mark.gl
def test_lines_behind_the_viewer_or_not_finite_are_not_drawn(ctx: moderngl.Context, keep: Keep) -> None:
    camera = centered_camera(distance=0.0)
    assert not alpha_of(ctx, keep, [[-1, 0, -1], [1, 0, -2]], camera).any()
    lines = keep(LineRenderer(ctx))
    lines.set(np.array([[0, 0, 1], [np.nan, 0, 1], [0, 0, 1], [1, 0, 1]]), WHITE)
    assert len(lines) == 1


@pytest.mark.gl
def test_line_without_length_is_a_dot_and_not_nan(ctx: moderngl.Context, keep: Keep) -> None:
    alpha = alpha_of(ctx, keep, [[0, 0, 0], [0, 0, 0]], centered_camera(), width_px=3.0)
    assert np.isfinite(alpha).all()
    assert alpha[32, 32] == pytest.approx(1.0)
    assert alpha.sum() < 16


@pytest.mark.gl
def test_depth_tested_line_hides_behind_a_nearer_one(ctx: moderngl.Context, keep: Keep) -> None:
    camera, target = centered_camera(), keep(Target(ctx, (64, 64), precision="f4"))
    lines = keep(LineRenderer(ctx))
    near_red, far_blue = [[-1, 0, -1], [1, 0, -1]], [[0, -1, 1], [0, 1, 1]]
    lines.set(np.array(near_red + far_blue), np.array([[1, 0, 0]] * 2 + [[0, 0, 1]] * 2))
    lines.draw(target, *camera.arguments, width_px=3.0, is_depth_tested=True)
    np.testing.assert_allclose(read_color(target)[32, 32], [1, 0, 0, 1], atol=1e-3)
    target.clear()
    lines.draw(target, *camera.arguments, width_px=3.0)
    np.testing.assert_allclose(read_color(target)[32, 32], [0, 0, 1, 1], atol=1e-3)


@pytest.mark.gl
def test_opacity_and_vertex_alpha_multiply(ctx: moderngl.Context, keep: Keep) -> None:
    target, lines = keep(Target(ctx, (64, 64), precision="f4")), keep(LineRenderer(ctx))
    lines.set(np.array([[-9, 0, 0], [9, 0, 0]]), np.array([1.0, 0.5, 0.0, 0.5]))
    lines.draw(target, *centered_camera().arguments, width_px=3.0, opacity=0.5)
    np.testing.assert_allclose(read_color(target)[32, 32], [0.25, 0.125, 0, 0.25], atol=1e-4)


@pytest.mark.gl
def test_set_replaces_counts_and_checks(ctx: moderngl.Context, keep: Keep) -> None:
    target, lines, camera = keep(Target(ctx, (64, 64))), keep(LineRenderer(ctx)), centered_camera()
    lines.draw(target, *camera.arguments)  # nothing set yet
    assert lines.set(*frusta_lines(make_ring_rig(4), 0.2), key="rig")
    assert len(lines) == 4 * LINES_PER_FRUSTUM
    assert not lines.set(np.zeros((2, 3)), WHITE, key="rig")
    assert lines.set(np.zeros((0, 3)), WHITE)
    assert len(lines) == 0
    lines.draw(target, *camera.arguments)
    assert not read_color(target).any()
    with pytest.raises(ValueError, match=r"\[2 L, 3\]"):
        lines.set(np.zeros((3, 3)), WHITE)


@pytest.mark.gl
def test_camera_sees_its_own_frustum_as_the_picture_border(ctx: moderngl.Context, keep: Keep) -> None:
    """The overlay and the capture agree: seen through the camera, its pyramid's base frames the picture."""
    rig: CameraRig = make_ring_rig(3, width=64, height=48)
    target, lines = keep(Target(ctx, (64, 48), precision="f4")), keep(LineRenderer(ctx))
    lines.set(*frusta_lines(rig.subset([1]), 0.5))
    lines.draw(target, rig.world_to_camera[1], rig.Ks[1], 64, 48, width_px=4.0)
    alpha = read_color(target)[..., 3]
    border = np.ones((48, 64), dtype=bool)
    border[1:-1, 1:-1] = False
    assert alpha[border].min() > 0.9
    assert alpha[12:36, 6:16].max() == 0.0, "between the border and the edges to the centre"
