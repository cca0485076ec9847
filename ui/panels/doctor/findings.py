"""The list of findings: sign, word and certainty, the fault, its remedy, and the button for that."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.captures.capture_commands import CorrectCapture, LookAtVideos, SynchroniseCameras
from app.session.projects.setting_commands import SetHoldout
from app.session.showing.look_commands import LookThrough
from engine.camera.rig import CameraRig
from engine.doctor.finding import Finding
from ui.panels.doctor.words import SEVERITY_ICONS, SEVERITY_WORDS, certainty_text, fix_words, severity_color
from ui.panels.pieces.widgets import text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.style import theme
from ui.style.theme import Icon

MISCALIBRATED = ("calibration", "focal length", "pose")
OUT_OF_STEP = "synchronisation"
"""Kinds of findings that a dialog of its own helps with."""


def draw_findings(
    findings: Sequence[Finding],
    chosen: int,
    rig: CameraRig,
    folder: Path,
    dispatch: Dispatch,
    ui: UiState,
    *,
    can_hold_out: bool,
) -> int:
    """One entry per finding; returns which one is chosen.

    Args:
        folder: Of the capture.
        can_hold_out: The open project can take other held-out cameras itself, so that the capture need not change.
    """
    for index, finding in enumerate(findings):
        imgui.push_id(index)
        start = imgui.get_cursor_screen_pos()
        label = f"{SEVERITY_ICONS[finding.severity]}  {SEVERITY_WORDS[finding.severity]}##head"
        imgui.push_style_color(imgui.Col_.text, ImVec4(*severity_color(finding.severity)))
        if imgui.selectable(label, index == chosen, 0, ImVec2(0, 22))[0]:
            chosen = index
        imgui.pop_style_color()
        ui.mark(f"doctor.finding{index}")
        certainty = certainty_text(finding)
        right = start.x + imgui.get_content_region_avail().x - imgui.calc_text_size(certainty).x - 6
        imgui.get_window_draw_list().add_text(ImVec2(right, start.y + 3), theme.u32(theme.TEXT_DIM), certainty)
        imgui.push_text_wrap_pos(0.0)
        imgui.text(finding.text)
        imgui.pop_text_wrap_pos()
        if index == chosen:
            text_wrapped_dim(finding.advice)
            _draw_buttons(finding, rig, folder, dispatch, ui, can_hold_out=can_hold_out)
        imgui.spacing()
        imgui.pop_id()
    return chosen


def _draw_buttons(
    finding: Finding, rig: CameraRig, folder: Path, dispatch: Dispatch, ui: UiState, *, can_hold_out: bool
) -> None:
    fix, row = finding.fix, _Row()
    if fix is not None:
        label, words = fix_words(fix)
        if row.button(f"{Icon.CHECK}  {label}##fix", words):
            if fix.holdout is not None and can_hold_out:
                dispatch(SetHoldout(tuple(rig.names.index(name) for name in fix.holdout if name in rig.names)))
            else:
                dispatch(CorrectCapture(fix, words))
        ui.mark("doctor.fix")
    if finding.kind in MISCALIBRATED:
        if row.button(f"{Icon.CAMERA}  Calibrate ...##calibrate", "Find the camera poses again, from the pictures"):
            dispatch(LookAtVideos(folder))
        ui.mark("doctor.calibrate")
    if finding.kind == OUT_OF_STEP:
        if row.button(f"{Icon.CLOCK}  Synchronise ...##synchronise", "Measure the offset of every camera"):
            dispatch(SynchroniseCameras())
        ui.mark("doctor.synchronise")
    cameras = [rig.names.index(name) for name in finding.cameras if name in rig.names]
    if cameras:
        if row.button(f"{Icon.EYE}  Look through##look", f"Look through {rig.names[cameras[0]]}"):
            dispatch(LookThrough(cameras[0]))
        ui.mark("doctor.look")


class _Row:
    """Buttons side by side, in as many lines as they need."""

    def __init__(self) -> None:
        self._is_first = True

    def button(self, label: str, tooltip: str) -> bool:
        right = imgui.get_cursor_screen_pos().x + imgui.get_content_region_avail().x
        style = imgui.get_style()
        width = imgui.calc_text_size(label, hide_text_after_double_hash=True).x + 2 * style.frame_padding.x
        if not self._is_first and imgui.get_item_rect_max().x + style.item_spacing.x + width <= right:
            imgui.same_line()
        self._is_first = False
        is_clicked = imgui.button(label)
        imgui.set_item_tooltip(_escaped(tooltip))
        return is_clicked


def _escaped(text: str) -> str:
    """Tooltips are formatted by ImGui: a percent sign of a name is not meant."""
    return text.replace("%", "%%")
