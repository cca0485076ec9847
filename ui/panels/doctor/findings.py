"""The list of findings: sign, word and certainty, what was found, what to do, and the button that does it."""

from __future__ import annotations

from collections.abc import Sequence

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.commands import CorrectCapture, LookThrough, SetHoldout
from engine.camera.rig import CameraRig
from engine.doctor.finding import Finding
from ui.panels.doctor.words import SEVERITY_ICONS, SEVERITY_WORDS, certainty_text, fix_words, severity_color
from ui.panels.state import Dispatch, UiState
from ui.panels.widgets import text_wrapped_dim
from ui.style import theme
from ui.style.theme import Icon


def draw_findings(
    findings: Sequence[Finding], chosen: int, rig: CameraRig, dispatch: Dispatch, ui: UiState, *, can_hold_out: bool
) -> int:
    """One entry per finding; returns which one is chosen.

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
            _draw_buttons(finding, rig, dispatch, ui, can_hold_out=can_hold_out)
        imgui.spacing()
        imgui.pop_id()
    return chosen


def _draw_buttons(finding: Finding, rig: CameraRig, dispatch: Dispatch, ui: UiState, *, can_hold_out: bool) -> None:
    fix = finding.fix
    if fix is not None:
        label, words = fix_words(fix)
        if imgui.button(f"{Icon.CHECK}  {label}##fix"):
            if fix.holdout is not None and can_hold_out:
                dispatch(SetHoldout(tuple(rig.names.index(name) for name in fix.holdout if name in rig.names)))
            else:
                dispatch(CorrectCapture(fix, words))
        ui.mark("doctor.fix")
        imgui.set_item_tooltip(_escaped(words))
        imgui.same_line()
    rows = [rig.names.index(name) for name in finding.cameras if name in rig.names]
    if rows:
        if imgui.button(f"{Icon.EYE}  Look through##look"):
            dispatch(LookThrough(rows[0]))
        ui.mark("doctor.look")
        imgui.set_item_tooltip(_escaped(f"Look through {rig.names[rows[0]]}"))
    else:
        imgui.new_line()


def _escaped(text: str) -> str:
    """Tooltips are formatted by ImGui: a percent sign of a name is not meant."""
    return text.replace("%", "%%")
