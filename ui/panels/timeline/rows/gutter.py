"""The names of the rows at the left: the ruler's changes its unit, a lane's folds it away."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.session.session_view import SessionView
from ui.panels.state import Rect, UiState
from ui.panels.timeline.rows.rows import (
    CACHE,
    CAMERA,
    CLIPS,
    LANES,
    MARKERS,
    OBJECTS,
    OVERVIEW,
    QUALITY,
    RULER,
    SEAMS,
    TAKE,
    VOLUMES,
)
from ui.panels.timeline.rows.stage import SMALL_TEXT, small_text, small_width
from ui.panels.timeline.units import unit_note
from ui.style import theme
from ui.style.theme import Icon

WIDTH = 84.0
LANES_BUTTON = 22.0
POPUP = "lanes"
NOTES = {
    SEAMS: "Change at the seam relative to inside the clips: 1 means no seam, above 2 is worth a look,"
    " ~ that not all cameras are measured yet",
    QUALITY: "Held-out PSNR of each clip, and of each frame where it was measured; 20 to 40 dB",
    CACHE: "Frames decoded in memory, shown at once",
    CAMERA: "Keys of the camera path: C at the playhead",
    OBJECTS: "Objects: in their colours where they are seen, hatched where that is doubtful",
    VOLUMES: "Keys of the volume that the chosen edit acts on: Ctrl+Shift+K at the playhead",
    TAKE: "Segments of the take over the frames that they play, numbered in the order in which they play",
    MARKERS: "Markers: Ctrl+M at the playhead",
}


def draw_gutter(rows: dict[str, Rect], x: float, session: SessionView, ui: UiState) -> None:
    """One name per row.

    Args:
        rows: Where the rows lie, by name.
        x: The left end of the names.
    """
    draw = imgui.get_window_draw_list()
    for name, row in rows.items():
        cell = Rect(x, row.y0, x + WIDTH - 6, row.y1)
        if name == RULER:
            _draw_unit(cell, session, ui)
            continue
        text = f"{name}, dB" if name == QUALITY else name
        y = max((row.y0 + row.y1 - SMALL_TEXT) / 2 - 1, row.y0 - 1)
        color = theme.TEXT_DIM
        if name in LANES:
            imgui.set_cursor_screen_pos(cell.low)
            if imgui.invisible_button(f"fold {name}", ImVec2(cell.width, max(cell.height, 1.0))):
                ui.timeline.toggle_lane(name)
            ui.mark(f"timeline.fold {name}")
            color = theme.TEXT if imgui.is_item_hovered() else theme.TEXT_DIM
            imgui.set_item_tooltip(f"{NOTES[name]}\nClick to fold; {Icon.LAYERS} brings it back")
        if name in (CLIPS, OVERVIEW) or name in LANES:
            small_text(draw, x + 2, y, text, color)


def _draw_unit(cell: Rect, session: SessionView, ui: UiState) -> None:
    """The unit of the ruler, and the button of the lanes next to it."""
    draw, view = imgui.get_window_draw_list(), ui.timeline
    imgui.set_cursor_screen_pos(cell.low)
    if imgui.invisible_button("unit", ImVec2(cell.width - LANES_BUTTON, cell.height)):
        view.next_unit()
    ui.mark("timeline.unit")
    color = theme.TEXT if imgui.is_item_hovered() else theme.TEXT_DIM
    imgui.set_item_tooltip(f"{unit_note(view.unit, session.timeline.fps)}\nClick for another unit (U)")
    small_text(draw, cell.x0 + 2, cell.y0 + 4, view.unit, color)
    imgui.set_cursor_screen_pos(ImVec2(cell.x1 - LANES_BUTTON, cell.y0))
    if imgui.invisible_button("lanes button", ImVec2(LANES_BUTTON, cell.height)):
        imgui.open_popup(POPUP)
    ui.mark("timeline.lanes")
    color = theme.TEXT if imgui.is_item_hovered() else theme.SKY if view.folded else theme.TEXT_DIM
    imgui.set_item_tooltip("Show or hide lanes")
    small_text(
        draw, cell.x1 - LANES_BUTTON + (LANES_BUTTON - small_width(Icon.LAYERS)) / 2, cell.y0 + 4, Icon.LAYERS, color
    )
    if imgui.begin_popup(POPUP):
        for name in LANES:
            if imgui.menu_item(name.capitalize(), "", name not in view.folded, True)[0]:
                view.toggle_lane(name)
            ui.mark(f"lanes.{name}")
        imgui.end_popup()
