"""The picture that is drawn, and the one that ought to be on screen. Plain values."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from pathlib import Path

OVERLAY_NAMES = (
    "show_frusta",
    "show_inherited",
    "show_residual",
    "show_points",
    "show_cloud",
    "show_regions",
    "show_coverage",
    "show_trails",
    "show_paths",
)
COMPARE_MODES = ("off", "wipe", "side", "blink")
CAPTURED = "captured"
"""Of Overlays.compare_with: the camera's picture."""
PROJECT = "project"
"""Of Overlays.compare_with: the other project, see OtherStatus."""
_VERSION = "version "
BLINK_HZ = (0.25, 3.0)
"""Slowest and fastest blinking. More than three flashes a second can cause seizures."""


def version_name(number: int) -> str:
    """An earlier version of a clip, for Overlays.compare_with."""
    return f"{_VERSION}{number}"


def version_number(other: str) -> int | None:
    """Inverse of `version_name`; None of anything else."""
    number = other.removeprefix(_VERSION)
    return int(number) if other.startswith(_VERSION) and number.isascii() and number.isdigit() else None


@dataclass(slots=True)
class Overlays:
    """Drawings over the scene or next to it.

    Attributes:
        show_points: The point cloud where a clip is not trained.
        show_cloud: The point cloud in place of the picture of a trained clip.
        show_coverage: The space that inherited anchors cover, and how far residual anchors lie from it.
        show_trails: The ways that Gaussians took over the last frames.
        show_paths: The chosen camera path and its keys.
        compare: "off", "wipe", "side" or "blink": another picture over, next to or in turn with the rendered one.
        compare_with: The other picture: CAPTURED, PROJECT, the name of a mode (see view_modes), or that of an earlier
            version of the clip, see `version_name`.
        wipe_position: Share of the width that shows the other picture, 0..1.
        blink_hz: How often a second each of the two pictures is seen.
        mode, content: Meaning of colours and the drawn part of a clip, by name; see app.playback.modes.view_modes.
        heat: Name of the residual heat map over the picture, see app.residuals.heat_map.HEAT_KINDS; empty for none.
            Where no camera is looked through, the residual of each anchor is shown in its place.
        heat_opacity: Of the heat map, 0..1.
        mark_size: Of anchor marks, 1 as designed.
        mark_opacity: Of anchor marks that nothing hides, 0..1.
    """

    show_frusta: bool = True
    show_inherited: bool = False
    show_residual: bool = False
    show_points: bool = True
    show_cloud: bool = False
    show_regions: bool = True
    show_coverage: bool = False
    show_trails: bool = False
    show_paths: bool = True
    compare: str = "off"
    compare_with: str = CAPTURED
    blink_hz: float = 1.0
    wipe_position: float = 0.5
    mode: str = "color"
    content: str = "all"
    heat: str = ""
    heat_opacity: float = 0.75
    mark_size: float = 1.0
    mark_opacity: float = 0.9


@dataclass(frozen=True, slots=True)
class OtherStatus:
    """Another project that the open one is compared with.

    Attributes:
        name: As shown to the user.
        n_frames: Past the end, its last frame is shown.
        missing: Why there is no picture of it; empty where one is there, or on its way.
    """

    name: str
    folder: Path
    n_frames: int
    missing: str = ""


@dataclass(frozen=True, slots=True)
class WantedFrame:
    """The picture that ought to be on screen, whatever is there by now.

    Attributes:
        clip_index, frame_index: Under the playhead.
        revision: The state of the clip that is to be shown; empty where none can be: it is not trained.
        camera_index: The capture camera looked through; None for a free view.
        look: From where and through which lens; see OrbitView.look_key.
        shown_as: Meaning of colours and the drawn part of the clip, in words; empty for the scene as it is.
        is_loaded: Whether the clip is in memory, so that only its frame has to be made.
        has_failed: Whether the frame or its picture could not be made, so that it is not on its way.
    """

    clip_index: int
    frame_index: int
    revision: str = ""
    camera_index: int | None = None
    look: Hashable = None
    shown_as: str = ""
    is_loaded: bool = False
    has_failed: bool = False
