"""Carries out commands about the display: time, views and their contents. Nothing of it is kept."""

from __future__ import annotations

from app.playback.modes.view_modes import CONTENTS, MODES
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.playback.views.views import Views
from app.residuals.heat_map import HEAT_KINDS
from app.session.clips.clip_commands import CompareVersion
from app.session.clips.comparing import show_version
from app.session.showing.look_commands import (
    ActivateView,
    FollowTraining,
    HomeView,
    LookCommand,
    LookThrough,
    SetCompare,
    SetCompareWith,
    SetContent,
    SetFrame,
    SetFrameMemory,
    SetMode,
    ShowHeat,
    ShowViews,
    ToggleOverlay,
    TogglePlay,
)
from app.status import CAPTURED, COMPARE_MODES, OVERLAY_NAMES, PROJECT, version_number


def look(command: LookCommand, timeline: Timeline, views: Views, playback: Playback) -> None:
    """Carry out a command on the current view.

    Raises:
        ValueError: There is no such mode, overlay or heat map.
    """
    view, overlays = views.current.view, views.current.overlays
    match command:
        case SetFrame(frame_index=frame_index):
            timeline.seek(frame_index)
        case TogglePlay():
            timeline.toggle_play()
        case FollowTraining(is_on=is_on):
            timeline.hold()
            timeline.is_following = is_on
        case LookThrough(camera_index=camera_index):
            view.look(camera_index)
        case SetCompare(mode=mode):
            if mode not in COMPARE_MODES:
                raise ValueError(f"compare is one of {', '.join(COMPARE_MODES)}, not {mode!r}")
            overlays.compare = mode
        case ToggleOverlay(name=name):
            if name not in OVERLAY_NAMES:
                raise ValueError(f"overlays are {', '.join(OVERLAY_NAMES)}, not {name!r}")
            setattr(overlays, name, not getattr(overlays, name))
        case ShowHeat(kind=kind):
            if kind and kind not in HEAT_KINDS:
                raise ValueError(f"heat maps are {', '.join(HEAT_KINDS)}, not {kind!r}")
            overlays.heat = kind
        case SetCompareWith(other=other):
            if other not in (CAPTURED, PROJECT, *MODES) and version_number(other) is None:
                known = f"{CAPTURED}, {PROJECT}, {', '.join(MODES)} and versions"
                raise ValueError(f"pictures to compare with are {known}, not {other!r}")
            overlays.compare_with = other
        case SetMode(mode=mode):
            if mode not in MODES:
                raise ValueError(f"modes are {', '.join(MODES)}, not {mode!r}")
            overlays.mode = mode
        case SetContent(content=content):
            if content not in CONTENTS:
                raise ValueError(f"parts of a clip are {', '.join(CONTENTS)}, not {content!r}")
            overlays.content = content
        case SetFrameMemory(megabytes=megabytes):
            playback.decoder.keep_megabytes(megabytes)
        case HomeView():
            view.home()
        case CompareVersion():
            show_version(command, timeline, overlays)
        case ShowViews(n=n):
            views.show(n)
            playback.favour(views.active_index)
        case ActivateView(index=index):
            views.activate(index)
            playback.favour(views.active_index)
