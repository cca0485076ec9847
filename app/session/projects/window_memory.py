"""The window as it was when last used: its size, layout and scale, and for each project the frame, the views and the
overlays. A checked JSON file next to the preferences; a project that may only be read has its place, too.

Knows no window: sizes and the layout are plain values that only `ui` understands.
"""

from __future__ import annotations

import logging
import math
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.document.project_document import MAX_TEXT_CHARACTERS
from app.playback.timeline import SPEEDS, Timeline
from app.playback.views.bookmarks import read_bookmarks
from app.playback.views.orbit_view import OrbitView
from app.playback.views.view_place import ViewPlace
from app.playback.views.views import COUNTS
from app.session.session_view import SessionView
from app.status import COMPARE_MODES, OVERLAY_NAMES, Overlays
from engine.errors import EngineError
from engine.storage.json_files import read_checked_json, write_checked_json
from engine.user_folders import config_dir

logger = logging.getLogger(__name__)

MAX_PROJECTS = 60
MAX_LAYOUT_CHARACTERS = 100_000
MAX_SIDE_PX = 32_768
MAX_WORD_CHARACTERS = 40
MAX_LANES = 20
SCHEMA = 1
WRITING_TIMEOUT_S = 5.0


@dataclass
class WindowMemory:
    """The values, read once; `save` writes them if they differ from those on disk.

    A file that is damaged counts as empty, never as a failure; so does a value in it that is not valid.

    Attributes:
        path: The file.
        size: Of the window, pixels of the screen; None before the first time.
        is_maximized: Whether it filled the screen.
        ui_scale: Chosen scale of the interface; None follows the screen.
        layout: Where the panels are, as text of ImGui's; empty before the first time.
        mark_size, mark_opacity: Of anchor marks; None where none was chosen.
        navigation: Name of the preset of gestures, see ui.panels.picture.gestures.
        is_motion_reduced: Whether the view jumps instead of moving.
        time_unit: In which the timeline counts; empty where none was chosen.
        folded_lanes: Lanes of the timeline that are folded away, by name.
        views: By project folder, the one used last at the end; see `view_of` and `show_again`.
        failure: Why the file could not be written; empty while it could.
    """

    path: Path
    size: tuple[int, int] | None = None
    is_maximized: bool = False
    ui_scale: float | None = None
    layout: str = ""
    mark_size: float | None = None
    mark_opacity: float | None = None
    navigation: str = "studio"
    is_motion_reduced: bool = False
    time_unit: str = ""
    folded_lanes: tuple[str, ...] = ()
    views: dict[str, dict[str, Any]] = field(default_factory=dict)
    _saved: dict[str, Any] = field(default_factory=dict, repr=False)
    failure: str = ""
    _writing: threading.Thread | None = field(default=None, repr=False)

    def keep_view(self, folder: str, view: dict[str, Any]) -> None:
        """Keep the views of a project; the one that was not used for longest is forgotten."""
        self.views.pop(folder, None)
        self.views[folder] = view
        for old in list(self.views)[:-MAX_PROJECTS]:
            del self.views[old]

    def save(self) -> None:
        """Write the file now if something changed. A disk that refuses costs the memory, nothing else."""
        if self._writing is not None:
            self._writing.join(WRITING_TIMEOUT_S)
        document = self._document()
        if document != self._saved:
            self._write(document)

    def save_soon(self) -> None:
        """The same on a thread: a disk that is busy with a training's files may take a second to be certain."""
        document = self._document()
        is_writing = self._writing is not None and self._writing.is_alive()
        if document != self._saved and not is_writing:  # else the next time
            self._writing = threading.Thread(target=self._write, args=(document,), name="window memory", daemon=True)
            self._writing.start()

    def _document(self) -> dict[str, Any]:
        return {
            "schema": SCHEMA,
            "size": None if self.size is None else list(self.size),
            "is_maximized": self.is_maximized,
            "ui_scale": self.ui_scale,
            "layout": self.layout,
            "mark_size": self.mark_size,
            "mark_opacity": self.mark_opacity,
            "navigation": self.navigation,
            "is_motion_reduced": self.is_motion_reduced,
            "time_unit": self.time_unit,
            "folded_lanes": list(self.folded_lanes),
            "views": [{"project": folder, **view} for folder, view in self.views.items()],
        }

    def _write(self, document: dict[str, Any]) -> None:
        try:
            write_checked_json(self.path, document)
        except (OSError, EngineError) as error:
            level = logging.DEBUG if self.failure else logging.WARNING  # once is enough
            logger.log(level, "the window layout could not be saved (%s) - %s", error, self.path)
            self.failure = getattr(error, "strerror", None) or str(error)
        self._saved = document


