"""The residuals panel: seams worst first, the matrix of frames and cameras, and the worst pictures with what was taken
there. Everything in it is a way to go there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.mending.mend_commands import AskMend
from app.session.session_view import SessionView
from app.session.showing.look_commands import LookThrough, SetFrame
from app.status import CELL_COLUMNS, CELL_RANGES, LOW_IS_BAD, ResidualStatus, SeamStatus
from engine.camera.rig import CameraRig
from engine.text import camera_text, duration_text
from ui.gl import ImageTexture
from ui.panels.excluding.excluded_drawing import exclusion_of
from ui.panels.excluding.menu import draw_exclusion_menu
from ui.panels.picture.color_bar import COLOR_BAR_SIZE, draw_color_bar
from ui.panels.pieces.widgets import elided, segment, text_wrapped_dim
from ui.panels.residuals.matrix import Matrix
from ui.panels.state import Dispatch, Rect, UiState
from ui.panels.timeline.rows.columns import provisional_text, shown_ratio
from ui.panels.timeline.rows.gutter import NOTES
from ui.panels.timeline.rows.rows import SEAMS
from ui.panels.timeline.rows.seam_lane import ratio_text, seam_color
from ui.panels.welcome.thumbnails import Thumbnails
from ui.style import theme
from ui.style.numbers import format_count
from ui.style.theme import Icon

COLUMN_WORDS = {"psnr": "PSNR", "flip": "FLIP", "E": "Flicker"}
COLUMN_MEANINGS = {
    "psnr": "Similarity to the captured picture, dB; higher is better",
    "flip": "Perceived difference, mean FLIP; lower is better",
    "E": "Change since the previous frame beyond that of the capture, mean E in 1/255; lower is better",
}
UNITS = {"psnr": "dB", "flip": "", "E": "x 1/255"}
N_WORST = 24
N_SEAMS = 8
ROW_HEIGHT = 46.0
PICTURE_SIZE = (58.0, 36.0)


def figure_text(value: float, column: str) -> str:
    """A figure with its unit."""
    digits = {"psnr": 1, "flip": 3, "E": 2}[column]
    return f"{value:.{digits}f} {UNITS[column]}".rstrip()


def listed_seams(seams: Sequence[SeamStatus], n: int) -> list[tuple[SeamStatus, float | None]]:
    """The highest ratios first, then seams whose ratio is provisional, in order and without it."""
    known = [(seam, ratio) for seam in seams if (ratio := shown_ratio(seam)) is not None]
    others = [(seam, None) for seam in seams if seam.is_provisional and seam.ratio is not None]
    return [*sorted(known, key=lambda pair: -pair[1]), *others][:n]


def _draw_seam_menu(seam: SeamStatus, dispatch: Dispatch, ui: UiState) -> None:
    """The menu of the item drawn last: by the right button."""
    if not imgui.begin_popup_context_item("seam menu"):
        return
    if imgui.menu_item("Mend this seam", "Shift+M", False)[0]:
        dispatch(AskMend(after=seam.clip_index))
    ui.mark(f"residuals.mend{seam.clip_index}")
    imgui.end_popup()


def seam_words(seam: SeamStatus, rig: CameraRig) -> str:
    """Figures of a seam, and the effect of a click."""
    lines = []
    if seam.ratio is not None:
        lines.append(f"Change of static parts at the seam, relative to inside the clips: {seam.ratio:.2f}")
    if seam.is_provisional:
        lines.append(f"Provisional: measured in {seam.n_cameras} of {seam.n_all} cameras so far.")
    if seam.score is not None:
        lines.append(f"Excess flicker: {seam.score:.2f} x 1/255, mean of {seam.n_cameras} cameras.")
    if seam.worst_camera is not None:
        lines.append(f"Worst in {camera_text(rig.names[seam.worst_camera])}.")
    return "\n".join([*lines, "Click to look through it and play around the boundary."])


def progress_text(status: ResidualStatus, column: str) -> str:
    """Of how many pictures the column that is shown is measured, and how long everything takes, in words."""
    if status.n_all == 0:
        return "Pictures are measured once a clip is trained."
    if status.n_done >= status.n_all:
        return f"All {format_count(status.n_all)} pictures of trained clips are measured."
    n_done, n_all = status.measured[column]
    done = f"{COLUMN_WORDS[column]} of {format_count(n_done)} of {format_count(n_all)} pictures measured"
    if status.is_held_back:
        return f"{done}; the rest continues slowly for now."
    if status.is_measuring and status.eta_s is not None:
        return f"{done}; all figures in about {duration_text(status.eta_s)}."
    return f"{done}."


class ResidualsPanel:
    """Owns the matrix's and the small pictures' textures.

    Args:
        make_texture: Makes an empty texture.
    """

    def __init__(self, make_texture: Callable[[], ImageTexture]) -> None:
        self._thumbnails = Thumbnails(make_texture)
        self._matrix = Matrix(make_texture)
        self._capture: object | None = None
        self._menu_cell: tuple[int, int] | None = None
        self._worst_key: object = None
        self._worst: Sequence[tuple[float, int, int]] = ()
        self.column = "psnr"
        """The figure in the matrix and the list; one of CELL_COLUMNS."""

    def release(self) -> None:
        """Free GL objects. GL thread only."""
        self._thumbnails.release()
        self._matrix.release()

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """Progress, seams, matrix, worst pictures."""
        if session.capture is None:
            text_wrapped_dim("Residuals appear here once a capture is open.")
            return
        if session.capture is not self._capture:
            self._thumbnails.release()
            self._capture = session.capture
        status = session.residual_status
        self._thumbnails.begin()
        text_wrapped_dim(progress_text(status, self.column))
        ui.mark("residuals.progress")
        if status.message:
            imgui.text_colored(ImVec4(*theme.VERMILLION), Icon.WARNING)
            imgui.same_line()
            text_wrapped_dim(status.message)
        if not status.cells:
            return
        self._draw_seams(status, session, dispatch, ui)
        self._draw_columns(ui)
        self._draw_matrix(status, session, dispatch, ui)
        self._draw_worst(status, session, dispatch, ui)

    def _draw_seams(self, status: ResidualStatus, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        if not status.seams:
            return
        imgui.separator_text("Seams between clips, worst first")
        imgui.set_item_tooltip(NOTES[SEAMS])
        found = listed_seams(status.seams, N_SEAMS)
        if not found:
            text_wrapped_dim("No boundary between two trained clips is measured yet.")
        for seam, ratio in found:
            imgui.push_id(seam.clip_index)
            is_clicked = imgui.selectable("##seam", session.timeline.frame_index == seam.frame_index)[0]
            ui.mark(f"residuals.seam{seam.clip_index}")
            imgui.set_item_tooltip(seam_words(seam, session.rig))
            _draw_seam_menu(seam, dispatch, ui)
            imgui.same_line(0, 0)
            imgui.text_colored(ImVec4(*(theme.TEXT_DIM if ratio is None else seam_color(ratio))), Icon.SQUARE)
            imgui.same_line(0, 8)
            words = provisional_text(seam) if ratio is None else ratio_text(ratio)
            where = f"clip {seam.clip_index - 1} to {seam.clip_index}, frame {seam.frame_index}"
            text = elided(f"{words}   {where}", imgui.get_content_region_avail().x)
            imgui.text_colored(ImVec4(*(theme.TEXT_DIM if ratio is None else theme.TEXT)), text)
            imgui.pop_id()
            if is_clicked:
                if seam.worst_camera is not None:
                    dispatch(LookThrough(seam.worst_camera))
                session.timeline.play_around(seam.frame_index)

    def _draw_columns(self, ui: UiState) -> None:
        imgui.separator_text("Frames and cameras")
        for index, column in enumerate(CELL_COLUMNS):
            if index:
                imgui.same_line(0, 2)
            if segment(COLUMN_WORDS[column], column == self.column):
                self.column = column
            ui.mark(f"residuals.column.{column}")
            imgui.set_item_tooltip(COLUMN_MEANINGS[column])

    def _draw_matrix(self, status: ResidualStatus, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        at = (session.timeline.frame_index, session.view.look_through)
        hovered, pressed = self._matrix.draw(status, self.column, session.rig, session.clips, at, ui)
        imgui.open_popup_on_item_click("cell menu", imgui.PopupFlags_.mouse_button_right)
        if hovered is not None and imgui.is_mouse_released(1):
            self._menu_cell = hovered
        if self._menu_cell is not None and imgui.begin_popup("cell menu"):
            frame_index, camera_index = self._menu_cell
            imgui.text_disabled(f"Frame {frame_index}")
            draw_exclusion_menu(session, dispatch, ui, camera_index, frame_index)
            imgui.end_popup()
        if pressed is not None and pressed != at:
            dispatch(SetFrame(pressed[0]))
            dispatch(LookThrough(pressed[1]))
        value = None
        if hovered is not None:
            frame_index, camera_index = hovered
            found = float(status.cells[self.column][frame_index, camera_index])
            is_known = found == found  # not a NaN
            value = found if is_known else None
            words = figure_text(found, self.column) if is_known else "not measured"
            excluded = exclusion_of(session, camera_index, frame_index)
            words = f"{words}\n{excluded}" if excluded else words
            held_out = " (held out)" if status.is_held_out[camera_index] else ""
            name = camera_text(session.rig.names[camera_index])
            imgui.set_tooltip(f"{name}{held_out}, frame {frame_index}: {words}")
        origin = imgui.get_cursor_screen_pos()
        width = min(imgui.get_content_region_avail().x, COLOR_BAR_SIZE[0])
        bar = Rect(origin.x, origin.y, origin.x + width, origin.y + COLOR_BAR_SIZE[1])
        best, worst = CELL_RANGES[self.column]
        if self.column in LOW_IS_BAD:
            best, worst = worst, best
        draw_color_bar(imgui.get_window_draw_list(), bar, "inferno", best, worst, UNITS[self.column], value)
        imgui.dummy(ImVec2(width, COLOR_BAR_SIZE[1]))

    def _draw_worst(self, status: ResidualStatus, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        imgui.separator_text("Worst pictures")
        key = (status.revision, self.column, id(session.capture))
        if key != self._worst_key:
            self._worst, self._worst_key = status.worst(self.column, N_WORST), key
        if not self._worst:
            text_wrapped_dim("Nothing is measured yet.")
        for value, frame_index, camera_index in self._worst:
            imgui.push_id(f"{frame_index}/{camera_index}")
            is_here = (frame_index, camera_index) == (session.timeline.frame_index, session.view.look_through)
            is_clicked = imgui.selectable("##worst", is_here, 0, ImVec2(0, ROW_HEIGHT))[0]
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            if imgui.is_item_visible():
                ui.mark(f"residuals.worst{frame_index}.{camera_index}")
                row = Rect(low.x, low.y, high.x, high.y)
                box = Rect(row.x0 + 4, row.y0 + 5, row.x0 + 4 + PICTURE_SIZE[0], row.y0 + 5 + PICTURE_SIZE[1])
                self._thumbnails.draw(session, camera_index, frame_index, box, ui)
                draw, x = imgui.get_window_draw_list(), box.x1 + 10
                draw.add_text(ImVec2(x, row.y0 + 5), theme.u32(theme.TEXT), figure_text(value, self.column))
                is_held_out = status.is_held_out[camera_index]
                name = elided(f"{camera_text(session.rig.names[camera_index])}, frame {frame_index}", row.x1 - x - 4)
                color = theme.HELD_OUT if is_held_out else theme.TEXT_DIM
                draw.add_text(ImVec2(x, row.y0 + 24), theme.u32(color), name)
            imgui.pop_id()
            if is_clicked:
                dispatch(SetFrame(frame_index))
                dispatch(LookThrough(camera_index))
