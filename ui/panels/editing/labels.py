"""The user's own names of clips and cameras: how they are shown, and the field in which they are written."""

from __future__ import annotations

from typing import Literal

from imgui_bundle import imgui

from app.document.project_document import MAX_TEXT_CHARACTERS
from app.session.editing.edit_commands import SetLabel
from app.session.session_view import SessionView
from engine.text import one_line
from ui.panels.state import Dispatch, UiState

WIDTH = 210.0


def with_label(session: SessionView, kind: Literal["clip", "camera"], name: str, title: str) -> str:
    """A title with the user's own name behind it. name: See app.document.project_document.Label."""
    label = session.edits.label(kind, name)
    return f"{title}  {one_line(label)}" if label else title


def draw_label_field(
    session: SessionView, dispatch: Dispatch, ui: UiState, kind: Literal["clip", "camera"], name: str
) -> None:
    """Typed text counts at once, as one step of the history."""
    imgui.set_next_item_width(WIDTH)
    imgui.begin_disabled(not session.edits.can_edit)
    hint = f"your own name for this {kind}"
    _, typed = imgui.input_text_with_hint("##label", hint, session.edits.label(kind, name))
    ui.mark(f"label.{kind}")
    imgui.end_disabled()
    if imgui.is_item_activated():
        ui.editing.begin_gesture()
    if imgui.is_item_edited():
        dispatch(SetLabel(kind, name, typed[:MAX_TEXT_CHARACTERS], ui.editing.gesture))
