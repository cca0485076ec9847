"""The regions of a scene as they are drawn over its picture: marked ones, of which one may stand out, and the sphere
that is being chosen with the anchors in it. Owns its renderers; GL thread only. Knows no ImGui.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from app.playback.modes.arrays import AnchorArrays
from engine.clip_files.roles import ROLES
from engine.gate.regions import GateRegion
from ui.gl import LineRenderer, PointRenderer, Target
from ui.style.colors import CHOSEN
from ui.viewport.layers.anchor_marks import thinned
from ui.viewport.layers.region_lines import region_lines

MAX_ANCHORS = 1_500
"""At most this many of the anchors in the sphere are shown."""
THIN_PX, THICK_PX, HALO_PX = 1.8, 3.0, 3.0
"""Widths of lines; a dark one that is wider by the last lies under each, so that they show on any picture."""
DARK = np.array([0.03, 0.04, 0.05, 1.0], np.float32)


@dataclass(frozen=True)
class ShownRegions:
    """Content to draw.

    Attributes:
        marked: Regions of the project.
        highlighted: Position of the one that stands out.
        sphere: The one that is being chosen.
    """

    marked: tuple[GateRegion, ...] = ()
    highlighted: int | None = None
    sphere: GateRegion | None = None

    @property
    def is_empty(self) -> bool:
        """Nothing to draw."""
        return not self.marked and self.sphere is None


class RegionLayer:
    """Draws regions. `counts` says how many anchors of which role the chosen sphere holds; empty where unknown."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._halos = (LineRenderer(ctx), LineRenderer(ctx))
        self._lines = (LineRenderer(ctx), LineRenderer(ctx))
        self._anchors = PointRenderer(ctx)
        self._key: Hashable = None
        self._held_key: Hashable = None
        self.counts: dict[str, int] = {}

    def release(self) -> None:
        """Free everything."""
        for thing in (*self._halos, *self._lines, self._anchors):
            thing.release()

    def take(self, shown: ShownRegions, anchors: AnchorArrays | None, eye: np.ndarray) -> Hashable:
        """Take the regions to draw, as seen from somewhere. Returns a key that differs whenever the picture would.

        Args:
            anchors: Of the shown frame; needed for the chosen sphere only.
            eye: Scene units. [3]
        """
        key = (shown, tuple(np.asarray(eye).tolist()))
        if key != self._key:
            self._key = key
            thin = [region_lines(region, eye) for i, region in enumerate(shown.marked) if i != shown.highlighted]
            thick = [region_lines(region, eye) for i, region in enumerate(shown.marked) if i == shown.highlighted]
            if shown.sphere is not None:
                thick.append(region_lines(shown.sphere, eye, is_fine=True))
            for lines, halo, parts in zip(self._lines, self._halos, (thin, thick), strict=True):
                vertices = np.concatenate([np.zeros((0, 3), np.float32), *(vertices for vertices, _ in parts)])
                colors = np.concatenate([np.zeros((0, 4), np.float32), *(colors for _, colors in parts)])
                lines.set(vertices, colors)
                halo.set(vertices, _dark(colors))
        return key, self._take_anchors(shown.sphere, anchors)

    def _take_anchors(self, sphere: GateRegion | None, anchors: AnchorArrays | None) -> Hashable:
        """The anchors in the sphere."""
        if sphere is None or anchors is None:
            if self._held_key is not None:
                self._held_key, self.counts = None, {}
                self._anchors.set(np.zeros((0, 3), np.float32), DARK)
            return None
        key = (sphere, anchors.key)
        if key != self._held_key:
            self._held_key = key
            positions = np.concatenate([anchors.inherited_positions, anchors.own_positions])
            rows = np.flatnonzero(sphere.contains(positions))
            self.counts = _counts(anchors, rows)
            self._anchors.set(positions[thinned(rows, MAX_ANCHORS)], np.array(CHOSEN, np.float32))
        return key

    def draw(self, target: Target, camera: tuple[Any, ...]) -> None:
        """Draw the regions taken. camera: Of ui.viewport.scene.SceneView."""
        self._anchors.draw(target, *camera, shape="circle", size=4.5, outline_px=1.0, opacity=0.9)
        for lines, halo, width_px in zip(self._lines, self._halos, (THIN_PX, THICK_PX), strict=True):
            halo.draw(target, *camera, width_px=width_px + HALO_PX, opacity=0.45)
            lines.draw(target, *camera, width_px=width_px)


def _dark(colors: np.ndarray) -> np.ndarray:
    """A dark colour of the same opacity. [N, 4]"""
    return np.concatenate([np.tile(DARK[:3], (len(colors), 1)), colors[:, 3:]], axis=1)


def _counts(anchors: AnchorArrays, rows: np.ndarray) -> dict[str, int]:
    """How many of these anchors have which role; all as "anchor" where unknown."""
    if anchors.inherited_roles is None or anchors.own_roles is None:
        return {"anchor": len(rows)} if len(rows) else {}
    roles = np.concatenate([anchors.inherited_roles, anchors.own_roles])[rows]
    numbers = np.bincount(roles, minlength=len(ROLES))
    return {role: int(n) for role, n in zip(ROLES, numbers, strict=True) if n}
