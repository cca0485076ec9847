"""Colours, fonts and spacing of the whole window. Draws nothing by itself.

Hues that carry meaning are those of ui.style.colors.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import imgui_bundle
from imgui_bundle import ImVec2, ImVec4, imgui, implot

from app.playback.arrays import BACKGROUND
from ui.style.colors import GREEN, ORANGE, SKY, VERMILLION, YELLOW, Color, rgb
from ui.style.colors import HELD_OUT as HELD_OUT  # looked up as theme.HELD_OUT by the panels, as all colours are
from ui.style.colors import INHERITED as INHERITED
from ui.style.colors import REGION_COLORS as REGION_COLORS
from ui.style.colors import RESIDUAL as RESIDUAL
from ui.style.colors import ROLE_COLORS as ROLE_COLORS

logger = logging.getLogger(__name__)


def faded(color: Color, alpha: float) -> Color:
    """The same hue at another opacity."""
    return (color[0], color[1], color[2], alpha)


@lru_cache(maxsize=4096)
def u32(color: Color) -> int:
    """The packed form that draw lists take."""
    return imgui.color_convert_float4_to_u32(ImVec4(*color))


SKY_LIGHT = rgb(120, 198, 242)
SKY_DARK = rgb(60, 158, 214)

# Surfaces, dark to light
VOID: Color = (*BACKGROUND, 1.0)
BACKDROP = rgb(24, 27, 32)
PANEL = rgb(32, 36, 43)
RAISED = rgb(44, 49, 58)
RAISED_HOVER = rgb(56, 63, 75)
RAISED_ACTIVE = rgb(68, 77, 92)
OUTLINE = rgb(58, 65, 77)
TEXT = rgb(226, 230, 236)
TEXT_DIM = rgb(150, 159, 173)
TEXT_ON_ACCENT = rgb(10, 20, 30)

PLAYHEAD = rgb(255, 255, 255)

CLIP_COLORS: dict[str, Color] = {
    "untrained": rgb(96, 104, 118),
    "queued": rgb(126, 134, 148),
    "preparing": SKY,
    "training": SKY,
    "paused": YELLOW,
    "stopped": YELLOW,
    "trained": GREEN,
    "failed": VERMILLION,
    "stale": ORANGE,
    "damaged": VERMILLION,
}


class Icon:
    """Glyphs of the Font Awesome font that is merged into the text font."""

    PLAY = "\uf04b"
    PAUSE = "\uf04c"
    STOP = "\uf04d"
    FIRST = "\uf049"
    LAST = "\uf050"
    STEP_BACK = "\uf048"
    STEP_FORWARD = "\uf051"
    LOOP = "\uf01e"
    FOLLOW = "\uf140"
    FOLDER = "\uf07c"
    CAMERA = "\uf03d"
    CHECK = "\uf00c"
    WARNING = "\uf071"
    ERROR = "\uf06a"
    INFO = "\uf05a"
    CLOCK = "\uf017"
    GEAR = "\uf013"
    COPY = "\uf0c5"
    CLOSE = "\uf00d"
    TRAIN = "\uf0e7"
    HOME = "\uf015"
    LAYERS = "\uf5fd"
    COLUMNS = "\uf0db"
    EYE = "\uf06e"
    SQUARE = "\uf0c8"
    HELP = "\uf059"
    FILM = "\uf008"
    DROP = "\uf019"
    REGION = "\uf05b"
    TRASH = "\uf1f8"
    UNDO = "\uf2ea"
    ADD = "\u002b"
    CLOCK_BACK = "\uf1da"
    BROKEN = "\uf127"
    COMPASS = "\uf14e"
    UP = "\uf062"
    DOWN = "\uf063"
    LOG = "\uf15c"


CLIP_ICONS: dict[str, str] = {
    "untrained": "",
    "queued": Icon.CLOCK,
    "preparing": Icon.GEAR,
    "training": Icon.TRAIN,
    "paused": Icon.PAUSE,
    "stopped": Icon.STOP,
    "trained": Icon.CHECK,
    "failed": Icon.WARNING,
    "stale": Icon.CLOCK_BACK,
    "damaged": Icon.BROKEN,
}


@dataclass(frozen=True)
class Fonts:
    """The loaded faces and the sizes used with them, in points of the logical window."""

    bold: imgui.ImFont | None = None
    body_size: float = 15.0
    small_size: float = 13.0
    title_size: float = 26.0


def load_fonts() -> Fonts:
    """Load text and icon faces from the installed imgui-bundle; the built-in face serves when they are missing."""
    folder = Path(imgui_bundle.__file__).parent / "assets" / "fonts"
    faces = [folder / "Roboto" / "Roboto-Regular.ttf", folder / "Roboto" / "Roboto-Bold.ttf"]
    icons = folder / "Font_Awesome_6_Free-Solid-900.otf"
    if not all(path.is_file() for path in (*faces, icons)):
        logger.info("Text fonts were not found beside imgui-bundle; using its built-in face - %s", folder)
        return Fonts()
    atlas = imgui.get_io().fonts
    loaded = []
    for face in faces:  # the first one loaded is the default of the context
        font = atlas.add_font_from_file_ttf(str(face), Fonts.body_size)
        merge = imgui.ImFontConfig()
        merge.merge_mode = True
        merge.glyph_min_advance_x = Fonts.body_size
        merge.glyph_offset = ImVec2(0.0, 1.0)
        atlas.add_font_from_file_ttf(str(icons), Fonts.body_size - 2.0, merge)
        loaded.append(font)
    return Fonts(bold=loaded[1])


def apply_style() -> None:
    """Set spacing and colours of ImGui and ImPlot. Call once per context."""
    style = imgui.get_style()
    style.window_padding = ImVec2(12, 10)
    style.frame_padding = ImVec2(10, 5)
    style.item_spacing = ImVec2(8, 7)
    style.item_inner_spacing = ImVec2(6, 4)
    style.window_rounding = 6
    style.child_rounding = 4
    style.frame_rounding = 4
    style.popup_rounding = 6
    style.grab_rounding = 4
    style.tab_rounding = 4
    style.scrollbar_size = 11
    style.scrollbar_rounding = 6
    style.window_border_size = 0
    style.child_border_size = 0
    style.popup_border_size = 1
    style.tab_bar_border_size = 0
    style.docking_separator_size = 3
    style.selectable_text_align = ImVec2(0.0, 0.5)
    style.window_menu_button_position = imgui.Dir.none
    col = imgui.Col_
    table: dict[int, Color] = {
        col.text: TEXT,
        col.text_disabled: TEXT_DIM,
        col.window_bg: PANEL,
        col.child_bg: faded(PANEL, 0.0),
        col.popup_bg: rgb(38, 43, 51),
        col.border: OUTLINE,
        col.frame_bg: BACKDROP,
        col.frame_bg_hovered: RAISED,
        col.frame_bg_active: RAISED_HOVER,
        col.title_bg: BACKDROP,
        col.title_bg_active: BACKDROP,
        col.title_bg_collapsed: BACKDROP,
        col.menu_bar_bg: BACKDROP,
        col.scrollbar_bg: faded(PANEL, 0.0),
        col.scrollbar_grab: RAISED_HOVER,
        col.scrollbar_grab_hovered: RAISED_ACTIVE,
        col.scrollbar_grab_active: SKY,
        col.check_mark: SKY,
        col.slider_grab: SKY,
        col.slider_grab_active: SKY,
        col.button: RAISED,
        col.button_hovered: RAISED_HOVER,
        col.button_active: RAISED_ACTIVE,
        col.header: RAISED,
        col.header_hovered: RAISED_HOVER,
        col.header_active: RAISED_ACTIVE,
        col.separator: OUTLINE,
        col.separator_hovered: SKY,
        col.separator_active: SKY,
        col.resize_grip: faded(OUTLINE, 0.3),
        col.resize_grip_hovered: SKY,
        col.resize_grip_active: SKY,
        col.tab: BACKDROP,
        col.tab_hovered: RAISED_HOVER,
        col.tab_selected: PANEL,
        col.tab_selected_overline: SKY,
        col.tab_dimmed: BACKDROP,
        col.tab_dimmed_selected: PANEL,
        col.tab_dimmed_selected_overline: faded(SKY, 0.0),
        col.docking_preview: faded(SKY, 0.4),
        col.docking_empty_bg: VOID,
        col.plot_histogram: SKY,
        col.table_header_bg: BACKDROP,
        col.table_border_strong: OUTLINE,
        col.table_border_light: faded(OUTLINE, 0.5),
        col.table_row_bg_alt: rgb(255, 255, 255, 0.02),
        col.text_selected_bg: faded(SKY, 0.35),
        col.drag_drop_target: SKY,
        col.modal_window_dim_bg: rgb(0, 0, 0, 0.45),
    }
    for index, color in table.items():
        style.set_color_(int(index), ImVec4(*color))
    _apply_plot_style()


def _apply_plot_style() -> None:
    style = implot.get_style()
    style.plot_padding = ImVec2(6, 6)
    style.label_padding = ImVec2(3, 3)
    style.plot_border_size = 0
    style.minor_alpha = 0.0
    col = implot.Col_
    for index, color in {
        col.frame_bg: faded(PANEL, 0.0),
        col.plot_bg: BACKDROP,
        col.axis_text: TEXT_DIM,
        col.axis_grid: rgb(255, 255, 255, 0.10),
    }.items():
        style.set_color_(int(index), ImVec4(*color))


def status_color(status: str) -> Color:
    """Colour of a clip state word; unknown words read as untrained."""
    return CLIP_COLORS.get(status, CLIP_COLORS["untrained"])
