"""How selected Gaussians show over the picture: striped and outlined where they are seen, and dots at some of their
centres, which stand there at once and show through what lies before them.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from app.playback.modes.arrays import GaussianArrays
from app.session.session_view import SessionView
from ui.gl import PointRenderer, Target
from ui.style.colors import YELLOW
from ui.viewport.editing.share_drawing import ShareDrawing

if TYPE_CHECKING:
    from ui.viewport.scene import SceneView

MAX_DOTS, FEW_DOTS = 3_000, 300
"""At most so many centres are marked, evenly thinned: until it is known where they are seen, and from then on."""
HUE = np.array(YELLOW, np.float32)
DOT_SIZE, RIM = 4.0, 1.2
"""Diameter, and the width of its dark rim; units."""


class SelectionLayer:
    """Owns the GL objects. GL thread only.

    Attributes:
        pixels_per_unit: Of the target that is drawn into.
        is_share_shown: Whether it shows where they are seen, and not their centres alone.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self.pixels_per_unit = 1.0
        self.is_share_shown = False
        self._dots, self._few = PointRenderer(ctx), PointRenderer(ctx)
        self._share = ShareDrawing(ctx)
        self._dots_key: Hashable = None

    def release(self) -> None:
        """Free every GL object."""
        self._dots.release()
        self._few.release()
        self._share.release()

    @property
    def is_empty(self) -> bool:
        """Is there nothing to draw?"""
        return len(self._dots) == 0 and not self.is_share_shown

    def take(self, session: SessionView, view: SceneView, gaussians: GaussianArrays | None) -> Hashable:
        """Take up the present selection.

        Args:
            gaussians: Of the picture below; None where it is something else.
        Returns:
            A key that differs whenever what is drawn does.
        """
        if gaussians is None or not session.selection.n_gaussians:
            self._dots.set(np.zeros((0, 3), np.float32), HUE, key="nothing")
            self._dots_key, self.is_share_shown = None, False
            return None
        dots_key = (gaussians.key, session.selection.revision)
        if dots_key != self._dots_key:
            rows = np.flatnonzero(session.selected(gaussians))
            for dots, most in ((self._dots, MAX_DOTS), (self._few, FEW_DOTS)):
                thinned = rows[np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(np.int64)]
                dots.set(gaussians.means[thinned], HUE, key=dots_key)
            self._dots_key = dots_key
        share = session.selected_share(gaussians, view.seen_from)
        self.is_share_shown = share is not None
        if share is not None:
            self._share.take(share)
        return (*dots_key, id(share), self.pixels_per_unit)

    def draw(self, target: Target, view: SceneView) -> None:
        """Draw over the contents of the target."""
        unit = self.pixels_per_unit
        if self.is_share_shown:
            self._share.draw(target, YELLOW, unit, is_filled=True)
        dots = self._few if self.is_share_shown else self._dots
        dots.draw(target, *view.camera, shape="circle", size=DOT_SIZE * unit, outline_px=RIM * unit)
