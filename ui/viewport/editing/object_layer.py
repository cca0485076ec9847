"""Outlines of objects over the picture, each in its colour."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING

import moderngl

from app.playback.modes.arrays import GaussianArrays
from app.session.session_view import SessionView
from engine.editing.scene_object import Objects
from ui.gl import Target
from ui.style.colors import Color
from ui.viewport.editing.share_drawing import ShareDrawing

if TYPE_CHECKING:
    from ui.viewport.scene import SceneView


class ObjectLayer:
    """Owns the GL objects. GL thread only.

    Attributes:
        pixels_per_unit: Of the target that is drawn into.
        outlined: The objects to outline.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self.pixels_per_unit = 1.0
        self.outlined: Objects = ()
        self._ctx = ctx
        self._drawings: dict[int, ShareDrawing] = {}
        self._drawn: list[tuple[ShareDrawing, Color]] = []

    def release(self) -> None:
        """Free every GL object."""
        for drawing in self._drawings.values():
            drawing.release()
        self._drawings, self._drawn = {}, []

    @property
    def is_empty(self) -> bool:
        """Is there nothing to draw?"""
        return not self._drawn

    def take(self, session: SessionView, view: SceneView, gaussians: GaussianArrays | None) -> Hashable:
        """Take up where they are seen.

        Args:
            gaussians: Of the picture below; None where it is something else.
        Returns:
            A key that differs whenever what is drawn does.
        """
        wanted = {one.object_id: one for one in self.outlined} if gaussians is not None else {}
        for object_id in self._drawings.keys() - wanted.keys():
            self._drawings.pop(object_id).release()
        self._drawn = []
        for object_id, one in wanted.items():
            assert gaussians is not None
            share = session.object_share(object_id, gaussians, view.seen_from)
            if share is None:
                continue
            drawing = self._drawings.setdefault(object_id, ShareDrawing(self._ctx))
            drawing.take(share)
            self._drawn.append((drawing, (*one.color, 1.0)))
        return tuple((drawing.key, color) for drawing, color in self._drawn), self.pixels_per_unit

    def draw(self, target: Target) -> None:
        """Draw over the contents of the target."""
        for drawing, color in self._drawn:
            drawing.draw(target, color, self.pixels_per_unit, is_filled=False)
