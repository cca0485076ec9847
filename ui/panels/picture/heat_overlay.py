"""A residual heat map over the picture of a capture camera: colours, colour bar, the value under the pointer, and why
there is none where there is none.
"""

from __future__ import annotations

from collections.abc import Callable

import moderngl
from imgui_bundle import ImVec2, imgui

from app.playback.modes.color_maps import SIGNED
from app.residuals.anchor_heat import AnchorHeat
from app.residuals.heat_map import HEAT_KINDS, HeatKind, HeatMap
from app.session.session_view import SessionView
from ui.panels.picture.color_bar import COLOR_BAR_SIZE, bar_number, draw_color_bar
from ui.panels.picture.hud import BELOW_NAME, wrapped
from ui.panels.pieces.widgets import chip
from ui.panels.state import Rect, UiState
from ui.style import theme
from ui.viewport.heat_image import HeatImage, value_at
from ui.viewport.layers.anchor_heat_layer import ANCHOR_RANGES, anchor_column

COLOR_MAP_OF = {"sequential": "inferno", "signed": SIGNED}
"""Black reads as fine on a dark window, white as no difference."""
MARGIN = 12.0
LEAST_BESIDE = 300.0
"""Plates of the HUD need at least this width."""
BUSY_REDRAW_S = 0.1
LINE = 25.0


class HeatOverlay:
    """Owns the texture of one view's heat map. GL thread only.

    Attributes:
        shown: The map drawn last; None without a heat map.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._image = HeatImage(ctx)
        self._said: Rect | None = None
        self._draw_words: Callable[[], None] | None = None
        self.shown: HeatMap | None = None

    def release(self) -> None:
        """Free the texture."""
        self._image.release()

    def beside(self, area: Rect) -> Rect:
        """The rest of an area: left of the colour bar, or above its words where that is too narrow; all of it
        where there is no heat map."""
        if self._said is None:
            return area
        if self._said.x0 - area.x0 < LEAST_BESIDE:
            return Rect(area.x0, area.y0, area.x1, self._said.y0)
        return Rect(area.x0, area.y0, self._said.x0, area.y1)

    def draw(self, session: SessionView, ui: UiState, pane: Rect) -> None:
        """Draw over a picture that fills the pane; nothing where no heat map is chosen or no camera is looked through.

        Asks for what is missing. Words and colour bar are drawn by `draw_words`.
        """
        self.shown = self._said = self._draw_words = None
        overlays = session.overlays
        if not overlays.heat:
            return
        if session.view.look_through is None:
            self._draw_anchors(session, ui, pane)
            return
        kind, draw = HEAT_KINDS[overlays.heat], imgui.get_window_draw_list()
        map_name, (low, high) = COLOR_MAP_OF[kind.color_map], kind.value_range
        heat = session.heat(overlays.heat)
        if heat is None or heat.is_stale:
            ui.redraw_within(BUSY_REDRAW_S)
        pointed = None
        if heat is not None and heat.values is not None:
            self._image.set(heat.values, map_name, low, high, key=heat.key)
            tint = theme.u32((1.0, 1.0, 1.0, overlays.heat_opacity))
            texture = imgui.ImTextureRef(self._image.texture.glo)
            draw.add_image(texture, pane.low, pane.high, ImVec2(0, 0), ImVec2(1, 1), tint)
            self.shown = heat
            pointer = imgui.get_io().mouse_pos
            if imgui.is_item_hovered():
                across, down = (pointer.x - pane.x0) / pane.width, (pointer.y - pane.y0) / pane.height
                pointed = value_at(heat.values, across, down)
        self._draw_bar(ui, pane, kind, kind.value_range, heat_words(kind, heat), pointed)

    def draw_words(self) -> None:
        """Name the drawn map, over everything else in the pane."""
        if self._draw_words is not None:
            self._draw_words()

    def _draw_anchors(self, session: SessionView, ui: UiState, pane: Rect) -> None:
        """Meaning of the anchors' points; the points themselves belong to the scene."""
        heat = session.anchor_heat(anchor_column(session.overlays.heat))
        if heat is None or heat.is_stale or heat.n_cameras < heat.n_cameras_all:
            ui.redraw_within(BUSY_REDRAW_S)
        column = anchor_column(session.overlays.heat)
        self._draw_bar(
            ui, pane, HEAT_KINDS[column], ANCHOR_RANGES[column], anchor_words(HEAT_KINDS[column], heat), None
        )

    def _draw_bar(
        self,
        ui: UiState,
        pane: Rect,
        kind: HeatKind,
        value_range: tuple[float, float],
        words: str,
        pointed: float | None,
    ) -> None:
        draw, map_name, (low, high) = imgui.get_window_draw_list(), COLOR_MAP_OF[kind.color_map], value_range
        width, height = COLOR_BAR_SIZE
        right, bottom = pane.x1 - MARGIN, pane.y1 - MARGIN
        lines = wrapped(words, pane.width - 2 * MARGIN - 18, lambda line: imgui.calc_text_size(line).x)
        words_height = 4 + len(lines) * LINE
        has_bar = pane.width >= width + 2 * MARGIN and pane.height >= BELOW_NAME + words_height + height + MARGIN
        bar = Rect(right - width, bottom - (height if has_bar else 0.0), right, bottom)
        self._said = Rect(bar.x0, bar.y0 - words_height, bar.x1, bottom)
        if has_bar:
            ui.mark_rect("viewport.heat_bar", bar)

        def draw_words() -> None:
            if has_bar:
                draw_color_bar(draw, bar, map_name, low, high, unit_of(kind), pointed)
            for row, line in enumerate(reversed(lines)):
                chip(draw, bar.x1, bar.y0 - 28 - row * LINE, line, is_right=True)

        self._draw_words = draw_words


def heat_words(kind: HeatKind, heat: HeatMap | None) -> str:
    """Kind, frame and mean of the map, or why there is none."""
    if heat is None:
        return f"{kind.label}: being measured"
    if heat.note and heat.values is None:
        return f"{kind.label}: {heat.note}"
    words = f"{kind.label}, frame {heat.frame_index}"
    if heat.is_stale:
        return f"{words}; the playhead's is being measured"
    mean = "" if heat.mean is None else f", mean {bar_number(heat.mean, *kind.value_range)} {unit_of(kind)}".rstrip()
    return f"{words}{mean}{f' ({heat.note})' if heat.note else ''}"


def anchor_words(kind: HeatKind, heat: AnchorHeat | None) -> str:
    """Quantity of the points, of which frame, and from how many cameras; or why there are none."""
    label = f"{kind.label}, of anchors"
    if heat is None:
        return f"{label}: being measured"
    if heat.note:
        return f"{label}: {heat.note}"
    words = f"{label}, frame {heat.frame_index}, {heat.n_cameras} of {heat.n_cameras_all} cameras"
    return f"{words}; the playhead's is being measured" if heat.is_stale else words


def unit_of(kind: HeatKind) -> str:
    """The unit as written after numbers; nothing where there is none."""
    return "" if kind.unit == "1" else f"x {kind.unit}"
