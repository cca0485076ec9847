"""Shared by the panels for the length of a window: fonts, widget rectangles, open popups. Not the program's state.

Everything the program knows lives in the Session; nothing here survives the window.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.session.commands import Command
from app.session.projects.preferences import Preferences
from ui.gl.image import PixelRect as PixelRect
from ui.panels.actions.key_map import KeyMap
from ui.panels.picture.gestures import Navigation
from ui.panels.timeline.view_state import TimelineView
from ui.panels.training.curve_view import CurveView
from ui.panels.ui_requests import UiRequests
from ui.style.fonts import Fonts
from ui.style.ui_scale import UiScale
from ui.viewport.editing.copy_tool import CopyTool
from ui.viewport.editing.edit_tool import EditTool
from ui.viewport.editing.object_tool import ObjectTool
from ui.viewport.editing.select_tool import SelectTool
from ui.viewport.excluding.mask_tool import MaskTool
from ui.viewport.path_tool import PathTool
from ui.viewport.region_tool import RegionTool

VIEWPORT, CAPTURE, TRAINING, EDIT, TIMELINE = "Viewport", "Capture", "Training", "Edit", "Timeline"
RESIDUALS, LOG, DOCTOR = "Residuals", "Log", "Capture doctor"
PATHS, EXPORTS, HISTORY = "Camera path", "Exports", "History"
PANELS = (CAPTURE, TRAINING, EDIT, RESIDUALS, PATHS, HISTORY, TIMELINE, LOG, DOCTOR, EXPORTS)
"""Titles of the panels around the picture."""
DRAWER = (LOG, DOCTOR, EXPORTS, HISTORY)
"""Titles of panels that share a drawer between picture and timeline, and are there once they are asked for."""
EDIT_SECTIONS = {
    "objects": "Objects",
    "selection": "Selection",
    "options": "Selection options",
    "edits": "Edits",
    "copies": "Copies of objects",
    "timing": "Timing",
    "attribute": "Select by attribute",
    "volume": "Box or sphere by numbers",
    "regions": "Marks for training",
    "world": "World: up and scale",
}
"""Titles of the parts of the panel Edit that can be asked for, by name."""
LAYOUT_WORDS = {"Standard": "the default", "Long capture": "with a tall timeline, for long captures"}
LAYOUTS = tuple(LAYOUT_WORDS)
"""Layouts of the panels that the program brings; the first is the one to begin with."""
Dispatch = Callable[[Command], None]
"""Takes one command of app.session.commands."""


@dataclass(frozen=True)
class Rect(PixelRect):
    """A rectangle in window coordinates: logical pixels, origin top left, y down."""

    @property
    def center(self) -> tuple[float, float]:
        """Middle point."""
        return (self.x0 + self.x1) / 2, (self.y0 + self.y1) / 2

    @property
    def low(self) -> ImVec2:
        """Top left corner for ImGui calls."""
        return ImVec2(self.x0, self.y0)

    @property
    def high(self) -> ImVec2:
        """Bottom right corner for ImGui calls."""
        return ImVec2(self.x1, self.y1)

    def contains(self, x: float, y: float) -> bool:
        """Is the point inside (low edges included)?"""
        return self.x0 <= x < self.x1 and self.y0 <= y < self.y1


@dataclass
class UiState:
    """Widget state shared by the panels of one window.

    Attributes:
        fonts: Loaded faces.
        scale: How large everything is drawn.
        preferences: Of the user; changed in place.
        keys: Which keys run which action.
        wishes: Requests to the shell.
        is_picture_only: Are the panels around the picture hidden?
        keyed_panel: Title of the panel that arrow keys, Enter and Space belong to, or None.
        rects: Where named items were drawn in the newest frame; tests and screenshots aim with these.
        regions: The region that is being chosen, and the one that stands out.
        selecting: The tool that selects, and its options.
        editing: Which edit is chosen, and what is being done to it.
        objects: Which object is chosen, and which are outlined.
        copies: Which copy of an object is chosen, and what new ones are to be like.
        masks: The brush that paints what training does not see.
        paths: Editing of the camera path's keys.
        navigation: Functions of mouse and keys over a picture.
        curves: Contents of the training panel's plots.
        cluster_address: As typed to join a cluster.
        log_clip: The clip whose log is shown; None for the one at the playhead, or the one that trains.
        queue_chosen: The waiting clip that keys move; None without one.
        timeline: The part of time that is shown.
        is_popup_open: Is a menu or another popup open, so that keys belong to it?
        is_menu_wanted: Open the first menu, for the keyboard.
        is_quality_open: Is the plot of quality over the clips folded out?
        is_quality_seen: Was it scrolled to since then?
        pointed_anchor: Place of the anchor under the pointer, scene units; None without one. [3]
        is_view_popup_wanted: Open the popup of lens, axes and bookmarks.
        last_heat: The heat map that was shown last, to be shown again; empty before the first.
        wanted_panel: Title of a panel that is to come to the front, or None.
        open_drawer: Titles of the panels of the drawer that are open.
        redraw_in_s: Shortest wait after which some panel wants to be drawn again, or None.
    """

    fonts: Fonts = field(default_factory=Fonts)
    scale: UiScale = field(default_factory=UiScale)
    preferences: Preferences = field(default_factory=Preferences)
    keys: KeyMap = field(default_factory=KeyMap)
    wishes: UiRequests = field(default_factory=UiRequests)
    rects: dict[str, Rect] = field(default_factory=dict)
    regions: RegionTool = field(default_factory=RegionTool)
    selecting: SelectTool = field(default_factory=SelectTool)
    editing: EditTool = field(default_factory=EditTool)
    objects: ObjectTool = field(default_factory=ObjectTool)
    copies: CopyTool = field(default_factory=CopyTool)
    masks: MaskTool = field(default_factory=MaskTool)
    paths: PathTool = field(default_factory=PathTool)
    navigation: Navigation = field(default_factory=Navigation)
    pointed_anchor: np.ndarray | None = None
    is_view_popup_wanted: bool = False
    curves: CurveView = field(default_factory=CurveView)
    cluster_address: str = ""
    log_clip: int | None = None
    queue_chosen: int | None = None
    timeline: TimelineView = field(default_factory=TimelineView)
    last_heat: str = ""
    wanted_panel: str | None = None
    open_drawer: set[str] = field(default_factory=set)
    is_quality_open: bool = False
    is_quality_seen: bool = False
    is_picture_only: bool = False
    keyed_panel: str | None = None
    is_help_open: bool = False
    is_popup_open: bool = False
    is_menu_wanted: bool = False
    is_open_requested: bool = False
    is_layout_reset_requested: bool = False
    redraw_in_s: float | None = None
    quit_requested: bool = False

    def mark(self, name: str) -> None:
        """Remember the rectangle of the ImGui item drawn last."""
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        self.rects[name] = Rect(low.x, low.y, high.x, high.y)

    def mark_rect(self, name: str, rect: Rect) -> None:
        """Remember a rectangle that is not an ImGui item."""
        self.rects[name] = rect

    def show_edit(self, section: str = "") -> None:
        """Bring the panel Edit to the front, at one of EDIT_SECTIONS; where it stands without one."""
        self.wanted_panel, self.editing.wanted_section = EDIT, section

    def redraw_within(self, seconds: float) -> None:
        """Ask for another frame no later than this many seconds from now."""
        self.redraw_in_s = seconds if self.redraw_in_s is None else min(self.redraw_in_s, seconds)
