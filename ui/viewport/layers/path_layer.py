"""The chosen camera path over the picture: its way, its keys, and where the camera is at the playhead. Owns its
renderers; GL thread only. Knows no ImGui.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from app.session.session_view import SessionView
from engine.camera.camera_path import CameraKey, CameraPath
from ui.gl import NEAR, LineRenderer, PointRenderer, Target
from ui.style.colors import CHOSEN, PATH, Color
from ui.viewport.layers.frusta import frustum_size
from ui.viewport.layers.path_lines import key_pyramids, key_under, path_line

if TYPE_CHECKING:
    from ui.viewport.scene import SceneView

LINE, HALO = 2.2, 2.6
"""Width of lines, and by how much the dark ones below are wider; units."""
DIAMOND, CHOSEN_DIAMOND, RIM = 9.0, 13.0, 1.2
"""Diameters of the points at keys, and the width of their dark rim; units."""
REACH = 10.0
"""How near to the point of a key the pointer has to be; units."""
PYRAMID_SHARE, HERE_SHARE = 0.7, 0.6
"""Length of a key's pyramid, of that of a capture camera's; and of the camera at the playhead, of that of a key."""
DARK = np.array([0.03, 0.04, 0.05, 1.0], np.float32)
HERE: Color = (1.0, 1.0, 1.0, 1.0)
"""The camera at the playhead."""


class PathLayer:
    """Draws the chosen path; not in the view that goes along it.

    Attributes:
        pointed_key: The key under the pointer, which stands out; None without one.
        pixels_per_unit: Of the target that is drawn into.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self.pointed_key: int | None = None
        self.pixels_per_unit = 1.0
        self._halo, self._lines, self._here = LineRenderer(ctx), LineRenderer(ctx), LineRenderer(ctx)
        self._points, self._chosen = PointRenderer(ctx), PointRenderer(ctx)
        self._held: Hashable = None
        self._path: CameraPath | None = None  # of what is held; keeps its identity from being given away
        self._held_here: int | None = None

    def release(self) -> None:
        """Free every GL object."""
        for thing in (self._halo, self._lines, self._here, self._points, self._chosen):
            thing.release()

    def shown_path(self, session: SessionView) -> CameraPath | None:
        """The path that is drawn; None where there is none to be seen."""
        status = session.paths
        path = status.path
        is_on_it = status.along == session.views.current_index  # the camera stands on the line then
        if path is None or not path.keys or is_on_it or not session.overlays.show_paths:
            return None
        return path

    def is_empty(self, session: SessionView) -> bool:
        """Is there nothing to draw?"""
        return self.shown_path(session) is None

    def take(self, session: SessionView) -> Hashable:
        """Take up the path to draw. Returns a key that differs whenever the drawing does."""
        path = self.shown_path(session)
        if path is None:
            return None
        standing_out = session.paths.chosen_key if self.pointed_key is None else self.pointed_key
        standing_out = None if standing_out is None or standing_out >= len(path.keys) else standing_out
        key = (id(path), id(session.rig), standing_out)
        if key != self._held or path is not self._path:
            self._set(path, session, standing_out)
            self._held, self._path, self._held_here = key, path, None
        if session.timeline.frame_index != self._held_here:
            self._held_here = session.timeline.frame_index
            here = CameraKey(0.0, *path.at(self._held_here))
            size = HERE_SHARE * PYRAMID_SHARE * frustum_size(session.rig)
            self._here.set(*key_pyramids((here,), size, color=HERE))
        return (*key, self._held_here, self.pixels_per_unit)

    def _set(self, path: CameraPath, session: SessionView, standing_out: int | None) -> None:
        line = path_line(path)
        pyramids, colors = key_pyramids(path.keys, PYRAMID_SHARE * frustum_size(session.rig), chosen=standing_out)
        vertices = np.concatenate([line, pyramids])
        self._halo.set(vertices, DARK)
        line_colors = np.tile(np.array(PATH, np.float32), (len(line), 1))
        self._lines.set(vertices, np.concatenate([line_colors, colors]))
        centers = np.stack([key.center for key in path.keys])
        self._points.set(centers, np.array(PATH, np.float32))
        chosen = centers[:0] if standing_out is None else centers[standing_out : standing_out + 1]
        self._chosen.set(chosen, np.array(CHOSEN, np.float32))

    def key_under(self, session: SessionView, view: SceneView, x: float, y: float) -> int | None:
        """Number of the key under a pixel of the view; None where none is shown."""
        path, unit = self.shown_path(session), self.pixels_per_unit
        if path is None:
            return None
        return key_under(
            path.keys, view.world_to_camera, view.K, x, y, near=max(NEAR, view.near), reach_px=REACH * unit
        )

    def draw(self, target: Target, view: SceneView, session: SessionView) -> None:
        """Draw over the contents of the target."""
        if self.is_empty(session):
            return
        unit = self.pixels_per_unit
        self._halo.draw(target, *view.camera, width_px=(LINE + HALO) * unit, opacity=0.45)
        self._lines.draw(target, *view.camera, width_px=LINE * unit)
        self._here.draw(target, *view.camera, width_px=LINE * unit)
        rim = RIM * unit
        self._points.draw(target, *view.camera, shape="diamond", size=DIAMOND * unit, outline_px=rim)
        self._chosen.draw(target, *view.camera, shape="diamond", size=CHOSEN_DIAMOND * unit, outline_px=rim)
