"""Pictures without perspective: both ways of drawing agree with a rasterizer that sees from infinitely far away."""

from __future__ import annotations

import math

import moderngl
import numpy as np
import pytest
import torch

from app.playback.frame_decoder import ShownFrame
from app.playback.modes.arrays import BACKGROUND, AnchorArrays, GaussianArrays
from app.playback.render import RenderRequest, RenderView, render
from app.playback.views.orbit_view import OrbitView
from engine.backends.table import backend_called
from engine.raster import Gaussians, rasterize
from tests.ui.fake_session import make_rig
from tests.ui.gl.keep import Keep
from tests.ui.gl.pixels import read_color
from ui.gl import SplatRenderer, Target

WIDTH, HEIGHT = 96, 72


def made_up(view: OrbitView, n: int = 1500) -> GaussianArrays:
    """Gaussians all over the scene, many of them faint, so that their order matters everywhere."""
    rng = np.random.default_rng(5)
    return GaussianArrays(
        means=(view.pivot + rng.uniform(-0.8, 0.8, (n, 3)) * view.radius).astype(np.float32),
        quats=rng.normal(size=(n, 4)).astype(np.float32),
        scales=np.exp(rng.uniform(-4.5, -2.0, (n, 3))).astype(np.float32),
        opacities=rng.uniform(0.2, 0.95, n).astype(np.float32),
        colors=rng.uniform(0.0, 1.0, (n, 3)).astype(np.float32),
        key="made up",
    )


def from_infinitely_far(view: OrbitView, arrays: GaussianArrays) -> np.ndarray:
    """The same picture by the readable rasterizer in double precision, a thousand times farther away. [H, W, 3]"""
    matrix, distance = view.world_to_camera(), 1e7 * view.radius
    matrix[2, 3] += distance - float(matrix[2, :3] @ view.pivot + matrix[2, 3])
    focal = HEIGHT * distance / (2.0 * view.distance * math.tan(view.fov_y / 2.0))
    K = np.array([[focal, 0.0, WIDTH / 2], [0.0, focal, HEIGHT / 2], [0.0, 0.0, 1.0]])
    order = np.argsort(arrays.means.astype(np.float64) @ matrix[2, :3])  # it, too, sorts by depths in float32
    columns = (arrays.means, arrays.quats, arrays.scales, arrays.opacities, arrays.colors)
    rendering = rasterize(
        Gaussians(*(torch.from_numpy(column[order]).double() for column in columns)),
        torch.from_numpy(matrix)[None],
        torch.from_numpy(K)[None],
        WIDTH,
        HEIGHT,
        backend=backend_called("reference"),
        background=torch.tensor(BACKGROUND, dtype=torch.float64),
        near_plane=distance - max(view.distance, 0.9 * view.radius),
    )
    return rendering.image[0].numpy()


def psnr(image: np.ndarray, truth: np.ndarray) -> float:
    return -10.0 * math.log10(float(((image - truth) ** 2).mean()))


@pytest.fixture
def view() -> OrbitView:
    view = OrbitView(make_rig())
    view.set_orthographic(True)
    view.orbit(35.0, 20.0)
    return view


def test_the_rasterizer_s_picture_is_that_of_a_true_orthographic_camera(view: OrbitView) -> None:
    arrays = made_up(view)
    anchors = AnchorArrays(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), key="none")
    look = RenderView.of(view, WIDTH, HEIGHT)
    image = render(
        RenderRequest((0, "", 0, "", "", look.shown_as, 0), look, ShownFrame(arrays, anchors)), backend_called("cpu")
    ).image
    assert psnr(image / 255.0, from_infinitely_far(view, arrays)) > 55.0


@pytest.mark.slow
@pytest.mark.gl
def test_splats_are_drawn_as_by_a_true_orthographic_camera(view: OrbitView, ctx: moderngl.Context, keep: Keep) -> None:
    arrays = made_up(view)
    target, splats = keep(Target(ctx, (WIDTH, HEIGHT), precision="f4")), keep(SplatRenderer(ctx))
    target.clear()
    splats.upload(arrays)
    splats.draw(target, view.world_to_camera(), view.K(WIDTH, HEIGHT), WIDTH, HEIGHT, view.near)
    drawn = read_color(target)
    image = drawn[:, :, :3] + (1.0 - drawn[:, :, 3:]) * np.array(BACKGROUND)
    assert psnr(image, from_infinitely_far(view, arrays)) > 65.0
