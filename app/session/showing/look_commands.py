"""Commands about the display: time, views and their contents. Nothing of it is kept."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.session.clips.clip_commands import CompareVersion


@dataclass(frozen=True, slots=True)
class SetFrame:
    """Move the playhead; frames outside the capture are clamped."""

    frame_index: int


@dataclass(frozen=True, slots=True)
class TogglePlay:
    """Play or hold."""


@dataclass(frozen=True, slots=True)
class FollowTraining:
    """Follow the training: the playhead stands in the clip with the newest state, until the user moves it."""

    is_on: bool = True


@dataclass(frozen=True, slots=True)
class LookThrough:
    """Look through a capture camera, or freely again with None."""

    camera_index: int | None


@dataclass(frozen=True, slots=True)
class SetCompare:
    """Compare with another picture: "off", "wipe", "side" or "blink"."""

    mode: str


@dataclass(frozen=True, slots=True)
class SetCompareWith:
    """Choose the picture to compare with. other: See Overlays.compare_with."""

    other: str


@dataclass(frozen=True, slots=True)
class CompareProject:
    """Compare with another project; a scene of another program is imported first, unless that was done before."""

    path: Path


@dataclass(frozen=True, slots=True)
class ToggleOverlay:
    """Switch one of the overlays: show_frusta, show_inherited, show_residual, show_points, show_cloud, show_regions."""

    name: str


@dataclass(frozen=True, slots=True)
class ShowHeat:
    """Show a residual heat map over the picture, by its name; an empty one takes it away."""

    kind: str


@dataclass(frozen=True, slots=True)
class SetMode:
    """Let colours mean something else. mode: See app.playback.modes.view_modes.MODES."""

    mode: str


@dataclass(frozen=True, slots=True)
class SetContent:
    """Draw a part of the clips. content: See app.playback.modes.view_modes.CONTENTS."""

    content: str


@dataclass(frozen=True, slots=True)
class SetFrameMemory:
    """Limit the decoded frames kept, in megabytes; None for the default."""

    megabytes: int | None


@dataclass(frozen=True, slots=True)
class HomeView:
    """Frame the point that the cameras look at."""


@dataclass(frozen=True, slots=True)
class ShowViews:
    """Show one, two or four views side by side."""

    n: int


@dataclass(frozen=True, slots=True)
class ActivateView:
    """Let keys, menus and the toolbar act on another view."""

    index: int


LookCommand = (
    SetFrame
    | TogglePlay
    | FollowTraining
    | LookThrough
    | SetCompare
    | ToggleOverlay
    | ShowHeat
    | SetCompareWith
    | SetMode
    | SetContent
    | SetFrameMemory
    | HomeView
    | ShowViews
    | ActivateView
    | CompareVersion
)
"""Commands on time, views and their contents."""
