"""What a graphics card puts on the screen against what the CPU rasterizer does, as both are looked at: in 8 bits."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
import pytest

from app.playback.modes.arrays import BACKGROUND
from tests.ui.gl.keep import Keep
from tests.ui.gl.scenes import Camera, Splats, joined, make_splats
from tests.ui.gl.screen_truth import LEAST_PSNR_DB, MOST_PIXELS_OFF, compared, random_cameras
from ui.gl.splat_renderer import SplatRenderer
from ui.gl.targets import Precision, Target

pytestmark = pytest.mark.gl

SIZE = (200, 150)


def learned_like(n: int, seed: int) -> Splats:
    """Gaussians as a trained clip has them: flat on surfaces, of very different sizes, many nearly opaque, many faint,
    and a background far behind."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    radii = np.where(rng.uniform(size=n) < 0.2, rng.uniform(6.0, 30.0, n), rng.uniform(0.7, 1.0, n))
    sizes = 0.02 * radii[:, None] * np.exp(rng.normal(0.0, 0.9, (n, 3)))
    sizes[:, 0] *= 0.15
    return Splats(
        means=(radii[:, None] * directions).astype(np.float32),
        quats=rng.normal(size=(n, 4)).astype(np.float32),
        scales=sizes.astype(np.float32),
        opacities=np.where(rng.uniform(size=n) < 0.5, rng.uniform(0.9, 1.0, n), rng.beta(1, 6, n)).astype(np.float32),
        colors=rng.uniform(0, 1, (n, 3)).astype(np.float32),
    )


HARD = {
    "needles": replace(make_splats(300, 4), scales=make_splats(300, 4).scales * np.array([20, 0.02, 0.5], np.float32)),
    "larger than the picture": make_splats(40, 1, scale=6.0),
    "smaller than a pixel": make_splats(3000, 2, scale=1e-4),
    "faint": replace(make_splats(400, 3, scale=0.2), opacities=np.full(400, 0.02, np.float32)),
    "opaque": replace(make_splats(600, 5, scale=0.3), opacities=np.ones(600, np.float32)),
    "without size": replace(make_splats(200, 6), scales=np.zeros((200, 3), np.float32)),
    "many behind": joined(make_splats(300, 7), replace(make_splats(300, 8), means=make_splats(300, 8).means - 5.0)),
    "equal depths": replace(make_splats(200, 9), means=np.round(make_splats(200, 9).means * 3.0) / 3.0),
}


def check(
    ctx: moderngl.Context, keep: Keep, splats: Splats, cameras: list[Camera], *, precision: Precision = "f2"
) -> None:
    target, renderer = keep(Target(ctx, SIZE, precision=precision)), keep(SplatRenderer(ctx))
    renderer.upload(splats)
    for camera in cameras:
        psnr_db, share_off = compared(renderer, target, splats, camera, BACKGROUND)
        assert psnr_db >= LEAST_PSNR_DB
        assert share_off <= MOST_PIXELS_OFF


@pytest.mark.slow
def test_twenty_random_views_of_what_looks_like_a_trained_clip(ctx: moderngl.Context, keep: Keep) -> None:
    check(ctx, keep, learned_like(4000, 0), random_cameras(20, SIZE, distance=2.6))


@pytest.mark.parametrize("name", list(HARD))
def test_hard_cases(ctx: moderngl.Context, keep: Keep, name: str) -> None:
    check(ctx, keep, HARD[name], random_cameras(3, SIZE, distance=2.2))


def test_hundreds_of_faint_layers_need_more_than_half_floats(ctx: moderngl.Context, keep: Keep) -> None:
    """In 16 bits, which the window draws in, each layer is rounded: about 42 dB here."""
    faint = replace(make_splats(3000, 3, scale=0.2), opacities=np.full(3000, 0.02, np.float32))
    check(ctx, keep, faint, random_cameras(2, SIZE, distance=2.2), precision="f4")


def test_from_inside(ctx: moderngl.Context, keep: Keep) -> None:
    check(ctx, keep, learned_like(6000, 1), random_cameras(6, SIZE, distance=0.3))
