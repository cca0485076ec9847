"""View modes: what the colours of a picture mean, and which part of a clip is decoded for it. Plain values.

A mode either gives Gaussians other colours before they are drawn, or is a picture of numbers, which are coloured by a
map on a range that stays the same over time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType

from app.playback.modes import hues
from engine.camera.rig import CameraRig

COLOR = "color"
ALL = "all"


@dataclass(frozen=True, slots=True)
class ViewMode:
    """One way to colour a scene.

    Attributes:
        name: In overlays, preferences and actions.
        label: As shown to the user.
        explanation: One line.
        unit: Of its numbers.
        map_name: Of app.playback.modes.color_maps; empty where colours stand for no numbers.
        is_picture: Whether it is made of the rasterizer's numbers, pixel by pixel, and not by giving Gaussians other
            colours.
        legend: Hues that mean something, and their words.
    """

    name: str
    label: str
    explanation: str
    unit: str = ""
    map_name: str = ""
    is_picture: bool = False
    legend: tuple[tuple[hues.Hue, str], ...] = ()


_BIRTHS = (
    "from the reference clip",
    "from it, trained further",
    "born in this clip",
    "filled behind an edit",
    "filled behind an edit, a guess",
)
BIRTH_HUES = (hues.SKY, hues.GREEN, hues.ORANGE, hues.YELLOW, hues.PURPLE)
"""By code of a birth: see app.playback.modes.contents."""

_NORMAL_LEGEND = (
    ((1.0, 0.5, 0.5), "red: faces right (x)"),
    ((0.5, 1.0, 0.5), "green: faces down (y)"),
    ((0.5, 0.5, 1.0), "blue: faces the camera (-z)"),
)
_BIRTH_LEGEND = tuple(zip(BIRTH_HUES, _BIRTHS, strict=True))

MODES = MappingProxyType(
    {
        mode.name: mode
        for mode in (
            ViewMode(COLOR, "Colour", "The scene in its own colours"),
            ViewMode(
                "depth",
                "Depth",
                "Distance along the viewing axis: blended depth divided by opacity",
                "scene units",
                "viridis",
                is_picture=True,
            ),
            ViewMode("opacity", "Opacity", "How much of what lies behind is covered", "", "gray", is_picture=True),
            ViewMode(
                "normals",
                "Normals",
                "Which way surfaces face, from differences of depth, in camera axes: x right, y down, z forward",
                is_picture=True,
                legend=_NORMAL_LEGEND,
            ),
            ViewMode(
                "ellipsoids",
                "Ellipsoids",
                "Every Gaussian as a solid ellipsoid",
                is_picture=True,
            ),
            ViewMode(
                "overdraw",
                "Overdraw",
                "How many Gaussians blend in a pixel, which is what drawing costs",
                "Gaussians",
                "inferno",
                is_picture=True,
            ),
            ViewMode("anchors", "Anchors", "Only anchors, as small balls coloured by kind"),
            ViewMode(
                "birth",
                "Birth clip",
                "Which clip brought a Gaussian into the scene",
                legend=_BIRTH_LEGEND,
            ),
            ViewMode(
                "changed",
                "Changed",
                "Largest change since the reference clip: of colour, of opacity, or of place in anchor spacings",
                "",
                "inferno",
                legend=((hues.SKY, "not in the reference clip"),),
            ),
        )
    }
)
"""Every mode by name, in the order of menus and keys."""


@dataclass(frozen=True, slots=True)
class Content:
    """Which part of a clip is decoded."""

    name: str
    label: str
    explanation: str


CONTENTS = MappingProxyType(
    {
        content.name: content
        for content in (
            Content(ALL, "Everything", "All Gaussians with all features"),
            Content("static", "Static only", "Only Gaussians without a dynamic feature"),
            Content("dynamic", "Dynamic only", "Only Gaussians with a dynamic feature"),
            Content("f_s", "f_s only", "Dynamic features set to zero: only what does not depend on time"),
            Content("f_d", "f_d only", "Static features set to zero: only what the field adds to the cloud's colours"),
        )
    }
)
"""Every part by name, in the order of menus."""


@dataclass(frozen=True, slots=True)
class ShownAs:
    """A mode and a part of the clip, by name."""

    mode: str = COLOR
    content: str = ALL

    @property
    def label(self) -> str:
        """In words; empty for the scene as it is."""
        words = [] if self.content == ALL else [CONTENTS[self.content].label]
        words += [] if self.mode == COLOR else [MODES[self.mode].label]
        return ", ".join(words)


PLAIN = ShownAs()
"""The scene as it is."""


def decoded_as(shown_as: ShownAs) -> ShownAs:
    """Its mode and content to decode: most modes are made of the same Gaussians as the scene in its own colours."""
    return shown_as if shown_as.mode == "changed" else ShownAs(content=shown_as.content)


_DEPTH_REACH = 2.0
"""Depths are shown up to this many times the usual distance from a camera to the focus of all of them."""


def range_of(mode: str, rig: CameraRig | None) -> tuple[float, float]:
    """Lowest and highest value that colours of a mode distinguish: the same in all frames and from everywhere.

    Args:
        rig: Depths follow from its size; None takes a rig of size 1.
    """
    match mode:
        case "depth":
            return 0.0, _DEPTH_REACH * rig_distance(rig)
        case "overdraw":
            return 0.0, 100.0
        case "changed":
            return 0.0, 0.5
        case _:
            return 0.0, 1.0


def rig_distance(rig: CameraRig | None) -> float:
    """Mean distance from a camera to the focus of all of them, to two digits, scene units; 1 where that is unknown."""
    if rig is None or len(rig) == 0:
        return 1.0
    offsets = rig.centers - rig.focus_point()
    distance = float((offsets**2).sum(axis=1).mean() ** 0.5)
    if not (math.isfinite(distance) and distance > 1e-9):
        return 1.0
    return float(f"{distance:.1e}")
