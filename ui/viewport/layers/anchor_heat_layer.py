"""Residual of each anchor as a coloured point over the picture, for views from where no camera stood."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from app.playback.modes.arrays import GaussianArrays
from app.playback.modes.color_maps import mapped
from app.residuals.anchor_heat import AnchorHeat
from app.session.session_view import SessionView
from ui.gl import PointRenderer, Target
from ui.viewport.layers.occlusion import OcclusionMap

if TYPE_CHECKING:
    from ui.viewport.scene import SceneView

POINT_SIZE = 5.0
"""Diameter, units."""
ANCHOR_RANGES = {"E": (0.0, 8.0), "error": (0.0, 25.5)}
"""Ranges of the colours, 1/255, one range for all frames: a mean over many pixels is lower than the worst of them."""
FAINT_SHARE = 0.06
"""Least opacity, of an anchor without any residual: hot ones have to stand out."""


def anchor_column(kind: str) -> str:
    """The residual of anchors that stands for a heat map: excess flicker where that compares frames, else the error."""
    return "E" if kind in ("R", "G", "E", "clips") else "error"


def shown_anchor_heat(session: SessionView) -> AnchorHeat | None:
    """The heat to show; None where no heat map is chosen, a camera is looked through, or nothing is there yet."""
    if not session.overlays.heat or session.view.look_through is not None:
        return None
    return session.anchor_heat(anchor_column(session.overlays.heat))


def heat_points(heat: AnchorHeat) -> tuple[np.ndarray, np.ndarray]:
    """Places and colours of the anchors that were seen, the coldest first, so that nothing hides the hot ones.

    Returns:
        [A', 3] float32 and RGBA in 0..1 [A', 4] float32
    """
    low, high = ANCHOR_RANGES[heat.column]
    rows = np.flatnonzero(np.isfinite(heat.values))
    rows = rows[np.argsort(heat.values[rows], kind="stable")]
    values = heat.values[rows]
    colors = np.ones((len(rows), 4), np.float32)
    colors[:, :3] = mapped(values, "inferno", low, high) / np.float32(255.0)
    share = np.clip((values - low) / (high - low), 0.0, 1.0)
    colors[:, 3] = FAINT_SHARE + (1.0 - FAINT_SHARE) * np.sqrt(share)
    return heat.positions[rows], colors


class AnchorHeatLayer:
    """Owns the drawn points. GL thread only."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._points = PointRenderer(ctx)
        self._occlusion = OcclusionMap()
        self._is_shown = False
        self._key: Hashable = None

    def release(self) -> None:
        """Free every GL object."""
        self._points.release()

    @property
    def is_empty(self) -> bool:
        """Is there nothing to draw?"""
        return not self._is_shown

    def take(self, session: SessionView, view: SceneView, gaussians: GaussianArrays | None) -> Hashable:
        """Take up the anchors' residuals; asks for missing ones.

        Args:
            gaussians: Of the picture below: what they hide is not drawn. None where it is something else.
        Returns:
            A key that differs whenever what is drawn does; None without anything.
        """
        heat = shown_anchor_heat(session)
        self._is_shown = heat is not None and len(heat.positions) > 0
        if heat is None or not self._is_shown:
            return None
        key = (heat.key, None if gaussians is None else (gaussians.key, view.key))
        if key != self._key:
            self._key = key
            positions, colors = heat_points(heat)
            if gaussians is not None and len(positions):
                camera = (view.world_to_camera, view.K, view.width, view.height)
                is_seen = ~self._occlusion.hidden(positions, gaussians, *camera, near=view.near, set_back=view.set_back)
                positions, colors = positions[is_seen], colors[is_seen]
            self._points.set(positions, colors, key=key)
        return key

    def draw(self, target: Target, view: SceneView, opacity: float, pixels_per_unit: float) -> None:
        """Draw over the contents of the target."""
        if self._is_shown:
            self._points.draw(target, *view.camera, shape="circle", size=POINT_SIZE * pixels_per_unit, opacity=opacity)
