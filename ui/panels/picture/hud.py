"""Text over the viewport's picture: its content, pending work, and a legend of the marks."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

from imgui_bundle import ImVec2, imgui

from app.playback.modes.color_maps import SIGNED
from app.playback.modes.view_modes import MODES, range_of
from app.playback.prefetch_order import Course
from app.session.session_view import SessionView
from engine.camera.rig import CameraRig
from engine.text import camera_text
from ui.panels.editing.panel.marks import draw_region_mark
from ui.panels.picture.color_bar import COLOR_BAR_SIZE, draw_color_bar
from ui.panels.picture.comparison import shown_compare
from ui.panels.pieces.widgets import elided
from ui.panels.state import Rect, UiState
from ui.panels.timeline.clip_words import state_words
from ui.style import theme
from ui.style.colors import Color
from ui.style.numbers import format_count
from ui.style.theme import ON_PICTURE, Icon
from ui.viewport.hud_text import PARTS, RENDERED, HudText, count_text, hud_text
from ui.viewport.picture_rate import PictureRate
from ui.viewport.region_tool import REGION_WORDS
from ui.viewport.scene import ViewportScene

BUSY_REDRAW_S = 0.25
"""The mark of something on its way turns this often."""
LINE_HEIGHT, GAP, MARGIN = 24.0, 8.0, 12.0
BUSY_WIDTH = 20.0
BELOW_NAME = 44.0
"""Height of a picture's name at its top."""
LEGEND_WIDTH = 760.0
"""In a picture at least this wide, units, the legend stands next to the choice in progress."""


