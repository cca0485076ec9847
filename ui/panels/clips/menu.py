"""Where a clip begins and ends, and what it is to the others, as entries of its context menu."""

from __future__ import annotations

from imgui_bundle import imgui

from app.session.clips.clip_commands import MergeClips, SetReferenceClip, SplitClip
from app.session.session_view import SessionView
from engine.capture.clip import Clip
from ui.panels.state import Dispatch, UiState
from ui.style.theme import Icon


def draw_cutting(
    session: SessionView, dispatch: Dispatch, ui: UiState, clip: Clip, *, frame_index: int, n_clips: int
) -> None:
    """Entries: split at a frame, merge with the next one, make it the reference. What is trained and lost by it is
    asked about.

    Args:
        frame_index: Where it would be split; at its first frame it cannot be.
        n_clips: How many there are.
    """
    project = session.project_status
    is_free = (project is None or project.is_writable) and not session.training.is_anywhere
    index = clip.clip_index
    can_split = clip.start < frame_index < clip.stop
    words = f"{Icon.COLUMNS}  Split at frame {frame_index}" if can_split else f"{Icon.COLUMNS}  Split"
    if _item(ui, "split", words, is_enabled=is_free and can_split):
        dispatch(SplitClip(frame_index))
    if _item(ui, "merge", f"{Icon.LAYERS}  Merge with clip {index + 1}", is_enabled=is_free and index + 1 < n_clips):
        dispatch(MergeClips(index))
    is_reference = index == session.reference_index
    if _item(ui, "reference", f"{Icon.HOME}  Make reference clip", is_enabled=is_free and not is_reference):
        dispatch(SetReferenceClip(index))


def _item(ui: UiState, name: str, label: str, *, is_enabled: bool) -> bool:
    is_chosen = imgui.menu_item(label, "", False, is_enabled)[0]
    ui.mark(f"clip menu.{name}")
    return is_chosen
