"""The sphere that is being chosen, and which of the marked regions stands out. State of the window; no ImGui, no GL.

The pointer leads the sphere until it is placed; keys move it along the axes of the view.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.playback.views.scene_axes import rig_radius
from app.session.editing.mark_commands import MarkRegion
from engine.camera.rig import CameraRig
from engine.gate.regions import GateRegion, sphere_region

REGION_WORDS = {"static": "static", "dynamic": "moving"}
"""How the window calls the two treatments of engine.gate.regions."""
FIRST_RADIUS_SHARE = 0.05
"""Radius of the first sphere, as a share of its distance from the eye."""
SMALLEST_SHARE, LARGEST_SHARE = 1e-3, 2.0
"""Radii that can be chosen, as shares of the rig's radius."""
GROWTH = 1.1
"""Factor of a tick of the wheel, or a press of a key."""
SHIFT_SHARE = 0.25
"""A press of a key moves the sphere by this share of its radius."""


@dataclass(eq=False)
class RegionTool:
    """The region that the user is marking.

    Attributes:
        is_active: Whether a sphere is being chosen.
        treat: "static" or "dynamic".
        center: None until the viewport has found what lies under the pointer. Scene units, [3]
        radius: Scene units; 0 before the first sphere.
        is_placed: It stays where it is when the pointer moves.
        is_accepted: It is to be marked as soon as the viewport has taken in where the pointer is.
        highlighted: Position in the list of a marked region that is to stand out, or None.
    """

    is_active: bool = False
    treat: str = "static"
    center: np.ndarray | None = None
    radius: float = 0.0
    is_placed: bool = False
    is_accepted: bool = False
    highlighted: int | None = None
    _rig: CameraRig | None = None

    def follow(self, rig: CameraRig | None, n_regions: int, *, can_mark: bool) -> None:
        """Drop everything of another capture or of a removed region, and anything that can no longer be marked."""
        if rig is not self._rig:
            self._rig, self.radius = rig, 0.0
            self.leave()
            self.highlighted = None
        if not can_mark:
            self.leave()
        if self.highlighted is not None and self.highlighted >= n_regions:
            self.highlighted = None

    def begin(self) -> None:
        """Choose a sphere; while one is being chosen, switch between static and dynamic."""
        if self.is_active:
            self.treat = "dynamic" if self.treat == "static" else "static"
        else:
            self.leave()
            self.is_active, self.highlighted = True, None

    def leave(self) -> None:
        """Choose no more; nothing was marked."""
        self.is_active = self.is_placed = self.is_accepted = False
        self.center = None

    @property
    def radius_limits(self) -> tuple[float, float]:
        """Smallest and largest radius, scene units."""
        largest = 1.0 if self._rig is None else rig_radius(self._rig)
        return SMALLEST_SHARE * largest, LARGEST_SHARE * largest

    def set_radius(self, radius: float) -> None:
        """Choose a radius, held within the limits. Scene units"""
        self.radius = float(np.clip(radius, *self.radius_limits))

    def place(self, center: np.ndarray, *, eye: np.ndarray) -> None:
        """Put the sphere somewhere; the first one gets a size that suits its distance. Scene units, [3]"""
        self.center = np.asarray(center, dtype=np.float64)
        if self.radius <= 0.0:
            self.set_radius(FIRST_RADIUS_SHARE * float(np.linalg.norm(self.center - eye)))

    def shift(self, world_to_camera: np.ndarray, right: float, down: float, forward: float) -> None:
        """Move the sphere along the axes of a view, in steps; the pointer no longer leads it."""
        if self.is_active and self.center is not None:
            axes = np.asarray(world_to_camera, dtype=np.float64)[:3, :3]  # its rows are the view's axes
            self.center = self.center + SHIFT_SHARE * self.radius * (np.array([right, down, forward]) @ axes)
            self.is_placed = True

    def highlight_next(self, n_regions: int) -> None:
        """Step through the marked regions, then to none."""
        if n_regions:
            following = 0 if self.highlighted is None else self.highlighted + 1
            self.highlighted = following if following < n_regions else None

    @property
    def sphere(self) -> GateRegion | None:
        """The region to mark; None before there is any."""
        if not self.is_active or self.center is None:
            return None
        return sphere_region(self.treat, self.center.tolist(), self.radius)

    def take_accepted(self) -> MarkRegion | None:
        """The command that marks an accepted sphere, after which none is being chosen; None before it is accepted."""
        sphere = self.sphere
        if sphere is None or not self.is_accepted:
            return None
        self.leave()
        return MarkRegion(sphere.treat, sphere.center, sphere.radius)
