"""The dialog that shows how far cameras are ahead of each other, how certain that is, and corrects it on request.

Enter continues where there is something to correct; Escape closes, and stops a measurement that runs.
"""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.captures.capture_commands import ApplyOffsets
from app.session.captures.synchronisation_page import OffsetRow, SynchronisationPage
from app.session.commands import CloseQuestion, Command
from app.session.projects.project_commands import OpenCapture
from app.session.session_view import SessionView
from app.status import JobStatus
from ui.panels.pieces.widgets import primary_button, text_wrapped, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.shell.dialogs.modal import Modal
from ui.style import theme
from ui.style.theme import Icon

TITLE = "Synchronise cameras###synchronisation"
SIZE = (760.0, 600.0)
BUTTON = ImVec2(190, 34)
LABEL_WIDTH = 110.0
ABOUT = (
    "Measured from timecodes, sound and motion. An offset of +2 means that frame 12 of this camera shows what frame "
    "10 of the others shows."
)


class SynchronisationDialog:
    """Owns the folder that was typed."""

    def __init__(self) -> None:
        self._modal = Modal()
        self._target_of: Path | None = None
        self._target = ""

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """Draw the dialog while cameras are synchronised."""
        page = session.synchronising.page
        keys = self._modal.begin(None if page is None else TITLE, TITLE, SIZE)
        if keys is None or page is None:
            return
        if not keys.is_up:
            dispatch(CloseQuestion())
            return
        if page.target != self._target_of:
            self._target_of, self._target = page.target, str(page.target)
        answer: Command | None = None
        if imgui.begin_child("offsets", ImVec2(0, -(BUTTON.y + 18)), imgui.ChildFlags_.nav_flattened):
            self._draw_content(page, session.synchronising.progress, ui)
        imgui.end_child()
        imgui.separator()
        answer = self._draw_buttons(page, ui, is_agreed=keys.is_agreed)
        if answer is None and (keys.is_left or keys.is_closed):
            answer = CloseQuestion()
        if isinstance(answer, CloseQuestion | OpenCapture):
            imgui.close_current_popup()
        imgui.end_popup()
        if answer is not None:
            dispatch(answer)

    def _draw_content(self, page: SynchronisationPage, progress: JobStatus | None, ui: UiState) -> None:
        text_wrapped_dim(ABOUT)
        imgui.spacing()
        if page.state == "running":
            share, message = (0.0, "") if progress is None else (progress.done, progress.message)
            imgui.text(message or "Reading the recordings")
            imgui.progress_bar(share, ImVec2(-1, 20), f"{100 * share:.0f} %")
            ui.redraw_within(0.2)
            return
        if page.failure:
            imgui.text_colored(ImVec4(*theme.ORANGE), Icon.WARNING)
            imgui.same_line()
            text_wrapped(page.failure)
        if not page.rows:
            return
        _draw_verdict(page)
        _draw_table(page.rows, page.fps)
        for sentence in page.disagreements:
            imgui.text_colored(ImVec4(*theme.ORANGE), Icon.WARNING)
            imgui.same_line()
            text_wrapped(sentence)
        for note in page.notes:
            text_wrapped_dim(note)
        if page.can_apply and page.state == "done":
            imgui.spacing()
            imgui.align_text_to_frame_padding()
            imgui.text("Output")
            imgui.same_line(LABEL_WIDTH)
            imgui.set_next_item_width(-1)
            self._target = imgui.input_text("##target", self._target)[1]
            ui.mark("synchronisation.target")
            text_wrapped_dim(
                "A small file, capture.json; the videos do not change. A corrected capture needs a new project."
            )

    def _draw_buttons(self, page: SynchronisationPage, ui: UiState, *, is_agreed: bool) -> Command | None:
        is_copied = bool(page.rows) and imgui.button(f"{Icon.COPY}  Copy", ImVec2(0, BUTTON.y))
        if is_copied and not is_agreed:
            imgui.set_clipboard_text(page.text)
        is_done = page.state == "done" and page.can_apply
        n_buttons = 2 if is_done or page.state == "written" else 1
        place = imgui.get_window_width() - n_buttons * (BUTTON.x + 8) - 6
        if page.rows:
            imgui.same_line(place)
        else:
            imgui.set_cursor_pos_x(place)
        is_closed = imgui.button("Stop" if page.state == "running" else "Close", BUTTON)
        ui.mark("synchronisation.close")
        if is_closed:
            return CloseQuestion()
        if n_buttons == 1:
            return CloseQuestion() if is_agreed and page.state != "running" else None
        imgui.same_line()
        is_clicked = primary_button("Correct the capture" if is_done else "Open the capture", BUTTON, ui)
        ui.mark("synchronisation.apply" if is_done else "synchronisation.open")
        imgui.set_item_default_focus()
        if not (is_clicked or is_agreed):
            return None
        if is_done:
            return ApplyOffsets(Path(self._target.strip() or str(page.target)).expanduser())
        assert page.written is not None
        return OpenCapture(page.written, follow_links=page.written != page.capture, is_asking=True)


def _draw_verdict(page: SynchronisationPage) -> None:
    if page.state == "written":
        icon, color, words = Icon.CHECK, theme.GREEN, f"The corrected capture is in {page.written}."
    elif page.is_in_step:
        icon, color, words = Icon.CHECK, theme.GREEN, "The cameras appear to be synchronised."
    elif page.can_apply:
        icon, color, words = Icon.INFO, theme.SKY, "Some cameras are ahead or behind."
    else:
        icon, color = Icon.WARNING, theme.ORANGE
        words = (
            "Some offsets are too uncertain to apply. Record a clap that all cameras see or hear, or set "
            "offset_frames in capture.json."
        )
    imgui.text_colored(ImVec4(*color), icon)
    imgui.same_line()
    text_wrapped(words)


def _draw_table(rows: tuple[OffsetRow, ...], fps: float) -> None:
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.sizing_stretch_prop
    if not imgui.begin_table("rows", 5, flags):
        return
    for title in ("Camera", "Offset, frames", "Milliseconds", "Certain", "By"):
        imgui.table_setup_column(title)
    imgui.table_headers_row()
    for row in rows:
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text(row.name)
        if row.offset_frames is None:
            cells = ("unknown", "", "", "not found")
        else:
            cells = (
                f"{row.offset_frames:+.2f} (give or take {row.sigma_frames:.2f})",
                f"{1000 * row.offset_frames / max(fps, 1e-6):+.1f}",
                f"{100 * row.confidence:.0f} %{'' if row.is_sure else ', too low'}",
                row.source,
            )
        for cell in cells:
            imgui.table_next_column()
            imgui.text(cell)
    imgui.end_table()
