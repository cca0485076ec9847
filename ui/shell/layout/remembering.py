"""Brings back the window's appearance, and keeps it: layout, scale, marks, and each project's frame and view.

Written a while after something changed and when the window closes, so that a killed program has lost seconds of it.
"""

from __future__ import annotations

import time
from typing import Any

from imgui_bundle import imgui

from app.session.editing.edit_commands import PutMarker
from app.session.projects.preferences import PreferencesFile
from app.session.projects.window_memory import WindowMemory, markers_of, show_again, view_of
from app.session.session_view import WindowSession
from app.session.showing.look_commands import ActivateView
from ui.panels.state import UiState

SAVE_AFTER_S = 5.0
LAYOUT_VERSION = "; panels of ClipGStream Studio, version 7\n"
"""Comes first in the kept layout; another version has other panels and is not taken."""


def present_layout() -> str:
    """Where the panels are now, as text."""
    return LAYOUT_VERSION + imgui.save_ini_settings_to_memory()


def take_layout(text: str) -> bool:
    """Put the panels where a text of `present_layout` says. Between two frames only.

    Returns:
        False for a text of another version, which changes nothing.
    """
    if not text.startswith(LAYOUT_VERSION):
        return False
    imgui.load_ini_settings_from_memory(text)
    return True


class Remembering:
    """Follows one session in one window. memory, preferences: None keeps nothing, as in most tests."""

    def __init__(self, memory: WindowMemory | None, ui: UiState, preferences: PreferencesFile | None = None) -> None:
        self._memory, self._ui, self._preferences = memory, ui, preferences
        self._has_told = False
        self._folder: str | None = None
        self._saved_s = time.perf_counter()

    def restore_layout(self) -> None:
        """Give ImGui its panels back, before the first frame."""
        if self._memory is not None:
            take_layout(self._memory.layout)

    def restore_marks(self, session: WindowSession) -> None:
        """Settings shared by all projects: size and opacity of anchor marks, unit and lanes of the timeline, and what
        mouse and keys do."""
        if self._memory is None:
            return
        self._ui.timeline.restore(self._memory.time_unit, self._memory.folded_lanes)
        navigation = self._ui.navigation
        navigation.preset_name = self._memory.navigation
        navigation.is_motion_reduced = self._memory.is_motion_reduced
        if self._memory.mark_size is not None:
            session.overlays.mark_size = self._memory.mark_size
        if self._memory.mark_opacity is not None:
            session.overlays.mark_opacity = self._memory.mark_opacity

    def follow(self, session: WindowSession) -> None:
        """Once per turn of the loop: shows a project that was just opened as it was left, and keeps what changes."""
        memory = self._memory
        is_due = time.perf_counter() - self._saved_s >= SAVE_AFTER_S
        if is_due:
            self._saved_s = time.perf_counter()
            if self._preferences is not None:
                self._preferences.save_soon()
            self._tell(session)
        if memory is None:
            return
        folder = _folder_of(session)
        if folder != self._folder:
            self._folder = folder
            if folder in memory.views:
                show_again(session, memory.views[folder])
                session.dispatch(ActivateView(session.views.active_index))  # and what draws pictures knows it
                self._take_over_markers(session, memory.views[folder])
        if is_due:
            self._keep(session)
            memory.save_soon()
        elif folder is not None:
            memory.keep_view(folder, view_of(session))

    def _take_over_markers(self, session: WindowSession, kept: dict[str, Any]) -> None:
        """Markers that an earlier version has kept next to the project become part of it, once."""
        if session.edits.can_edit and not session.timeline.markers:
            gesture = self._ui.timeline.begin_gesture()
            for frame_index, text in markers_of(kept, session.timeline):
                session.dispatch(PutMarker(frame_index, text, gesture))

    def save(self, session: WindowSession) -> None:
        """Keep everything now."""
        if self._preferences is not None:
            self._preferences.save()
        if self._memory is not None:
            self._keep(session)
            self._memory.save()
        self._tell(session)

    def _keep(self, session: WindowSession) -> None:
        memory = self._memory
        assert memory is not None
        self._saved_s = time.perf_counter()
        if self._folder is not None and self._folder == _folder_of(session):
            memory.keep_view(self._folder, view_of(session))
        memory.ui_scale = self._ui.scale.chosen
        memory.layout = present_layout()
        navigation = self._ui.navigation
        memory.navigation, memory.is_motion_reduced = navigation.preset.name, navigation.is_motion_reduced
        memory.mark_size, memory.mark_opacity = session.overlays.mark_size, session.overlays.mark_opacity
        memory.time_unit, memory.folded_lanes = self._ui.timeline.unit, tuple(sorted(self._ui.timeline.folded))

    def _tell(self, session: WindowSession) -> None:
        """Say once that nothing can be kept, for whatever file it was found out first."""
        failed = next((file for file in (self._preferences, self._memory) if file is not None and file.failure), None)
        if failed is None or self._has_told:
            return
        self._has_told = True
        session.notices.add(
            "warn",
            "Preferences cannot be saved",
            f"{failed.failure} - {failed.path}",
            "They apply until you quit. Projects are not affected.",
        )


def _folder_of(session: WindowSession) -> str | None:
    if session.capture is None:
        return None
    return str(session.capture.path if session.project is None else session.project.folder)
