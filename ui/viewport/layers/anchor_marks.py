"""Anchors as marks: which of them are shown, in which colour, and which one lies under the pointer. No GL.

Colour says what an anchor is (engine.clip_files.roles), shape whether this clip learned it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engine.camera.projection import to_camera, to_pixels
from engine.clip_files.roles import ROLES
from engine.gate.reasons import NO_REASON, USER_DYNAMIC, USER_STATIC, reason_text
from engine.gate.regions import GateRegion, marked
from ui.style.colors import ROLE_COLORS, Color
from ui.viewport.region_tool import REGION_WORDS

REACH_PX = 7.0
"""A mark this near to the pointer is the one that is meant."""
_WORDS = {
    "static": "static: the same at all times and in all clips",
    "moving": "moving: on the surface of what moved in the reference clip",
    "promoted": "promoted: stands still and changes, as under a lamp",
    "residual": "residual: moves in this clip, where the reference has nothing",
    "adapted": "moving, and trained further in this clip",
    "replacing": "promoted in this clip, in place of a static one",
}


@dataclass(frozen=True)
class AnchorMarks:
    """Anchors that are drawn.

    Attributes:
        positions: [N, 3]
        colors: [N, 4]
        roles, reasons: Codes of engine.clip_files.roles and engine.gate.reasons; None where unknown. [N] uint8
        counts: Of all anchors, drawn or not, by role; empty where unknown.
    """

    positions: np.ndarray
    colors: np.ndarray
    roles: np.ndarray | None
    reasons: np.ndarray | None
    counts: dict[str, int]

    def text(self, row: int, regions: Sequence[GateRegion] = ()) -> str:
        """Role of an anchor and its reason, in one to three lines; empty where unknown.

        Args:
            regions: Those marked by now; the clip may have been trained before.
        """
        if self.roles is None:
            return ""
        lines = [_WORDS[ROLES[int(self.roles[row])]]]
        code = NO_REASON if self.reasons is None else int(self.reasons[row])
        lines += [reason_text(code)] if reason_text(code) else []
        for treat, reason in (("static", USER_STATIC), ("dynamic", USER_DYNAMIC)):
            if code != reason and marked(self.positions[row : row + 1], regions, treat)[0]:
                lines.append(f"in a region marked as {REGION_WORDS[treat]}, in effect from the next training on")
        return "\n".join(lines)

    def at(self, world_to_camera: np.ndarray, K: np.ndarray, x: float, y: float, *, near: float) -> int | None:
        """The mark under the pointer, the nearest to the camera of those within reach; None where there is none.

        Args:
            world_to_camera: [4, 4]
            K: Of the picture in which x and y are pixels. [3, 3]
            near: Nearest depth that is drawn, scene units.
        """
        return nearest_under(self.positions, world_to_camera, K, x, y, near=near)


def nearest_under(
    positions: np.ndarray, world_to_camera: np.ndarray, K: np.ndarray, x: float, y: float, *, near: float
) -> int | None:
    """Row of the position under a pixel, see `AnchorMarks.at`. positions: [N, 3]"""
    points = to_camera(positions, world_to_camera)
    offsets = to_pixels(points, K) - (x, y)
    rows = np.flatnonzero((points[:, 2] > near) & ((offsets * offsets).sum(axis=1) <= REACH_PX**2))
    return int(rows[np.argmin(points[rows, 2])]) if len(rows) else None


def anchor_marks(
    positions: np.ndarray, roles: np.ndarray | None, reasons: np.ndarray | None, *, most: int, color: Color
) -> AnchorMarks:
    """Marks of at most that many anchors. color: Where that is unknown."""
    rows = thinned(np.arange(len(positions)), most)
    colors, counts = np.tile(np.array(color, np.float32), (len(rows), 1)), {}
    if roles is not None:
        colors = np.array([ROLE_COLORS[role] for role in ROLES], np.float32)[roles[rows]]
        numbers = np.bincount(roles, minlength=len(ROLES))
        counts = {role: int(n) for role, n in zip(ROLES, numbers, strict=True) if n}
    return AnchorMarks(
        positions=positions[rows],
        colors=colors,
        roles=None if roles is None else roles[rows],
        reasons=None if reasons is None else reasons[rows],
        counts=counts,
    )


def thinned(values: np.ndarray, most: int) -> np.ndarray:
    """At most this many rows, chosen by chance but always the same ones. [n <= most, ...]

    By chance, because anchors lie in the order of a grid: every tenth of them would draw stripes.
    """
    if len(values) <= most:
        return values
    return values[np.random.default_rng(0).choice(len(values), most, replace=False)]
