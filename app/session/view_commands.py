"""What commands make of what the user looks at: time, views, and what is shown in them. Nothing of it is kept."""

from __future__ import annotations

from app.playback.modes.view_modes import CONTENTS, MODES
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.playback.views.views import Views
from app.residuals.heat_map import HEAT_KINDS
from app.session import commands as c
from app.status import CAPTURED, COMPARE_MODES, OVERLAY_NAMES, version_number

LookCommand = (
    c.SetFrame
    | c.TogglePlay
    | c.FollowTraining
    | c.LookThrough
    | c.SetCompare
    | c.ToggleOverlay
    | c.ShowHeat
    | c.SetCompareWith
    | c.SetMode
    | c.SetContent
    | c.SetFrameMemory
    | c.HomeView
    | c.ShowViews
    | c.ActivateView
)


def look(command: LookCommand, timeline: Timeline, views: Views, playback: Playback) -> None:
    """Carry out a command on the current view.

    Raises:
        ValueError: There is no such mode, overlay or heat map.
    """
    view, overlays = views.current.view, views.current.overlays
    match command:
        case c.SetFrame(frame_index=frame_index):
            timeline.seek(frame_index)
        case c.TogglePlay():
            timeline.toggle_play()
        case c.FollowTraining(is_on=is_on):
            timeline.hold()
            timeline.is_following = is_on
        case c.LookThrough(camera_index=camera_index):
            view.look(camera_index)
        case c.SetCompare(mode=mode):
            if mode not in COMPARE_MODES:
                raise ValueError(f"compare is one of {', '.join(COMPARE_MODES)}, not {mode!r}")
            overlays.compare = mode
        case c.ToggleOverlay(name=name):
            if name not in OVERLAY_NAMES:
                raise ValueError(f"overlays are {', '.join(OVERLAY_NAMES)}, not {name!r}")
            setattr(overlays, name, not getattr(overlays, name))
        case c.ShowHeat(kind=kind):
            if kind and kind not in HEAT_KINDS:
                raise ValueError(f"heat maps are {', '.join(HEAT_KINDS)}, not {kind!r}")
            overlays.heat = kind
        case c.SetCompareWith(other=other):
            if other != CAPTURED and other not in MODES and version_number(other) is None:
                known = f"{CAPTURED}, {', '.join(MODES)} and versions"
                raise ValueError(f"pictures to compare with are {known}, not {other!r}")
            overlays.compare_with = other
        case c.SetMode(mode=mode):
            if mode not in MODES:
                raise ValueError(f"modes are {', '.join(MODES)}, not {mode!r}")
            overlays.mode = mode
        case c.SetContent(content=content):
            if content not in CONTENTS:
                raise ValueError(f"parts of a clip are {', '.join(CONTENTS)}, not {content!r}")
            overlays.content = content
        case c.SetFrameMemory(megabytes=megabytes):
            playback.decoder.keep_megabytes(megabytes)
        case c.HomeView():
            view.home()
        case c.ShowViews(n=n):
            views.show(n)
            playback.favour(views.active_index)
        case c.ActivateView(index=index):
            views.activate(index)
            playback.favour(views.active_index)
