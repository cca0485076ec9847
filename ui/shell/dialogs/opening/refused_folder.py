"""Why a folder does not open, and the remedy: its videos are calibrated, or files outside of it are allowed."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from app.project.opening.capture_report import RefusedFolder
from app.session.captures.capture_commands import LookAtVideos
from app.session.commands import CloseQuestion
from app.session.projects.project_commands import OpenCapture
from ui.panels.pieces.widgets import (
    elided,
    elided_path,
    pop_bold,
    primary_button,
    push_bold,
    text_wrapped,
    text_wrapped_dim,
)
from ui.panels.state import UiState
from ui.style import theme
from ui.style.theme import Icon

BUTTON = ImVec2(150, 34)
MAX_NAMED = 4
INDENT = 34.0
"""Of the parts that belong to words after a dot."""
ALLOW = "Open it, the files are mine"


def draw_refused(
    found: RefusedFolder, ui: UiState, *, is_agreed: bool
) -> CloseQuestion | LookAtVideos | OpenCapture | None:
    """Draw all of the dialog; returns the answer. is_agreed: Enter was pressed."""
    width = imgui.get_content_region_avail().x
    if imgui.begin_child("why", ImVec2(0, -(BUTTON.y + 18)), imgui.ChildFlags_.nav_flattened):
        push_bold(ui, ui.fonts.body_size + 2)
        imgui.text(elided(found.path.name or str(found.path), width))
        pop_bold(ui)
        imgui.text_disabled(elided_path(str(found.path), width))
        imgui.spacing()
        imgui.text_colored(ImVec4(*theme.ORANGE), Icon.WARNING)
        imgui.same_line()
        text_wrapped(found.message)
        if found.hint:
            text_wrapped_dim(found.hint)
        imgui.spacing()
        if found.videos:
            names = ", ".join(video.name for video in found.videos[:MAX_NAMED])
            more = ", ..." if len(found.videos) > MAX_NAMED else ""
            text_wrapped(
                f"It holds {len(found.videos)} videos ({names}{more}). If each shows the same scene from another "
                "camera, calibrate them to find the camera poses from the pictures."
            )
        for message, hint in found.problems:
            imgui.bullet()
            text_wrapped(message)
            if hint:
                imgui.indent(INDENT)
                text_wrapped_dim(hint)
                imgui.unindent(INDENT)
    imgui.end_child()
    imgui.separator()
    is_copied = imgui.button(f"{Icon.COPY}  Copy", ImVec2(0, BUTTON.y))
    ui.mark("refused.copy")
    if is_copied and not is_agreed:
        imgui.set_clipboard_text(found.text)
    width = BUTTON.x + 8
    allow = ImVec2(imgui.calc_text_size(ALLOW).x + 32, BUTTON.y)
    other = allow.x + 8 if found.needs_links else width if found.videos else 0.0
    imgui.same_line(imgui.get_window_width() - width - other - 6)
    if other == 0.0:
        is_closed = primary_button("Close", BUTTON, ui)
        ui.mark("refused.close")
        imgui.set_item_default_focus()
        return CloseQuestion() if is_closed or is_agreed else None
    is_closed = imgui.button("Close", BUTTON)
    ui.mark("refused.close")
    if found.needs_links:  # Enter alone does not do it
        imgui.set_item_default_focus()
    imgui.same_line()
    if found.needs_links:
        is_allowed = imgui.button(ALLOW, allow)
        ui.mark("refused.allow")
        imgui.set_item_tooltip("Lets this capture read files outside its folder; its project remembers this.")
        if is_allowed:
            return OpenCapture(found.path, follow_links=True, is_asking=True)
        return CloseQuestion() if is_closed or is_agreed else None
    is_chosen = primary_button("Calibrate ...", BUTTON, ui)
    ui.mark("refused.calibrate")
    imgui.set_item_default_focus()
    if is_closed:
        return CloseQuestion()
    return LookAtVideos(found.path) if is_chosen or is_agreed else None
