"""Colours, symbols and spacing of the whole window. Draws nothing by itself.

The colours themselves are those of a palette (ui.style.palette), which can be changed while the window is open.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from imgui_bundle import ImVec2, ImVec4, imgui, implot

from ui.style.colors import Color
from ui.style.colors import rgb as rgb  # looked up as theme.rgb by the panels
from ui.style.palette import DARK, PALETTES, ThemeColors, contrast


def faded(color: Color, alpha: float) -> Color:
    """The same hue at another opacity."""
    return (color[0], color[1], color[2], alpha)


@lru_cache(maxsize=4096)
def u32(color: Color) -> int:
    """The packed form that draw lists take."""
    return imgui.color_convert_float4_to_u32(ImVec4(*color))


ON_PICTURE = DARK
"""Words and drawings over a picture take their colours from here: pictures lie on dark grey in every theme."""

# The colours in use. `use` gives them others, so they are looked up where something is drawn, as theme.SKY, and are
# never kept: not in a module, not as the default of an argument.
VOID: Color = DARK.void
BACKDROP: Color = DARK.backdrop
PANEL: Color = DARK.panel
POPUP: Color = DARK.popup
RAISED: Color = DARK.raised
RAISED_HOVER: Color = DARK.raised_hover
RAISED_ACTIVE: Color = DARK.raised_active
OUTLINE: Color = DARK.outline
TEXT: Color = DARK.text
TEXT_DIM: Color = DARK.text_dim
TEXT_ON_ACCENT: Color = DARK.text_on_accent
SKY: Color = DARK.sky
SKY_LIGHT: Color = DARK.sky_light
SKY_DARK: Color = DARK.sky_dark
ORANGE: Color = DARK.orange
GREEN: Color = DARK.green
YELLOW: Color = DARK.yellow
VERMILLION: Color = DARK.vermillion
PURPLE: Color = DARK.purple
PLAYHEAD: Color = DARK.playhead
TEXT_ON_PLAYHEAD: Color = DARK.text_on_playhead
GRID: Color = DARK.grid
STRIPE: Color = DARK.stripe
SHADE: Color = DARK.shade
INHERITED: Color = DARK.inherited
RESIDUAL: Color = DARK.residual
HELD_OUT: Color = DARK.held_out
ROLE_COLORS: Mapping[str, Color] = DARK.role_colors
REGION_COLORS: Mapping[str, Color] = DARK.region_colors
CLIP_COLORS: Mapping[str, Color] = DARK.clip_colors
SWITCHED = tuple(name for name in dict(globals()) if name.isupper() and hasattr(DARK, name.lower()))
"""Names of the colours that `use` changes."""


def use(palette: ThemeColors) -> None:
    """Draw everything in these colours from now on. Needs the contexts of ImGui and ImPlot."""
    take(palette)
    apply_style()


def take(palette: ThemeColors) -> None:
    """Make these the colours in use, without telling ImGui."""
    globals().update({name: getattr(palette, name.lower()) for name in SWITCHED})


def named(name: str) -> ThemeColors:
    """The palette of this name; the dark one where there is none."""
    return PALETTES.get(name, DARK)


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
    MEND = "\uf0ad"
    MORE = "\uf141"
    MOVE = "\uf0b2"


TOOL_ICONS: dict[str, str] = {
    "rectangle": "\uf5cb",
    "lasso": "\uf5b7",
    "brush": "\uf1fc",
    "box": "\uf1b2",
    "sphere": "\uf111",
    "prism": "\uf61f",
    "flood": "\uf575",
}
"""Glyphs of the tools that select."""
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


def apply_style() -> None:
    """Set spacing and colours of ImGui and ImPlot; again after other colours were taken."""
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
    style.tab_min_width_shrink = 40  # all tabs of the side panels are seen, rather than arrows
    style.docking_separator_size = 3
    style.selectable_text_align = ImVec2(0.0, 0.5)
    style.window_menu_button_position = imgui.Dir.none
    col = imgui.Col_
    is_light = contrast(TEXT, (0.0, 0.0, 0.0, 1.0)) < contrast(TEXT, (1.0, 1.0, 1.0, 1.0))
    (imgui.style_colors_light if is_light else imgui.style_colors_dark)()  # for colours not in the table
    (implot.style_colors_light if is_light else implot.style_colors_dark)()
    table: dict[int, Color] = {
        col.text: TEXT,
        col.text_disabled: TEXT_DIM,
        col.window_bg: PANEL,
        col.child_bg: faded(PANEL, 0.0),
        col.popup_bg: POPUP,
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
        col.table_row_bg_alt: STRIPE,
        col.text_selected_bg: faded(SKY, 0.35),
        col.drag_drop_target: SKY,
        col.nav_cursor: SKY,
        col.input_text_cursor: TEXT,
        col.text_link: SKY,
        col.modal_window_dim_bg: SHADE,
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
        col.axis_grid: GRID,
    }.items():
        style.set_color_(int(index), ImVec4(*color))


def status_color(status: str) -> Color:
    """Colour of a clip state word; unknown words read as untrained."""
    return CLIP_COLORS.get(status, CLIP_COLORS["untrained"])
