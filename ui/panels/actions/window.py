"""Actions on the window itself."""

from __future__ import annotations

from typing import Any, Literal

from app.session.captures.capture_commands import SynchroniseCameras
from app.session.files.file_commands import AskSaveAs, ShowProjectFolder
from app.session.projects.project_commands import AskStartOver, NewProject
from app.session.session_view import SessionView
from engine.assets import asset_path
from ui.panels.actions.action import WINDOW, Action, Run
from ui.panels.state import EDIT_SECTIONS, LAYOUT_WORDS, LAYOUTS, PANELS, Dispatch, UiState
from ui.style.palette import THEMES
from ui.style.ui_scale import next_choice

DOCUMENTS = asset_path().parent / "docs"
"""In an installation without them, that is said where they are asked for."""


def choose_scale(ui: UiState, scale: float | None) -> None:
    """Draw the interface at another size from the next frame on; None follows the screen."""
    ui.scale.chosen = scale
    ui.redraw_within(0.0)


def _scale_by(step: int) -> Run:
    def change(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        choose_scale(ui, next_choice(ui.scale.wanted, step))

    return change


def _reset_scale(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    choose_scale(ui, None)


def _menu(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_menu_wanted = True


def _help(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_help_open = not ui.is_help_open


def _documents(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(ShowProjectFolder(DOCUMENTS))


def _about(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.wishes.is_about = True


def _open(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_open_requested = True


def _open_read_only(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.wishes.is_read_only = True


def _new_project(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(NewProject())


def _start_over(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(AskStartOver())


def _save_as(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(AskSaveAs())


def _calibrate(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.wishes.is_calibration = True


def _synchronise(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(SynchroniseCameras())


def _palette(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.wishes.is_palette = True


def _preferences(page: str = "") -> Run:
    def show(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.wishes.preferences_page = page

    return show


def _fullscreen(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.wishes.is_fullscreen = True


def _picture_only(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_picture_only = not ui.is_picture_only


def _layout(name: str) -> Run:
    def show(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.wishes.layout = name

    return show


def _save_layout(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.wishes.is_layout_name = True


def _step_panel(step: int) -> Run:
    def go(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.wishes.panel_step = step

    return go


def _show_panel(title: str) -> Run:
    def show(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.is_picture_only = False
        ui.wanted_panel = title

    return show


def _close_drawer(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.open_drawer.clear()
    ui.redraw_within(0.0)


def _show_section(name: str) -> Run:
    def show(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.is_picture_only = False
        ui.show_edit(name)

    return show


def _theme(name: Literal["dark", "light", "system"]) -> Run:
    def take(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.preferences.theme = name
        ui.redraw_within(0.0)

    return take


def _quit(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.quit_requested = True


_ALWAYS: dict[str, Any] = {"needs_capture": False}

_FILE: dict[str, Any] = _ALWAYS | {"menu": "File"}
_HELP: dict[str, Any] = _ALWAYS | {"menu": "Help"}
_PANELS: dict[str, Any] = _ALWAYS | {"menu": "Window/Panels"}
_LAYOUTS: dict[str, Any] = _ALWAYS | {"menu": "Window/Layouts"}
_THEMES: dict[str, Any] = _ALWAYS | {"menu": "View/Theme"}

ACTIONS = (
    Action("window.open", "Open a capture or project folder", WINDOW, _open, keys=("Ctrl+O",), **_FILE),
    Action("window.open_read_only", "Open a project read-only ...", WINDOW, _open_read_only, **_FILE),
    Action("window.new_project", "New project from this capture ...", WINDOW, _new_project, menu="File"),
    Action("window.start_over", "Start over with other settings ...", WINDOW, _start_over, menu="File"),
    Action("window.save_as", "Save the project as ...", WINDOW, _save_as, keys=("Ctrl+Shift+S",), menu="File"),
    Action("window.calibrate", "Calibrate plain videos ...", WINDOW, _calibrate, **_FILE),
    Action("window.synchronise", "Synchronise cameras ...", WINDOW, _synchronise, menu="File"),
    Action("window.palette", "Find an action by its name", WINDOW, _palette, keys=("Ctrl+K", "Ctrl+P"), **_HELP),
    Action("window.preferences", "Preferences", WINDOW, _preferences(), keys=("Ctrl+,",), **_FILE),
    Action("window.keys", "Change keys", WINDOW, _preferences("Keys"), **_FILE),
    Action("window.larger", "Larger interface", WINDOW, _scale_by(1), keys=("Ctrl++",), **_ALWAYS),
    Action("window.smaller", "Smaller interface", WINDOW, _scale_by(-1), keys=("Ctrl+-",), **_ALWAYS),
    Action("window.own_scale", "Reset the interface size", WINDOW, _reset_scale, keys=("Ctrl+0",), **_ALWAYS),
    Action("window.next_panel", "Focus the next panel", WINDOW, _step_panel(1), keys=("F6",), **_ALWAYS),
    Action(
        "window.previous_panel",
        "Focus the previous panel",
        WINDOW,
        _step_panel(-1),
        keys=("Shift+F6",),
        **_ALWAYS,
    ),
    *(
        Action(
            f"window.panel.{title.lower().replace(' ', '_')}",
            f"Show the panel {title}",
            WINDOW,
            _show_panel(title),
            **_PANELS,
        )
        for title in PANELS
    ),
    *(
        Action(f"window.panel.{name}", f"Show in the panel Edit: {title}", WINDOW, _show_section(name), **_PANELS)
        for name, title in EDIT_SECTIONS.items()
    ),
    Action(
        "window.close_drawer",
        "Close Log, Capture doctor, Exports and History",
        WINDOW,
        _close_drawer,
        keys=("Ctrl+W",),
        **_PANELS,
    ),
    Action(
        "window.picture_only",
        "Picture only, without panels",
        WINDOW,
        _picture_only,
        keys=("Ctrl+Shift+F",),
        **_ALWAYS,
    ),
    Action("window.fullscreen", "Fill the screen", WINDOW, _fullscreen, keys=("F11",), **_ALWAYS),
    *(
        Action(
            f"window.layout.{name.lower().replace(' ', '_')}",
            f"Layout: {LAYOUT_WORDS[name]}",
            WINDOW,
            _layout(name),
            **_LAYOUTS,
        )
        for name in LAYOUTS
    ),
    Action("window.save_layout", "Save the layout ...", WINDOW, _save_layout, **_LAYOUTS),
    *(
        Action(f"window.theme.{name}", f"Theme: {words}", WINDOW, _theme(name), **_THEMES)
        for name, words in THEMES.items()
    ),
    Action("window.menu", "Menus (also Alt); arrow keys work in them", WINDOW, _menu, keys=("F10",), **_ALWAYS),
    Action("window.help", "Keys and mouse", WINDOW, _help, keys=("F1",), **_HELP),
    Action("window.documents", "Show the folder with the documents", WINDOW, _documents, **_HELP),
    Action("window.about", "About ClipGStream Studio", WINDOW, _about, **_HELP),
    Action("window.quit", "Quit; training progress is kept", WINDOW, _quit, keys=("Ctrl+Q",), **_FILE),
)
