"""The box in the toolbar that says how the rendered picture is compared, and with what."""

from __future__ import annotations

from imgui_bundle import imgui

from app.playback.modes.view_modes import COLOR, MODES
from app.session.session_view import SessionView
from app.session.showing.look_commands import CompareProject
from app.status import BLINK_HZ, CAPTURED, PROJECT, version_name
from ui.panels.actions.viewing.compare import COMPARE_WORDS, set_compare, set_other
from ui.panels.picture.comparison import shown_compare
from ui.panels.pieces.slider import slider
from ui.panels.pieces.widgets import box_flags, box_words
from ui.panels.state import Dispatch, UiState
from ui.panels.training.clip_versions import version_text

SLIDER_WIDTH = 120.0
MOST_RECENT = 3
"""Projects opened lately that are offered."""


def compare_words(session: SessionView) -> str:
    """Label of the box."""
    shown = shown_compare(session)
    return "Compare" if shown == "off" else COMPARE_WORDS[shown]


def draw_compare_box(session: SessionView, dispatch: Dispatch, ui: UiState, width: float) -> None:
    """All ways to compare, and everything to compare with, in one box. width: Units."""
    shown = shown_compare(session)
    imgui.set_next_item_width(width)
    is_open = imgui.begin_combo("##compare", box_words(compare_words(session), width), box_flags(width))
    ui.mark("viewport.compare")
    if not is_open:
        imgui.set_item_tooltip("Compare with another picture: side by side, wipe or blink (G)")
        return
    for mode, words in COMPARE_WORDS.items():
        if imgui.selectable(words, shown == mode)[0]:
            set_compare(session, dispatch, mode)
        ui.mark(f"viewport.compare.{mode}")
    imgui.separator()
    _draw_others(session, dispatch, ui)
    imgui.end_combo()


def _draw_others(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    overlays = session.overlays
    imgui.text_disabled("Compare with")
    others = [(CAPTURED, "Captured picture"), *((mode.name, mode.label) for mode in MODES.values())]
    for other, words in others:
        if imgui.selectable("Own colours" if other == COLOR else words, overlays.compare_with == other)[0]:
            set_other(session, dispatch, other)
        ui.mark(f"viewport.other.{other}")
    _draw_versions(session, dispatch, ui)
    _draw_projects(session, dispatch, ui)
    imgui.separator()
    imgui.set_next_item_width(SLIDER_WIDTH)
    slowest, fastest = BLINK_HZ
    blink = slider("Blink", overlays.blink_hz, slowest, fastest, "%.2f Hz", _CLAMPED)
    overlays.blink_hz = blink[1]
    ui.mark("viewport.blink_hz")


def _draw_versions(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Earlier versions of the clip under the playhead; nothing where it has none."""
    clip, overlays = session.timeline.clip, session.overlays
    versions = () if clip is None else session.clip_versions(clip.clip_index)
    if not versions:
        return
    imgui.separator()
    imgui.text_disabled("Earlier versions of this clip")
    for version in versions:
        other = version_name(version.number)
        if imgui.selectable(f"{version.number}: {version_text(version)}", overlays.compare_with == other)[0]:
            set_other(session, dispatch, other)
        ui.mark(f"viewport.other.{other}")


def _draw_projects(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The other project, those opened lately, and any other."""
    open_one, other, overlays = session.project_status, session.other_project, session.overlays
    if open_one is None:
        return
    imgui.separator()
    imgui.text_disabled("Another project")
    known = {open_one.folder}
    if other is not None:
        known.add(other.folder)
        if imgui.selectable(f"{other.name}##other", overlays.compare_with == PROJECT)[0]:
            set_other(session, dispatch, PROJECT)
        ui.mark(f"viewport.other.{PROJECT}")
    recent = [one for one in session.recent.entries if one.project and one.folder not in known]
    for row, one in enumerate(recent[:MOST_RECENT]):
        if imgui.selectable(f"{one.name}##recent{row}", False)[0]:
            dispatch(CompareProject(one.folder))
        ui.mark(f"viewport.other.recent.{row}")
    if imgui.selectable("Choose ...", False)[0]:
        ui.wishes.is_comparison = True
    ui.mark("viewport.other.choose")


_CLAMPED = imgui.SliderFlags_.always_clamp
