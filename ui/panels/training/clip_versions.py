"""Earlier versions of a clip in menus: when and how each was trained, bring it back, remove it."""

from __future__ import annotations

from imgui_bundle import imgui

from app.psnr_words import psnr_label
from app.session.clips.clip_commands import CompareVersion
from app.session.session_view import SessionView
from app.session.training.train_commands import RemoveVersion, RestoreVersion
from app.status import VersionStatus
from engine.text import size_text
from ui.panels.pieces.copying import draw_copy_menu
from ui.panels.state import Dispatch, UiState
from ui.style.numbers import format_count
from ui.style.theme import Icon

MAX_DIFFERENCES = 6


def version_text(version: VersionStatus) -> str:
    """Description of a version, in one line."""
    psnr = version.held_out_psnr
    psnr = "" if psnr is None else f", {psnr_label(psnr, is_whole=version.held_out_whole)} dB"
    steps = f", {format_count(version.step)} steps" if version.step else ""
    return f"{version.trained}{steps}{psnr}, {size_text(version.n_bytes / 1e6)}"


def difference_lines(version: VersionStatus) -> list[str]:
    """Settings in which it differs from the clip as it is now."""
    lines = [f"{name} was {value or '–'}, is {now or '–'}" for name, value, now in version.differences]
    more = len(lines) - MAX_DIFFERENCES
    return lines if more <= 0 else [*lines[:MAX_DIFFERENCES], f"and {more} more settings"]


def draw_versions_menu(session: SessionView, dispatch: Dispatch, ui: UiState, clip_index: int) -> None:
    """A menu inside a menu; disabled where the clip has no earlier versions."""
    versions = session.clip_versions(clip_index)
    label = f"{Icon.CLOCK_BACK}  Earlier versions" + (f" ({len(versions)})" if versions else "")
    is_open = imgui.begin_menu(f"{label}###versions", bool(versions))
    if not is_open:
        ui.mark("clip menu.versions")
        return
    for version in versions:
        imgui.push_id(version.number)
        if imgui.begin_menu(f"{version_text(version)}###version"):
            for line in difference_lines(version):
                imgui.text_disabled(line)
            if version.why_not:
                imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + 320.0)
                imgui.text_disabled(version.why_not)
                imgui.pop_text_wrap_pos()
            if imgui.menu_item(f"{Icon.COLUMNS}  Compare, side by side", "Shift+G", False, True)[0]:
                dispatch(CompareVersion(clip_index, version.number))
            ui.mark(f"clip menu.compare{version.number}")
            if imgui.menu_item(f"{Icon.UNDO}  Restore", "", False, not version.why_not)[0]:
                dispatch(RestoreVersion(clip_index, version.number))
            ui.mark(f"clip menu.restore{version.number}")
            imgui.set_item_tooltip("The present clip becomes an earlier version")
            draw_copy_menu(
                ui,
                "clip menu.version",
                lambda version=version: session.command_texts.version(clip_index, version.number),
            )
            if imgui.menu_item(f"{Icon.TRASH}  Delete for good", "", False, True)[0]:
                dispatch(RemoveVersion(clip_index, version.number))
            ui.mark(f"clip menu.remove{version.number}")
            imgui.end_menu()
        else:
            ui.mark(f"clip menu.version{version.number}")
        imgui.pop_id()
    imgui.end_menu()
