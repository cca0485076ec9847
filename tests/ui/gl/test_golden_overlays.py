"""Pictures as a user sees them, kept in tests/golden and looked at when they change."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from tests.golden_images import assert_matches_golden
from tests.ui.gl.keep import Keep
from tests.ui.gl.pixels import read_resolved
from tests.ui.gl.scenes import Camera, make_camera, make_ring_rig, make_splats
from ui.gl.context import is_software
from ui.gl.image import ImageTexture, fit_rect
from ui.gl.lines import LineRenderer, frusta_lines
from ui.gl.points import INHERITED_ANCHOR_COLOR, RESIDUAL_ANCHOR_COLOR, PointRenderer
from ui.gl.splat_renderer import SplatRenderer
from ui.gl.targets import Target

pytestmark = pytest.mark.gl

BACKGROUND = (0.07, 0.08, 0.09)
SIZE = (192, 128)


def draw_overlays(ctx: moderngl.Context, keep: Keep, target: Target, camera: Camera) -> None:
    """Six frusta with one held out and one chosen, rings for inherited and diamonds for residual anchors."""
    frusta, inherited, residual = keep(LineRenderer(ctx)), keep(PointRenderer(ctx)), keep(PointRenderer(ctx))
    frusta.set(*frusta_lines(make_ring_rig(6), 0.35, held_out=[2], chosen=4))
    frusta.draw(target, *camera.arguments)
    anchors = np.random.default_rng(11).uniform(-0.6, 0.6, (40, 3))
    inherited.set(anchors[:25], np.array(INHERITED_ANCHOR_COLOR))
    inherited.draw(target, *camera.arguments, shape="ring", size=7.0)
    residual.set(anchors[25:], np.array(RESIDUAL_ANCHOR_COLOR))
    residual.draw(target, *camera.arguments, shape="diamond", size=8.0, outline_px=1.0)


def finish(ctx: moderngl.Context, target: Target, name: str, update: bool) -> None:
    target.resolve(BACKGROUND)
    if not is_software(ctx):
        pytest.skip("drawn without an error; golden pictures are compared on software drivers only")
    assert_matches_golden(read_resolved(target), name, update=update)


def test_golden_splats_with_overlays(ctx: moderngl.Context, keep: Keep, update_golden: bool) -> None:
    target, splats = keep(Target(ctx, SIZE)), keep(SplatRenderer(ctx))
    camera = make_camera(width=SIZE[0], height=SIZE[1], distance=3.6, yaw_rad=0.3, pitch_rad=0.35)
    splats.upload(make_splats(400, scale=0.04))
    splats.draw(target, *camera.arguments)
    draw_overlays(ctx, keep, target, camera)
    finish(ctx, target, "gl_splats_with_overlays", update_golden)


def test_golden_overlays_on_a_finished_picture(ctx: moderngl.Context, keep: Keep, update_golden: bool) -> None:
    """What software machines show: the CPU rasterizer's picture as an image, fitted, and overlays on top."""
    target, image = keep(Target(ctx, SIZE)), keep(ImageTexture(ctx))
    y, x = np.mgrid[0:90, 0:160]
    image.set(np.stack([x + 60, y + 80, 200 - x], axis=-1).astype(np.uint8))
    target.draw_image(image, fit_rect(image.size, SIZE))
    camera = make_camera(width=SIZE[0], height=SIZE[1], distance=3.6, yaw_rad=-0.5, pitch_rad=0.35)
    draw_overlays(ctx, keep, target, camera)
    finish(ctx, target, "gl_overlays_on_a_picture", update_golden)
