"""The preferences: one dialog with pages. Changes on a page are seen at once, and kept in the user's configuration."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Protocol

from imgui_bundle import ImVec2, ImVec4, imgui

from app.project.projects_folder import VARIABLE, projects_dir
from app.session.projects.preferences import CACHE_MB, MAX_WORKERS
from engine.backends.table import AUTO, BACKENDS
from ui.panels.actions.window import choose_scale
from ui.panels.picture.gestures import PRESETS, mouse_help
from ui.panels.pieces.widgets import text_wrapped_dim
from ui.panels.state import UiState
from ui.shell.preferences_keys import KeysPage
from ui.style import theme
from ui.style.palette import THEMES
from ui.style.ui_scale import CHOICES, scale_text

TITLE = "Preferences###preferences"
SIZE = (760.0, 520.0)
PAGES_WIDTH = 150.0
LABEL_WIDTH = 200.0
GESTURE_WIDTH = 150.0
USUAL_CACHE_MB = 384


class Page(Protocol):
    """One page. is_asking: Whether a question of its own is up, to which Escape belongs."""

    def draw(self, ui: UiState) -> None: ...

    @property
    def is_asking(self) -> bool: ...


class _Plain:
    """A page that asks nothing."""

    is_asking = False

    def __init__(self, draw: Callable[[UiState], None]) -> None:
        self._draw = draw

    def draw(self, ui: UiState) -> None:
        """Draw it."""
        self._draw(ui)


class PreferencesDialog:
    """Owns which page is shown."""

    def __init__(self) -> None:
        self._pages: dict[str, Page] = {
            "General": _Plain(draw_general),
            "Navigation": _Plain(draw_navigation),
            "Memory": _Plain(draw_memory),
            "Keys": KeysPage(),
        }
        self._shown = "General"
        self._n_popups = 0
        self.why_unsaved = ""

    @property
    def titles(self) -> tuple[str, ...]:
        """Of the pages, in their order."""
        return tuple(self._pages)

    def draw(self, ui: UiState) -> None:
        """Open it where that was asked for, and draw it while it is open."""
        wanted, ui.wishes.preferences_page = ui.wishes.preferences_page, None
        if wanted is not None:
            self._shown = wanted if wanted in self._pages else self._shown
            imgui.open_popup(TITLE)
        viewport = imgui.get_main_viewport()
        imgui.set_next_window_pos(viewport.get_center(), imgui.Cond_.always, ImVec2(0.5, 0.5))
        width, height = min(SIZE[0], viewport.work_size.x - 24), min(SIZE[1], viewport.work_size.y - 24)
        imgui.set_next_window_size(ImVec2(width, height))
        flags = imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_resize
        is_open, _ = imgui.begin_popup_modal(TITLE, True, flags)
        if not is_open:
            return
        self._draw_pages(ui)
        is_topmost = self._n_popups == (n_popups := len(imgui.get_current_context().open_popup_stack)) == 1
        self._n_popups = n_popups
        is_asking = self._pages[self._shown].is_asking
        if is_topmost and not is_asking and imgui.is_key_pressed(imgui.Key.escape, False):
            imgui.close_current_popup()
            ui.redraw_within(0.0)
        imgui.end_popup()

    def _draw_pages(self, ui: UiState) -> None:
        if imgui.begin_child("pages", ImVec2(PAGES_WIDTH, 0)):
            for title in self._pages:
                if imgui.selectable(title, title == self._shown, imgui.SelectableFlags_.no_auto_close_popups)[0]:
                    self._shown = title
                ui.mark(f"preferences.{title}")
        imgui.end_child()
        imgui.same_line(0, 18)
        if imgui.begin_child("page", ImVec2(0, 0), imgui.ChildFlags_.nav_flattened):
            if self.why_unsaved:
                imgui.push_text_wrap_pos(0.0)
                words = f"{theme.Icon.WARNING}  Changes are lost when you quit: {self.why_unsaved}"
                imgui.text_colored(ImVec4(*theme.ORANGE), words)
                imgui.pop_text_wrap_pos()
            self._pages[self._shown].draw(ui)
        imgui.end_child()


def label(words: str) -> None:
    """Label of the next choice, in a column of its own."""
    imgui.align_text_to_frame_padding()
    imgui.text(words)
    imgui.same_line(LABEL_WIDTH)
    imgui.set_next_item_width(-1)


def draw_general(ui: UiState) -> None:
    """Colours, sizes, and where projects are kept."""
    preferences = ui.preferences
    label("Theme")
    for name, words in THEMES.items():
        if imgui.radio_button(words.capitalize(), preferences.theme == name):
            preferences.theme = name
            ui.redraw_within(0.0)
        ui.mark(f"preferences.theme.{name}")
        imgui.same_line(0, 18)
    imgui.new_line()
    scale = ui.scale
    label("Size of the interface")
    automatic = f"Automatic ({scale_text(scale.of_screen)})"
    if imgui.begin_combo("##scale", automatic if scale.chosen is None else scale_text(scale.chosen)):
        if imgui.selectable(automatic, scale.chosen is None)[0]:
            choose_scale(ui, None)
        for choice in CHOICES:
            if imgui.selectable(scale_text(choice), scale.chosen == choice)[0]:
                choose_scale(ui, choice)
            ui.mark(f"preferences.scale.{scale_text(choice)}")
        imgui.end_combo()
    ui.mark("preferences.scale")
    imgui.spacing()
    label("Folder of projects")
    flags = imgui.InputTextFlags_.elide_left
    usual = str(projects_dir())
    is_edited, typed = imgui.input_text_with_hint("##projects", usual, preferences.projects_dir, flags)
    if is_edited:
        preferences.projects_dir = typed
    ui.mark("preferences.projects")
    imgui.set_cursor_pos_x(LABEL_WIDTH)
    text_wrapped_dim(projects_words(preferences.projects_dir))
    imgui.spacing()
    label("Compute with")
    choices = {AUTO: "the best available"} | {name: entry.words for name, entry in BACKENDS.items()}
    if imgui.begin_combo("##backend", choices.get(preferences.backend, preferences.backend)):
        for name, words in choices.items():
            if imgui.selectable(f"{words}##{name}", preferences.backend == name)[0]:
                preferences.backend = name
            ui.mark(f"preferences.backend.{name}")
        imgui.end_combo()
    ui.mark("preferences.backend")
    imgui.set_cursor_pos_x(LABEL_WIDTH)
    text_wrapped_dim("Takes effect at the next start.")
    imgui.spacing()
    label("Clips trained at once")
    is_changed, n = imgui.input_int("##workers", preferences.n_workers, 1, 4)
    ui.mark("preferences.workers")
    if is_changed:
        preferences.n_workers = min(max(n, 1), MAX_WORKERS)
    imgui.set_cursor_pos_x(LABEL_WIDTH)
    text_wrapped_dim("On this computer, as far as its cores and memory allow.")


def projects_words(chosen: str) -> str:
    """Where projects go that are made from now on."""
    named = os.environ.get(VARIABLE, "").strip()
    above = f" Set by {VARIABLE}." if named else ""
    folder = str(projects_dir(chosen))
    where = "here" if folder == (chosen or str(projects_dir())) else f"to {folder}"
    return f"New projects go {where}.{above} Existing projects stay where they are."


def draw_navigation(ui: UiState) -> None:
    """Mouse functions over a picture, and how the view gets to another place."""
    navigation = ui.navigation
    label("Mouse and keys")
    if imgui.begin_combo("##preset", navigation.preset.label):
        for preset in PRESETS.values():
            if imgui.selectable(preset.label, preset.name == navigation.preset.name)[0]:
                navigation.preset_name = preset.name
            ui.mark(f"preferences.preset.{preset.name}")
        imgui.end_combo()
    ui.mark("preferences.preset")
    for gesture, words in mouse_help(navigation.preset):
        imgui.set_cursor_pos_x(LABEL_WIDTH)
        imgui.text(gesture)
        imgui.same_line(LABEL_WIDTH + GESTURE_WIDTH)
        text_wrapped_dim(words)
    imgui.spacing()
    label("Motion")
    navigation.is_motion_reduced = imgui.checkbox("Reduce motion", navigation.is_motion_reduced)[1]
    ui.mark("preferences.motion")
    imgui.set_cursor_pos_x(LABEL_WIDTH)
    text_wrapped_dim("The view jumps to its new place instead of gliding there.")


def draw_memory(ui: UiState) -> None:
    """How much memory decoded frames may take."""
    preferences = ui.preferences
    label("Decoded frames")
    is_usual = imgui.checkbox("Default", preferences.cache_mb is None)[1]
    ui.mark("preferences.cache_usual")
    if is_usual:
        preferences.cache_mb = None
    else:
        label("At most, MB")
        shown = USUAL_CACHE_MB if preferences.cache_mb is None else preferences.cache_mb
        flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
        is_changed, typed = imgui.input_int("##cache", shown, 128, 1024, flags)
        ui.mark("preferences.cache")
        preferences.cache_mb = min(max(typed if is_changed else shown, CACHE_MB[0]), CACHE_MB[1])
    imgui.set_cursor_pos_x(LABEL_WIDTH)
    text_wrapped_dim("Decoded frames are shown again at once; more memory holds more of them.")
