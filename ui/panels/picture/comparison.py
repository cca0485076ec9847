"""The rendered picture compared with another one: whether they are compared, how much each shows, and their names."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

from imgui_bundle import imgui

from app.playback.modes.view_modes import COLOR, MODES
from app.session.session_view import SessionView
from app.status import CAPTURED, PROJECT, OtherStatus, Overlays, VersionStatus, version_number
from ui.panels.state import UiState
from ui.viewport.hud_text import RENDERED

HOLD_KEY = imgui.Key.b
"""While it is held, the other picture covers the rendered one."""


def shown_compare(session: SessionView) -> str:
    """The comparison on screen: none with a captured picture from a free view, where no camera took one, and none with
    a project that is not chosen."""
    return session.overlays.compare if _has_other(session) else "off"


def _has_other(session: SessionView) -> bool:
    other = session.overlays.compare_with
    if other == PROJECT:
        return session.other_project is not None
    return other != CAPTURED or session.view.look_through is not None


def is_held(session: SessionView, ui: UiState) -> bool:
    """Does the user hold the key that shows the other picture alone?"""
    io = imgui.get_io()
    is_free = not (io.want_text_input or ui.is_popup_open or io.key_ctrl or io.key_alt or io.key_shift)
    return is_free and _has_other(session) and imgui.is_key_down(HOLD_KEY)


def covered_share(session: SessionView, ui: UiState, *, is_held: bool) -> float:
    """How much of the rendered picture's width the other one covers, from the left. Asks to be drawn again in time."""
    overlays = session.overlays
    if is_held:
        return 1.0
    if overlays.compare != "blink":
        return overlays.wipe_position
    beat = time.perf_counter() * 2.0 * overlays.blink_hz  # two pictures a cycle
    ui.redraw_within((math.floor(beat) + 1.0 - beat) / (2.0 * overlays.blink_hz))
    return float(math.floor(beat) % 2)


def kind_words(kind: str, mode_label: str) -> str:
    """Name of a rendered picture next to another one."""
    return f"{kind}, {mode_label.lower()}" if kind == RENDERED and mode_label else kind


def missing_words(overlays: Overlays, versions: Sequence[VersionStatus], project: OtherStatus | None = None) -> str:
    """Words where the other picture is missing. versions: Of the clip under the playhead."""
    if overlays.compare_with == CAPTURED:
        return "Reading the captured picture"
    if overlays.compare_with == PROJECT and project is not None and project.missing:
        return project.missing
    number = version_number(overlays.compare_with)
    if number is not None and number not in [version.number for version in versions]:
        return f"This clip has no version {number}"
    return f"{other_label(overlays, project)} is being drawn"


def other_label(overlays: Overlays, project: OtherStatus | None) -> str:
    """Name of the other picture in menus."""
    if overlays.compare_with == CAPTURED:
        return "Captured picture"
    if overlays.compare_with == PROJECT:
        return "Another project" if project is None else project.name
    number = version_number(overlays.compare_with)
    if number is not None:
        return f"Version {number}"
    return "Own colours" if overlays.compare_with == COLOR else MODES[overlays.compare_with].label


def frame_to_compare(session: SessionView) -> int:
    """The frame that the other picture ought to be of: the last one of a project that ends before the playhead."""
    frame_index, project = session.timeline.frame_index, session.other_project
    if session.overlays.compare_with != PROJECT or project is None:
        return frame_index
    return min(frame_index, project.n_frames - 1)
