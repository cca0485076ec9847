"""A description of the program, and where its documents and its log are."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.background.logs import log_path
from engine.own_modules import program_version
from ui.panels.actions.window import DOCUMENTS
from ui.panels.pieces.widgets import elided_path, text_wrapped_dim
from ui.panels.state import UiState
from ui.shell.dialogs.modal import Modal
from ui.style.theme import Icon

SIZE = (620.0, 236.0)
WORDS = "Cuts captures of synchronised cameras into clips, trains them one by one, and shows the scene from any side."


class AboutDialog:
    """Up from when it was asked for until it is closed."""

    def __init__(self) -> None:
        self._modal = Modal()
        self._asked: object = None

    def draw(self, ui: UiState) -> None:
        """Open it where that was asked for, and draw it while it is open."""
        if ui.wishes.is_about:
            ui.wishes.is_about, self._asked = False, object()
        keys = self._modal.begin(self._asked, "About ClipGStream Studio###about", SIZE)
        if keys is None:
            return
        is_left = keys.is_left or keys.is_closed or keys.is_agreed
        if keys.is_up:
            is_left |= self._draw_inside(ui)
            if is_left:
                imgui.close_current_popup()
            imgui.end_popup()
        if is_left:
            self._asked = None

    def _draw_inside(self, ui: UiState) -> bool:
        """Returns whether it was closed by its button."""
        imgui.text(f"ClipGStream Studio {program_version()}    MIT licence")
        text_wrapped_dim(WORDS)
        imgui.spacing()
        for name, path in (("Documents", str(DOCUMENTS)), ("Log", str(log_path()))):
            if imgui.button(f"{Icon.COPY}  Copy##{name}"):
                imgui.set_clipboard_text(path)
            ui.mark(f"about.{name.lower()}")
            imgui.same_line()
            imgui.align_text_to_frame_padding()
            imgui.text_disabled(name)
            imgui.same_line(180)
            imgui.text(elided_path(path, imgui.get_content_region_avail().x))
        imgui.spacing()
        imgui.set_cursor_pos_x(imgui.get_window_width() - 136)
        is_clicked = imgui.button("Close", ImVec2(120, 0))
        ui.mark("about.close")
        return is_clicked