def read_window_memory(path: Path | None = None) -> WindowMemory:
    """The memory in a file; the platform's place when None."""
    path = config_dir() / "window.json" if path is None else path
    memory = WindowMemory(path)
    try:
        found = read_checked_json(path)
    except FileNotFoundError:
        return memory
    except (OSError, ValueError, EngineError) as error:
        logger.warning("the window layout is lost, its file is damaged (%s) - %s", error, path)
        return memory
    size = found.get("size")
    if isinstance(size, list) and len(size) == 2 and all(_number(side, 1, MAX_SIDE_PX) is not None for side in size):
        memory.size = (int(size[0]), int(size[1]))
    memory.is_maximized = found.get("is_maximized") is True
    memory.ui_scale = _number(found.get("ui_scale"), 0.5, 4.0)
    layout = found.get("layout")
    memory.layout = layout if isinstance(layout, str) and len(layout) <= MAX_LAYOUT_CHARACTERS else ""
    memory.mark_size = _number(found.get("mark_size"), 0.1, 10.0)
    memory.mark_opacity = _number(found.get("mark_opacity"), 0.0, 1.0)
    navigation = found.get("navigation")
    memory.navigation = navigation if isinstance(navigation, str) else memory.navigation
    memory.is_motion_reduced = found.get("is_motion_reduced") is True
    memory.time_unit = _word(found.get("time_unit"))
    folded = found.get("folded_lanes")
    memory.folded_lanes = tuple(filter(None, map(_word, folded[:MAX_LANES]))) if isinstance(folded, list) else ()
    views = found.get("views")
    for view in views if isinstance(views, list) else []:
        if isinstance(view, dict) and isinstance(view.get("project"), str):
            memory.keep_view(view["project"], {name: value for name, value in view.items() if name != "project"})
    return memory


def view_of(session: SessionView) -> dict[str, Any]:
    """Frame, views and overlays of the open capture, as plain values. Those of the active view are separate entries."""
    looks = session.views.shown
    return {
        "frame_index": session.timeline.frame_index,
        **_playing_of(session.timeline),
        **_look_of(session.view, session.overlays),
        "bookmarks": session.bookmarks.values(),
        "looks": [_look_of(look.view, look.overlays) for look in looks] if len(looks) > 1 else [],
        "active_view": session.views.active_index,
    }


def _look_of(view: OrbitView, overlays: Overlays) -> dict[str, Any]:
    return {
        **ViewPlace.of(view).values(),
        "shown": [name for name in OVERLAY_NAMES if getattr(overlays, name)],
        "hidden": [name for name in OVERLAY_NAMES if not getattr(overlays, name)],
        "compare": overlays.compare,
        "wipe_position": float(overlays.wipe_position),
    }


def show_again(session: SessionView, kept: dict[str, Any]) -> None:
    """Restore the values of `view_of`. Anything that is not valid for this capture stays as it is."""
    timeline = session.timeline
    frame_index = _number(kept.get("frame_index"), 0, timeline.last_frame)
    if frame_index is not None:
        timeline.seek(int(frame_index))
    _play_again(timeline, kept)
    _look_again(session.view, session.overlays, kept)
    session.bookmarks.items = read_bookmarks(kept.get("bookmarks")).items
    looks = kept.get("looks")
    if isinstance(looks, list) and all(isinstance(look, dict) for look in looks) and max(len(looks), 1) in COUNTS:
        session.views.show(max(len(looks), 1))
        for look, values in zip(session.views.shown, looks, strict=False):
            _look_again(look.view, look.overlays, values)
        active_index = _number(kept.get("active_view"), 0, len(looks))
        session.views.activate(0 if active_index is None else int(active_index))


def _look_again(view: OrbitView, overlays: Overlays, kept: dict[str, Any]) -> None:
    place = ViewPlace.read(kept)
    if place is not None:
        place.show(view)
    for key, is_shown in (("shown", True), ("hidden", False)):
        found = kept.get(key)
        names = found if isinstance(found, list) else []
        for name in OVERLAY_NAMES:
            if name in names:  # entries missing in an older file stay as they are
                setattr(overlays, name, is_shown)
    if kept.get("compare") in COMPARE_MODES:
        overlays.compare = kept["compare"]
    wipe_position = _number(kept.get("wipe_position"), 0.0, 1.0)
    if wipe_position is not None:
        overlays.wipe_position = wipe_position


def _playing_of(timeline: Timeline) -> dict[str, Any]:
    """How the capture is played."""
    return {
        "is_looping": timeline.is_looping,
        "speed": timeline.speed,
        "in_frame": timeline.in_frame,
        "out_frame": timeline.out_frame,
    }


def _play_again(timeline: Timeline, kept: dict[str, Any]) -> None:
    if isinstance(kept.get("is_looping"), bool):
        timeline.is_looping = kept["is_looping"]
    if kept.get("speed") in SPEEDS:
        timeline.speed = float(kept["speed"])
    ends = [_number(kept.get(name), 0, timeline.last_frame) for name in ("in_frame", "out_frame")]
    timeline.set_range(*(None if end is None else int(end) for end in ends))


def markers_of(kept: dict[str, Any], timeline: Timeline) -> list[tuple[int, str]]:
    """Frames and names of markers that an earlier version has kept here; now they are part of the project."""
    markers, found = kept.get("markers"), []
    for marker in markers if isinstance(markers, list) else []:
        if isinstance(marker, list) and len(marker) == 2 and isinstance(marker[1], str):
            frame_index = _number(marker[0], 0, timeline.last_frame)
            if frame_index is not None:
                found.append((int(frame_index), marker[1][:MAX_TEXT_CHARACTERS]))
    return found


def _word(value: Any) -> str:
    """A short text, else an empty one."""
    return value if isinstance(value, str) and len(value) <= MAX_WORD_CHARACTERS else ""


def _number(value: Any, low: float, high: float) -> float | None:
    """A finite number in a range, else None."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return value if is_number and math.isfinite(value) and low <= value <= high else None