def wrapped(text: str, width: float, measure: Callable[[str], float], *, between: str = " ") -> list[str]:
    """Text in lines that fit a width, broken between words; a word that is too long stands alone.

    Args:
        between: Separator between two words, or between parts that stay whole.
    """
    lines: list[str] = []
    for word in text.split(between):
        longer = f"{lines[-1]}{between}{word}" if lines else word
        if lines and measure(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


class Hud:
    """Plates at the lower left of the picture, the legend at its upper right."""

    def __init__(self) -> None:
        self._rate = PictureRate()
        self.text: HudText | None = None
        """Words of the newest frame."""
        self.legend_x0 = 0.0
        """Where the legend begins; right of it there is no room for other words."""

    def draw(
        self,
        session: SessionView,
        ui: UiState,
        area: Rect,
        scene: ViewportScene,
        *,
        value: float | None = None,
        legend_at: tuple[float, float],
    ) -> None:
        """Everything that stands over the picture.

        Args:
            value: Under the pointer, where colours stand for numbers.
            legend_at: Upper right corner of the legend.
        """
        self.text, free = self._text(session, scene), area
        if self.text is not None:
            free = self._draw_plates(self.text, ui, area)
            if self.text.pending or session.loading is not None or scene.shown.is_on_its_way:
                ui.redraw_within(BUSY_REDRAW_S)
        if scene.shows == RENDERED:
            self._draw_color_bars(session, ui, scene, free, value)
        self.legend_x0 = legend_at[0]
        is_tool_used = ui.regions.is_active or ui.selecting.is_active
        if not is_tool_used or area.width >= LEGEND_WIDTH:  # the choice in progress needs the room
            self._draw_legend(session, scene, free, *legend_at)

    def _text(self, session: SessionView, scene: ViewportScene) -> HudText | None:
        wanted, timeline, shown = session.wanted_frame(), session.timeline, scene.shown
        shown_frame = shown.source.frame_index
        if wanted is None:
            return None
        rate, now_s = None, time.perf_counter()
        if (
            session.loading is None and timeline.is_playing and shown_frame is not None
        ):  # a cloud stands still, whatever the playhead does
            self._rate.note(shown_frame, Course.of(timeline), now_s)
            rate = self._rate.rate(now_s, is_every_frame=timeline.plays_every_frame)
        else:
            self._rate.stop()
        state = session.clip_states[wanted.clip_index].state

        def camera_name(index: int | None) -> str:
            if index is None:
                return "orthographic view" if session.view.is_orthographic else "free view"
            return camera_text(session.rig.names[index]) + (" (held out)" if index in session.holdout else "")

        return hud_text(
            shown,
            wanted,
            fps=timeline.fps,
            state=state,
            state_words=state_words(state, session),
            camera_name=camera_name,
            rate=rate,
            loading=session.loading,
        )

    def _draw_plates(self, text: HudText, ui: UiState, area: Rect) -> Rect:
        """In rows from below, as many side by side as fit; the label comes first, lowest and leftmost. Plates
        without room below the names at the top are left out. Returns what is left of the area above them."""
        draw = imgui.get_window_draw_list()
        plates = [
            (text.label, ON_PICTURE.text, False),
            (text.rate, ON_PICTURE.text, False),
            (text.pending, ON_PICTURE.yellow, True),
            (f"{Icon.WARNING}  {text.failure}" if text.failure else "", ON_PICTURE.vermillion, False),
            (text.note, ON_PICTURE.text_dim if not text.pending else ON_PICTURE.text, False),
        ]
        widest = area.width - 2 * MARGIN - 18
        x, bottom = area.x0 + MARGIN, area.y1 - 10
        row_height = 0.0
        for words, color, is_busy in plates:
            if not words:
                continue
            extra = BUSY_WIDTH if is_busy else 0.0
            between = PARTS if words == text.label else " "
            lines = wrapped(words, widest - extra, lambda line: imgui.calc_text_size(line).x, between=between)
            width = max(imgui.calc_text_size(line).x for line in lines) + 18 + extra
            height = LINE_HEIGHT + (len(lines) - 1) * imgui.get_text_line_height()
            is_new_row = x > area.x0 + MARGIN and (x + width > area.x1 - MARGIN or len(lines) > 1)
            if bottom - height - (row_height + 4 if is_new_row else 0.0) < area.y0 + BELOW_NAME:
                continue
            if is_new_row:
                x, bottom, row_height = area.x0 + MARGIN, bottom - row_height - 4, 0.0
            plate = Rect(x, bottom - height, x + width, bottom)
            draw.add_rect_filled(plate.low, plate.high, theme.u32(theme.faded(theme.VOID, 0.82)), 4)
            if is_busy:
                _draw_busy(draw, ImVec2(plate.x0 + 15, plate.y0 + LINE_HEIGHT / 2), color)
                ui.mark_rect("viewport.busy", plate)
            for row, line in enumerate(lines):
                at = ImVec2(plate.x0 + 9 + extra, plate.y0 + 4 + row * imgui.get_text_line_height())
                draw.add_text(at, theme.u32(color), line)
            x, row_height = plate.x1 + GAP, max(row_height, height)
        free = Rect(area.x0, area.y0, area.x1, bottom - row_height)
        ui.mark_rect("viewport.free", free)
        return free

    def _draw_color_bars(
        self, session: SessionView, ui: UiState, scene: ViewportScene, free: Rect, value: float | None
    ) -> None:
        """Meaning of the colours of the picture on screen, at its lower right above the plates, and at its lower left
        those of the picture that it is compared with."""
        width, height = COLOR_BAR_SIZE
        shown, other, coverage = (
            scene.shown.source.shown_as.mode,
            session.overlays.compare_with,
            scene.explaining.coverage,
        )
        bars = [(True, "viewport.color_bar", *_bar_of(shown, session.rig), value)]
        if shown_compare(session) != "off" and other in MODES and other != shown:
            bars.append((False, "viewport.other_color_bar", *_bar_of(other, session.rig), None))
        if coverage is not None and len(coverage.points):
            span = coverage.range
            bars.append((True, "viewport.coverage_bar", SIGNED, -span, span, "units off covered space", None))
        bottoms = {True: free.y1 - 6, False: free.y1 - 6}
        for is_right, name, map_name, low, high, unit, pointed in bars:
            has_room = free.width >= (width + 2 * MARGIN) * (1 if is_right else 2)
            if not map_name or not has_room or bottoms[is_right] - height < free.y0 + MARGIN:
                continue
            x = free.x1 - MARGIN if is_right else free.x0 + MARGIN + width
            plate = Rect(x - width, bottoms[is_right] - height, x, bottoms[is_right])
            bottoms[is_right] = plate.y0 - 4
            draw_color_bar(imgui.get_window_draw_list(), plate, map_name, low, high, unit, pointed)
            ui.mark_rect(name, plate)

    def _draw_legend(self, session: SessionView, scene: ViewportScene, free: Rect, right: float, y: float) -> None:
        """From its upper right corner down, as far as there is room above the plates."""
        draw = imgui.get_window_draw_list()
        for shape, color, words in legend_rows(session, scene):
            if y + 24 > free.y1:
                break
            text = elided(words, right - free.x0 - 34 - MARGIN)
            width = imgui.calc_text_size(text).x
            self.legend_x0 = min(self.legend_x0, right - width - 34)
            x = right - width - 34
            plate = theme.u32(theme.faded(theme.VOID, 0.78))
            draw.add_rect_filled(ImVec2(x, y), ImVec2(right, y + 24), plate, 4)
            middle = ImVec2(x + 14, y + 12)
            if shape in REGION_WORDS:
                draw_region_mark(draw, middle, shape, ON_PICTURE)
            elif shape == "disc":
                draw.add_circle_filled(middle, 6, theme.u32(color))
            elif shape == "circle":
                draw.add_circle(middle, 5, theme.u32(color), 0, 2)
            else:
                draw.add_ngon_filled(middle, 6, theme.u32(color), 4)
            draw.add_text(ImVec2(x + 26, y + 3), theme.u32(ON_PICTURE.text), text)
            y += 28


def _bar_of(mode: str, rig: CameraRig) -> tuple[str, float, float, str]:
    """Map, range and unit of a mode; without a map where its colours stand for no numbers."""
    return MODES[mode].map_name, *range_of(mode, rig), MODES[mode].unit


def _draw_busy(draw: imgui.ImDrawList, middle: ImVec2, color: Color) -> None:
    """Three quarters of a circle that turns in eighths."""
    turn = math.tau * int(time.perf_counter() / BUSY_REDRAW_S) / 8
    draw.path_arc_to(middle, 5.5, turn, turn + 0.75 * math.tau, 16)
    draw.path_stroke(theme.u32(color), 2.0)


def legend_rows(session: SessionView, scene: ViewportScene) -> list[tuple[str, Color, str]]:
    """Shape, colour and words of marks."""
    counts = scene.counts
    rows = [("disc", (*hue, 1.0), words) for hue, words in MODES[scene.shown.source.shown_as.mode].legend]
    clip_index, frame_index = counts.source.clip_index, counts.source.frame_index
    status = None if clip_index is None else session.clip_states[clip_index]
    n_inherited, n_own = (0, 0) if status is None else (status.n_inherited, status.n_own)
    if session.overlays.show_inherited and counts.n_inherited:
        words, n_all = ("reference anchors", n_own) if counts.is_reference else ("inherited anchors", n_inherited)
        text = count_text(counts.n_inherited, n_all, words, frame_index)
        rows += [("circle", ON_PICTURE.inherited, text), *_role_rows("circle", counts.inherited_roles)]
    if session.overlays.show_residual and counts.n_residual:
        text = count_text(counts.n_residual, n_own, "residual anchors", frame_index)
        rows += [("diamond", ON_PICTURE.residual, text), *_role_rows("diamond", counts.residual_roles)]
    if session.overlays.show_regions:
        for treat, words in REGION_WORDS.items():
            n = sum(region.treat == treat for region in session.regions.regions)
            text = f"{n} {words} region{'s' if n > 1 else ''}"
            rows += [(treat, ON_PICTURE.region_colors[treat], text)] if n else []
    return rows


def _role_rows(shape: str, counts: dict[str, int]) -> Sequence[tuple[str, Color, str]]:
    """Legend of anchors by role; nothing where they are all the same."""
    if len(counts) < 2:
        return []
    return [(shape, ON_PICTURE.role_colors[role], f"of them {format_count(n)} {role}") for role, n in counts.items()]
