"""Marks over the picture: cameras as pyramids and anchors as rings and diamonds, and which of them the pointer is on.

Anchors behind what the picture shows are drawn fainter. Sizes are in units of the interface (ui.style.ui_scale).
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from app.playback.modes.arrays import AnchorArrays, GaussianArrays
from app.playback.picture_source import UNKNOWN, PictureSource
from app.session.session_view import SessionView
from ui.gl import (
    INHERITED_ANCHOR_COLOR,
    NEAR,
    RESIDUAL_ANCHOR_COLOR,
    LineRenderer,
    PointRenderer,
    Target,
    frusta_lines,
)
from ui.gl.lines import LINES_PER_FRUSTUM
from ui.viewport.layers.anchor_marks import AnchorMarks, anchor_marks
from ui.viewport.layers.frusta import camera_under, cameras_around, frustum_size
from ui.viewport.layers.occlusion import OcclusionMap

if TYPE_CHECKING:
    from ui.viewport.scene import SceneView

MAX_INHERITED_MARKS, MAX_RESIDUAL_MARKS = 2_500, 500
"""At most this many anchors of a kind are marked, evenly thinned: they should not drown the picture. Residual anchors
crowd where something is new, and that is what one wants to see."""
RING_SIZE, DIAMOND_SIZE, RIM = 6.5, 8.0, 0.9
"""Diameters, and the width of the dark rim that keeps marks apart from any picture; units."""
ROOMY_SIDE, SMALLEST_SHARE = 800.0, 0.75
"""In a picture with a shorter side than this, units, marks are smaller, down to this share: they crowd there."""
HIDDEN_SHARE = 0.22
"""Opacity of a mark behind what the picture shows, of that of the others."""
POINTED_SHARE = 2.2
"""Size of the ring around the mark under the pointer, of that of the mark."""
REACH = 6.0
"""A pyramid whose lines are this near to the pointer is the one that is meant; units."""
POINTED_COLOR = (1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True)
class AnchorCounts:
    """Anchors held for the overlays, by origin. Those of the reference clip itself count as inherited.

    Attributes:
        source: The picture source they are of.
        inherited_roles, residual_roles: Likewise by what they are; empty where unknown.
    """

    n_inherited: int = 0
    n_residual: int = 0
    is_reference: bool = False
    source: PictureSource = UNKNOWN
    inherited_roles: dict[str, int] = field(default_factory=dict)
    residual_roles: dict[str, int] = field(default_factory=dict)


class MarkLayer:
    """Owns the drawn marks. GL thread only.

    Attributes:
        counts: Of the anchors that were taken last.
        pointed_camera: The camera under the pointer, drawn in yellow; None without one.
        pointed_anchor: Place of the anchor under the pointer, with a ring around it; None without one. [3]
        pixels_per_unit: Of the target that is drawn into.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self.counts = AnchorCounts()
        self.pointed_camera: int | None = None
        self.pointed_anchor: np.ndarray | None = None
        self.pixels_per_unit = 1.0
        self._frusta = LineRenderer(ctx)
        self._inherited = PointRenderer(ctx)
        self._residual = PointRenderer(ctx)
        self._pointed = PointRenderer(ctx)
        self._marks: tuple[AnchorMarks, AnchorMarks] | None = None
        self._marks_key: Hashable = None
        self._occlusion = OcclusionMap()

    def release(self) -> None:
        """Free every GL object."""
        for thing in (self._frusta, self._inherited, self._residual, self._pointed):
            thing.release()

    def is_empty(self, session: SessionView) -> bool:
        """Is there nothing to draw?"""
        overlays = session.overlays
        has_frusta = overlays.show_frusta and session.view.look_through is None
        has_inherited = overlays.show_inherited and self.counts.n_inherited > 0
        return not (has_frusta or has_inherited or (overlays.show_residual and self.counts.n_residual > 0))

    def take(self, session: SessionView, view: SceneView, gaussians: GaussianArrays | None) -> Hashable:
        """Take up the marks of the session's frame.

        Args:
            view: From where they are drawn.
            gaussians: Of the picture below the marks; None where it is something else.
        Returns:
            A key that differs whenever what is drawn does.
        """
        overlays, frusta_key = session.overlays, None
        if overlays.show_frusta:
            held_out, size = tuple(session.holdout), frustum_size(session.rig)
            around = cameras_around(session.rig, view.world_to_camera, size)
            frusta_key = (id(session.rig), held_out, self.pointed_camera, around.tobytes())
            vertices, colors = frusta_lines(session.rig, size, held_out, chosen=self.pointed_camera)
            is_drawn = np.repeat(~around, 2 * LINES_PER_FRUSTUM)
            self._frusta.set(vertices[is_drawn], colors[is_drawn], key=frusta_key)
        anchors = session.shown_anchors()
        common = (frusta_key, session.view.look_through, self.pixels_per_unit)
        if anchors is None:
            self.counts, self._marks, self._marks_key = AnchorCounts(), None, None
            return common
        if self._marks is None or anchors.key != self._marks_key:
            self._sort(anchors)
        assert self._marks is not None
        shown = (overlays.show_inherited, overlays.show_residual)
        behind = None if gaussians is None else (gaussians.key, view.key)
        for is_shown, marks, renderer in zip(shown, self._marks, (self._inherited, self._residual), strict=True):
            if is_shown:
                renderer.set(marks.positions, self._colors(marks, view, gaussians), key=(anchors.key, behind))
        if self.pointed_anchor is not None:
            self._pointed.set(self.pointed_anchor[None], np.array([POINTED_COLOR], np.float32))
        pointed = None if self.pointed_anchor is None else self.pointed_anchor.tobytes()
        return (*common, anchors.key, behind if any(shown) else None, *shown, self._look(session), pointed)

    def _look(self, session: SessionView) -> tuple[float, float]:
        return float(session.overlays.mark_size), float(session.overlays.mark_opacity)

    def _colors(self, marks: AnchorMarks, view: SceneView, gaussians: GaussianArrays | None) -> np.ndarray:
        if gaussians is None or len(marks.positions) == 0:
            return marks.colors
        camera = (view.world_to_camera, view.K, view.width, view.height)
        colors = marks.colors.copy()
        hidden = self._occlusion.hidden(marks.positions, gaussians, *camera, near=view.near, set_back=view.set_back)
        colors[hidden, 3] *= HIDDEN_SHARE
        return colors

    def _sort(self, anchors: AnchorArrays) -> None:
        """Marks and counts of inherited anchors and of the clip's own."""
        inherited = (anchors.inherited_positions, anchors.inherited_roles, anchors.inherited_reasons)
        own = (anchors.own_positions, anchors.own_roles, anchors.own_reasons)
        is_reference = len(inherited[0]) == 0
        if is_reference:  # its own anchors are those that the others inherit
            inherited, own = own, inherited
        first = anchor_marks(*inherited, most=MAX_INHERITED_MARKS, color=INHERITED_ANCHOR_COLOR)
        second = anchor_marks(*own, most=MAX_RESIDUAL_MARKS, color=RESIDUAL_ANCHOR_COLOR)
        self._marks, self._marks_key = (first, second), anchors.key
        self.counts = AnchorCounts(
            len(inherited[0]),
            len(own[0]),
            is_reference,
            anchors.source,
            first.counts,
            second.counts,
        )

    def draw(self, target: Target, view: SceneView, session: SessionView) -> None:
        """Draw over the contents of the target."""
        overlays, unit = session.overlays, self.pixels_per_unit
        size, opacity = self._look(session)
        room = np.sqrt(view.width * view.height) / (ROOMY_SIDE * unit)
        size *= float(np.clip(room, SMALLEST_SHARE, 1.0))
        if overlays.show_frusta and session.view.look_through is None:
            # from inside a camera the others are only in the way
            self._frusta.draw(target, *view.camera, width_px=1.5 * unit, opacity=0.8)
        rim = RIM * min(size, 1.0) * unit
        if self.counts.n_inherited and overlays.show_inherited:
            ring = RING_SIZE * size * unit
            self._inherited.draw(target, *view.camera, shape="ring", size=ring, outline_px=rim, opacity=opacity)
        if self.counts.n_residual and overlays.show_residual:
            diamond = DIAMOND_SIZE * size * unit
            self._residual.draw(target, *view.camera, shape="diamond", size=diamond, outline_px=rim, opacity=opacity)
        if self.pointed_anchor is not None:
            around = POINTED_SHARE * DIAMOND_SIZE * size * unit
            self._pointed.draw(target, *view.camera, shape="ring", size=around, outline_px=rim)

    # ---- the pointer -----------------------------------------------------------------------------------------

    def anchor_under(
        self, session: SessionView, view: SceneView, x: float, y: float, near: float
    ) -> tuple[AnchorMarks, int] | None:
        """Marks and row of the anchor under a pixel of the view; None where none is shown."""
        if self._marks is None:
            return None
        overlays = session.overlays
        for is_shown, marks in zip((overlays.show_residual, overlays.show_inherited), self._marks[::-1], strict=True):
            row = marks.at(view.world_to_camera, view.K, x, y, near=near) if is_shown else None
            if row is not None:
                return marks, row
        return None

    def camera_under(self, session: SessionView, view: SceneView, x: float, y: float) -> int | None:
        """The camera whose pyramid lies under a pixel of the view; None where none is shown."""
        if not session.overlays.show_frusta or session.view.look_through is not None:
            return None
        reach_px = REACH * self.pixels_per_unit
        return camera_under(
            session.rig, view.world_to_camera, view.K, x, y, near=max(NEAR, view.near), reach_px=reach_px
        )
