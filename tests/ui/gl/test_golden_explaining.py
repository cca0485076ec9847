"""Covered space, distances and trails over a picture, kept in tests/golden and looked at when they change."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from app.playback.modes.coverage import CoveredSpace
from app.playback.modes.trails import Trails, trail_lines
from tests.golden_images import assert_matches_golden
from tests.ui.fake_session import FakeSession
from tests.ui.gl.keep import Keep
from tests.ui.gl.pixels import read_resolved
from tests.ui.gl.scenes import make_camera
from ui.gl.context import is_software
from ui.gl.targets import Target
from ui.viewport.layers.explaining_layer import ExplainingLayer
from ui.viewport.scene import SceneView

pytestmark = pytest.mark.gl

BACKGROUND = (0.07, 0.08, 0.09)
SIZE = (192, 128)


class Explained(FakeSession):
    """A session with a row of spheres, residual anchors around them, and Gaussians that turn around the middle."""

    def __init__(self, **overlays: bool) -> None:
        super().__init__(has_capture=False)
        for name, value in overlays.items():
            setattr(self.overlays, name, value)
        centers = np.stack([np.linspace(-0.8, 0.8, 7), np.zeros(7), np.zeros(7)], axis=1)
        points = np.random.default_rng(5).uniform(-0.7, 0.7, (40, 3))
        radii = np.linspace(0.1, 0.25, 7)
        distances = (np.linalg.norm(points[:, None] - centers, axis=2) - radii).min(axis=1)
        arrays = (values.astype(np.float32) for values in (centers, radii, points, 5 * distances))
        self._coverage = CoveredSpace(*arrays, key="coverage")
        angles = np.linspace(0, 1.2, 8)[:, None] + np.linspace(0, 2 * np.pi, 9)[None, :-1]
        paths = np.stack([np.cos(angles), np.linspace(-0.5, 0.5, 8) + 0 * angles, np.sin(angles)], -1)
        self._trails = Trails(*trail_lines(paths.astype(np.float32), np.ones(8)), key="trails")

    def shown_coverage(self) -> CoveredSpace:
        return self._coverage

    def shown_trails(self) -> Trails:
        return self._trails


def scene_view() -> SceneView:
    camera = make_camera(width=SIZE[0], height=SIZE[1], distance=3.2, yaw_rad=0.3, pitch_rad=0.35)
    return SceneView(*camera.arguments, is_moving=False)


@pytest.mark.parametrize("name", ["show_coverage", "show_trails"])
def test_golden_overlays_that_explain(name: str, ctx: moderngl.Context, keep: Keep, update_golden: bool) -> None:
    target, layer = keep(Target(ctx, SIZE)), keep(ExplainingLayer(ctx))
    layer.take(Explained(**{name: True}), scene_view())
    layer.draw(target, scene_view(), 1.0)
    target.resolve(BACKGROUND)
    if not is_software(ctx):
        pytest.skip("drawn without an error; golden pictures are compared on software drivers only")
    assert_matches_golden(read_resolved(target), f"overlay_{name}", update=update_golden)


def test_what_is_not_asked_for_is_not_drawn(ctx: moderngl.Context, keep: Keep) -> None:
    layer = keep(ExplainingLayer(ctx))
    session = Explained(show_coverage=True)
    assert layer.take(session, scene_view()) != (None, None)
    assert not layer.is_empty
    session.overlays.show_coverage = False
    assert layer.take(session, scene_view()) == (None, None)
    assert layer.is_empty
