"""Explanations of a clip over its picture: the spheres that inherited anchors cover, how far residual anchors lie from
them, and the trails of moving Gaussians.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from app.playback.modes.color_maps import SIGNED, mapped
from app.playback.modes.coverage import CoveredSpace
from app.playback.modes.trails import Trails
from app.session.session_view import SessionView
from ui.gl import LineRenderer, PointRenderer, Target
from ui.style.colors import ROLE_COLORS
from ui.viewport.layers.anchor_marks import thinned

if TYPE_CHECKING:
    from ui.viewport.scene import SceneView

MAX_SPHERES = 500
"""At most so many outlines, evenly thinned."""
N_SEGMENTS = 28
"""Of an outline."""
OUTLINE_OPACITY = 0.45
DISTANCE_SIZE = 5.5
"""Of a mark in the colour of its distance, units."""
TRAIL_WIDTH = 1.6
"""Units."""


class ExplainingLayer:
    """Owns the drawn explanations. GL thread only.

    Attributes:
        coverage: The part that is drawn; None where nothing is.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self.coverage: CoveredSpace | None = None
        self._trails: Trails | None = None
        self._outlines, self._paths = LineRenderer(ctx), LineRenderer(ctx)
        self._distances = PointRenderer(ctx)

    def release(self) -> None:
        """Free every GL object."""
        for thing in (self._outlines, self._paths, self._distances):
            thing.release()

    @property
    def is_empty(self) -> bool:
        """Is there nothing to draw?"""
        return self.coverage is None and self._trails is None

    def take(self, session: SessionView, view: SceneView) -> Hashable:
        """Take up the explanations of the session's frame; gives a key that differs whenever the drawing does."""
        overlays = session.overlays
        self.coverage = session.shown_coverage() if overlays.show_coverage else None
        self._trails = session.shown_trails() if overlays.show_trails else None
        coverage_key = trails_key = None
        if self.coverage is not None:
            coverage, eye = self.coverage, view.eye
            coverage_key = (coverage.key, eye.tobytes())
            self._outlines.set(*sphere_outlines(coverage.centers, coverage.radii, eye), key=coverage_key)
            colors = mapped(coverage.distances, SIGNED, -coverage.range, coverage.range) / np.float32(255.0)
            self._distances.set(coverage.points, colors, key=coverage.key)
        if self._trails is not None:
            trails_key = self._trails.key
            self._paths.set(self._trails.vertices, self._trails.colors, key=trails_key)
        return coverage_key, trails_key

    def draw(self, target: Target, view: SceneView, pixels_per_unit: float) -> None:
        """Draw over the contents of the target."""
        if self.coverage is not None:
            self._outlines.draw(target, *view.camera, width_px=1.2 * pixels_per_unit, opacity=OUTLINE_OPACITY)
            size = DISTANCE_SIZE * pixels_per_unit
            self._distances.draw(target, *view.camera, shape="diamond", size=size)
        if self._trails is not None:
            self._paths.draw(target, *view.camera, width_px=TRAIL_WIDTH * pixels_per_unit)


def sphere_outlines(centers: np.ndarray, radii: np.ndarray, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The circles as which spheres are seen from somewhere; at most MAX_SPHERES of them.

    Args:
        centers, radii: Scene units. [S, 3], [S]
        eye: From where. [3]
    Returns:
        vertices: Two per line. [2 L, 3] float32
        colors: RGBA. [2 L, 4] float32
    """
    chosen = thinned(np.arange(len(centers)), MAX_SPHERES)
    centers, radii = centers[chosen].astype(np.float64), radii[chosen].astype(np.float64)
    towards = eye - centers
    away = np.linalg.norm(towards, axis=1, keepdims=True)
    is_outside = (away[:, 0] > radii) & (radii > 0.0)
    centers, radii, towards, away = (values[is_outside] for values in (centers, radii, towards, away))
    towards = towards / away
    share = radii[:, None] / away  # the circle of contact lies this share of the radius towards the eye
    seeds = np.eye(3)[np.abs(towards).argmin(axis=1)]
    first = np.cross(towards, seeds)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(towards, first)
    angles = np.linspace(0.0, 2.0 * np.pi, N_SEGMENTS + 1)[None, :, None]
    around = np.cos(angles) * first[:, None] + np.sin(angles) * second[:, None]
    size = radii[:, None] * np.sqrt(1.0 - share**2)
    rings = (centers + radii[:, None] * share * towards)[:, None] + size[:, None] * around
    vertices = np.stack([rings[:, :-1], rings[:, 1:]], axis=2).reshape(-1, 3).astype(np.float32)
    return vertices, np.tile(np.array(ROLE_COLORS["moving"], np.float32), (len(vertices), 1))
