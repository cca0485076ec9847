"""The tool that selects: which one is in use, what it has drawn so far, and its options. State of the window; no ImGui,
no GL.

Places in the picture are logical pixels of the window, until a command is made of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from app.session.editing.selection_commands import (
    Brush,
    How,
    Lasso,
    Rectangle,
    SelectFlood,
    SelectInPicture,
    SelectVolume,
    Shape,
)
from engine.camera.projection import to_camera
from engine.camera.rotations import quats_of
from engine.editing.actions import vector_of
from engine.editing.edit import Box, Prism, Sphere, Volume
from engine.editing.selection.seen_from import SeenFrom
from engine.editing.selection.set_algebra import SelectMode
from engine.editing.volumes.prisms import prism_of_lasso

ToolKind = Literal["rectangle", "lasso", "brush", "box", "sphere", "prism", "flood"]
TOOLS: tuple[ToolKind, ...] = get_args(ToolKind)
TOOL_WORDS: dict[ToolKind, str] = {
    "rectangle": "Rectangle",
    "lasso": "Lasso",
    "brush": "Brush",
    "box": "Box",
    "sphere": "Sphere",
    "prism": "Prism",
    "flood": "Flood",
}
TOOL_HINTS: dict[ToolKind, str] = {
    "rectangle": "Drag over the picture, or click on an anchor",
    "lasso": "Drag a loop, or click on an anchor",
    "brush": "Paint over Gaussians; [ ] or Ctrl + wheel change its size",
    "box": "Drag on a surface; Ctrl + wheel changes its height",
    "sphere": "Press on a surface and drag",
    "prism": "Drag a loop; the volume is as deep as the things under it",
    "flood": "Click on something; Ctrl + wheel changes the tolerance",
}
Depths = Callable[[np.ndarray], tuple[float, float] | None]
MODE_WORDS: dict[SelectMode, str] = {
    "replace": "New",
    "add": "Add",
    "subtract": "Subtract",
    "intersect": "Intersect",
}
VOLUME_TOOLS: tuple[ToolKind, ...] = ("box", "sphere", "prism")
"""Tools that draw a volume in space, which has handles then."""
SIZED: tuple[ToolKind, ...] = ("brush", "box", "flood")
"""Tools whose size the wheel changes with Ctrl."""
SMALLEST_BRUSH, LARGEST_BRUSH = 2.0, 400.0
"""Radii, logical pixels."""
GROWTH = 1.15
"""Factor of a tick of the wheel, or a press of a key."""
LEAST_STEP_PX = 1.5
"""Points of a line that are nearer to each other than this count once."""
STANDING_SHARE = 0.95
"""How far the middle of a box lies above the surface that it stands on, in half heights: the surface belongs to it."""


@dataclass(eq=False)
class SelectTool:
    """The tool for selecting, and its settings.

    Attributes:
        kind: The tool in use; None while the pointer leads the view.
        mode: How a drag changes the selection while no modifier is held.
        is_visible_only, is_by_extent, is_whole_anchors: See app.session.editing.selection_commands.
        brush_px: Radius of the brush, logical pixels.
        color_tolerance: Of the flood, 0..1.
        box_height: Of a box that is drawn, in lengths of its longer side on the surface.
        near_share: How far neighbours are apart at most, in distances between anchors.
        points: Of the drag in progress; empty without one. Logical pixels.
        held_mode: How that drag changes the selection.
        surface: Place on the surface where a volume began, scene units, [3]; None without one.
        volume: The volume that was drawn last or typed; None before the first.
        attribute: Name of the one that the panel shows.
        ranges: Chosen range by attribute, as shares of its axis.
        is_high_held: Whether the pointer leads the upper end of the range, not the lower one.
    """

    kind: ToolKind | None = None
    mode: SelectMode = "replace"
    is_visible_only: bool = False
    is_by_extent: bool = False
    is_whole_anchors: bool = False
    brush_px: float = 24.0
    color_tolerance: float = 0.12
    box_height: float = 1.0
    near_share: float = 1.5
    points: list[tuple[float, float]] = field(default_factory=list)
    held_mode: SelectMode = "replace"
    surface: np.ndarray | None = None
    volume: Volume | None = None
    attribute: str = "opacity"
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    is_high_held: bool = False

    @property
    def is_active(self) -> bool:
        """Whether a press in the picture selects."""
        return self.kind is not None

    @property
    def is_dragging(self) -> bool:
        """Whether something is being drawn."""
        return bool(self.points)

    def choose(self, kind: ToolKind) -> None:
        """Take a tool; the one in use is put away."""
        is_same = kind == self.kind
        self.leave()
        self.kind = None if is_same else kind

    def leave(self) -> None:
        """Drop the drawing in progress; without one, put the tool away."""
        if not self.is_dragging:
            self.kind = None
        self.points, self.surface = [], None

    def how(self, mode: SelectMode | None = None) -> How:
        """As commands want it. mode: Another than the one in use."""
        return How(self.mode if mode is None else mode, self.is_whole_anchors)

    def mode_held(self, *, is_shift: bool, is_ctrl: bool, is_alt: bool) -> SelectMode:
        """How a drag changes the selection with these modifiers held."""
        if is_shift and (is_ctrl or is_alt):
            return "intersect"
        if is_shift:
            return "add"
        return "subtract" if is_ctrl or is_alt else self.mode

    def resize(self, steps: float) -> bool:
        """Make brush, tolerance, or the height of the box larger or smaller, by steps of the wheel. Whether the box
        that was drawn last has changed with it."""
        factor = GROWTH**steps
        if self.kind == "flood":
            self.color_tolerance = float(np.clip(self.color_tolerance * factor, 0.01, 1.0))
        elif self.kind == "box":
            self.box_height = float(np.clip(self.box_height * factor, 0.01, 100.0))
            if isinstance(self.volume, Box) and not self.is_dragging:
                x, y, z = self.volume.half_sizes
                self.volume = Box(self.volume.center, (x, y * factor, z), self.volume.quat)
                return True
        elif self.kind == "brush":
            self.brush_px = float(np.clip(self.brush_px * factor, SMALLEST_BRUSH, LARGEST_BRUSH))
        return False

    # ---------------------------------------------------------------- drags

    def begin(self, x: float, y: float, mode: SelectMode, surface: np.ndarray | None) -> None:
        """A press. surface: The place that is seen there; None where there is nothing. Scene units, [3]"""
        self.points, self.held_mode, self.surface = [(x, y)], mode, surface

    def extend(self, x: float, y: float) -> None:
        """The pointer moved on."""
        last = self.points[-1]
        if abs(x - last[0]) + abs(y - last[1]) >= LEAST_STEP_PX:
            self.points.append((x, y))

    def shape(self, low: tuple[float, float], density: float) -> Shape | None:
        """The shape drawn over the picture, in its pixels; None for other tools.

        Args:
            low: Upper left corner of the picture, logical pixels.
            density: Pixels of the picture per logical pixel.
        """
        if not self.points:
            return None
        at = [((x - low[0]) * density, (y - low[1]) * density) for x, y in self.points]
        match self.kind:
            case "rectangle":
                return Rectangle(*at[0], *at[-1])
            case "lasso" | "prism":
                return Lasso(tuple(at))
            case "brush":
                return Brush(tuple(at), self.brush_px * density)
            case _:
                return None

    def volume_under(
        self, view: SeenFrom, low: tuple[float, float], density: float, up: np.ndarray
    ) -> Box | Sphere | None:
        """The volume of the drag in space: a sphere around the place of the press, or a box that stands on the surface
        there; None where nothing was pressed, or it is too small. Arguments as of `shape`; up: [3]"""
        if self.surface is None or len(self.points) < 2 or self.kind not in ("box", "sphere"):
            return None
        center = self.surface
        depth = float(to_camera(center[None], view.world_to_camera)[0, 2])
        if self.kind == "sphere":
            (ax, ay), (bx, by) = self.points[0], self.points[-1]
            radius = float(np.hypot(bx - ax, by - ay)) * density * depth / float(np.sqrt(view.K[0, 0] * view.K[1, 1]))
            return Sphere(vector_of(center), radius) if radius > 0.0 else None
        corner = _on_plane(view, self.points[-1], low, density, center, up)
        if corner is None:
            return None
        axes = _standing_axes(view.world_to_camera, up)  # columns: right, up, towards the eye
        along = axes.T @ (corner - center)
        width, length = abs(float(along[0])), abs(float(along[2]))
        if min(width, length) <= 1e-6 * depth:
            return None
        height = 0.5 * self.box_height * max(width, length)
        middle = center + 0.5 * (corner - center) + STANDING_SHARE * height * axes[:, 1]
        return Box(vector_of(middle), (width / 2, height, length / 2), standing_quat(view.world_to_camera, up))

    def prism_under(self, view: SeenFrom, low: tuple[float, float], density: float, depths_of: Depths) -> Prism | None:
        """The prism of the loop; None where it is too small, or nothing is under it. Arguments as of `command`."""
        shape = self.shape(low, density)
        if not isinstance(shape, Lasso) or len(shape.points) < 3:
            return None
        pixels = np.array(shape.points)
        depths = depths_of(pixels)
        return None if depths is None else prism_of_lasso(pixels, view.world_to_camera, view.K, depths)

    def command(
        self,
        view: SeenFrom,
        low: tuple[float, float],
        density: float,
        up: np.ndarray,
        spacing: float,
        depths_of: Depths = lambda pixels: None,
    ) -> SelectInPicture | SelectVolume | SelectFlood | None:
        """The command of the drag that ends now; None where it means nothing.

        Args:
            spacing: Between anchors, scene units.
            depths_of: From where to where a prism around a loop of pixels [P, 2] reaches; None where nothing is there.
        """
        how = self.how(self.held_mode)
        shape = self.shape(low, density)
        if shape is not None and self.kind != "prism":
            return SelectInPicture(shape, view, how, self.is_visible_only, self.is_by_extent)
        if self.kind == "flood":
            if self.surface is None:
                return None
            return SelectFlood(vector_of(self.surface), self.near_share * spacing, self.color_tolerance, how)
        if self.kind == "prism":
            volume = self.prism_under(view, low, density, depths_of)
        else:
            volume = self.volume_under(view, low, density, up)
        if volume is None:
            return None
        self.volume = volume
        return SelectVolume(volume, how, self.is_by_extent)


def _on_plane(
    view: SeenFrom, at: tuple[float, float], low: tuple[float, float], density: float, place: np.ndarray, up: np.ndarray
) -> np.ndarray | None:
    """Where the ray of a place in the window meets the level plane through a place; None where it does not."""
    rotation, K = view.world_to_camera[:3, :3], view.K
    pixel = np.array([(at[0] - low[0]) * density, (at[1] - low[1]) * density, 1.0])
    direction = rotation.T @ np.linalg.solve(K, pixel)
    eye = -rotation.T @ view.world_to_camera[:3, 3]
    across = float(direction @ up)
    share = float((place - eye) @ up) / across if abs(across) > 1e-9 else -1.0
    return eye + share * direction if share > 0.0 else None


def _standing_axes(world_to_camera: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Axes of a box that stands upright and faces a view, as columns. [3, 3]"""
    up = np.asarray(up, np.float64) / np.linalg.norm(up)
    right = world_to_camera[0, :3] - (world_to_camera[0, :3] @ up) * up
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-6 else np.linalg.svd(up[None])[2][1]
    return np.stack([right, up, np.cross(right, up)], axis=1)


def standing_quat(world_to_camera: np.ndarray, up: np.ndarray) -> tuple[float, float, float, float]:
    """Turns the axes of a box so that it stands upright and faces a view. wxyz"""
    w, x, y, z = (float(value) for value in quats_of(_standing_axes(world_to_camera, up)))
    return w, x, y, z
