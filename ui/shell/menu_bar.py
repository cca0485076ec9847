"""The menu bar. Entries that have a key come from the table of actions, so that both say the same."""

from __future__ import annotations

from typing import Protocol

from imgui_bundle import imgui

from app.session.commands import ForgetRecent, OpenCapture
from app.status import ProjectStatus
from ui.panels.actions.action import BOOKMARKS, COMPARE, MARK, NAVIGATE, PLAY, TIME, TRAIN, VIEW, ActionNeeds
from ui.panels.actions.table import ACTIONS
from ui.panels.actions.training import train_or_pause
from ui.panels.actions.window import choose_scale
from ui.panels.state import PANELS, Dispatch, UiState
from ui.panels.training import TrainingNeeds, next_label
from ui.panels.welcome import SAMPLE_PATH, WelcomeNeeds, open_recent
from ui.panels.widgets import elided_path
from ui.style.theme import Icon
from ui.style.ui_scale import CHOICES, scale_text

FIRST_MENU = "File"
MIN_PATH_WIDTH = 60.0
"""Less of a path says nothing."""


class MenuNeeds(ActionNeeds, TrainingNeeds, WelcomeNeeds, Protocol):
    """What the menus read."""

    @property
    def project_status(self) -> ProjectStatus | None: ...


def draw_menu_bar(session: MenuNeeds, dispatch: Dispatch, ui: UiState) -> None:
    """All menus, and the name of what is open at the right end."""
    if not imgui.begin_main_menu_bar():
        return
    if ui.is_menu_wanted:
        ui.is_menu_wanted = False
        bar = imgui.internal.get_current_window()
        imgui.internal.set_focus_id(bar.get_id(FIRST_MENU), bar)  # from there the arrow keys go to the other menus
        imgui.open_popup(FIRST_MENU)
    has_capture = session.capture is not None
    if _begin_menu(FIRST_MENU, ui):
        if _item(ui, f"{Icon.FOLDER}  Open a capture or project folder", "Ctrl+O"):
            ui.is_open_requested = True
        _draw_recent_menu(session, dispatch, ui)
        if SAMPLE_PATH.is_dir() and _item(ui, f"{Icon.FILM}  Open the sample capture"):
            dispatch(OpenCapture(SAMPLE_PATH))
        imgui.separator()
        if _item(ui, "Quit", "Ctrl+Q"):
            ui.quit_requested = True
        imgui.end_menu()
    if _begin_menu("View", ui):
        imgui.begin_disabled(not has_capture)
        _draw_rows((VIEW,), session, dispatch, ui)
        for group in (NAVIGATE, BOOKMARKS):
            if imgui.begin_menu(group):
                _draw_rows((group,), session, dispatch, ui)
                imgui.end_menu()
            else:
                ui.mark(f"menu.{group}")
        imgui.end_disabled()
        imgui.separator()
        _draw_scale_menu(ui)
        imgui.end_menu()
    for title, group in (("Show", COMPARE), ("Time", TIME), ("Play", PLAY)):
        if _begin_menu(title, ui, is_enabled=has_capture):
            _draw_rows((group,), session, dispatch, ui)
            imgui.end_menu()
    if _begin_menu("Train", ui, is_enabled=has_capture):
        is_going = session.training.state in ("starting", "preparing", "running")
        label = f"{Icon.PAUSE}  Pause" if is_going else next_label(session)
        if session.training.state == "paused":
            label = f"{Icon.PLAY}  Resume"
        if _item(ui, label, "T"):
            train_or_pause(session, dispatch)
        _draw_rows((TRAIN,), session, dispatch, ui, without=("train.next", "train.quality"))
        imgui.end_menu()
    if _begin_menu("Mark", ui, is_enabled=has_capture):
        _draw_rows((MARK,), session, dispatch, ui)
        imgui.end_menu()
    if _begin_menu("Window", ui):
        _draw_window_menu(ui)
        imgui.end_menu()
    _draw_name(session, ui)
    imgui.end_main_menu_bar()


def _begin_menu(title: str, ui: UiState, *, is_enabled: bool = True) -> bool:
    menu_id = imgui.internal.get_current_window().get_id(title)
    if is_enabled and imgui.get_current_context().nav_just_moved_to_id == menu_id:
        imgui.open_popup(title)  # an arrow key went on to this menu: it opens as under the pointer
    is_open = imgui.begin_menu(title, is_enabled)
    if not is_open:
        ui.mark(f"menu.{title}")
    return is_open


def _item(ui: UiState, label: str, key_label: str = "", *, is_on: bool = False) -> bool:
    is_chosen = imgui.menu_item(label, key_label, is_on, True)[0]
    ui.mark(f"menu.{label.rpartition('  ')[2]}")
    return is_chosen


def _draw_rows(
    groups: tuple[str, ...],
    session: MenuNeeds,
    dispatch: Dispatch,
    ui: UiState,
    *,
    without: tuple[str, ...] = (),
) -> None:
    """Rows of the table of actions. without: Ids of those that stand elsewhere."""
    for action in ACTIONS:
        if action.group not in groups or action.id in without:
            continue
        if action.needs_choosing and not ui.regions.is_active:
            continue
        is_on = action.is_on is not None and session.capture is not None and action.is_on(session)
        if _item(ui, action.text, action.key_label, is_on=is_on):
            action.run(session, dispatch, ui)


def _draw_scale_menu(ui: UiState) -> None:
    if not imgui.begin_menu("Size of the interface"):
        ui.mark("menu.scale")
        return
    scale = ui.scale
    if _item(ui, f"Automatic ({scale_text(scale.of_screen)})", "Ctrl+0", is_on=scale.chosen is None):
        choose_scale(ui, None)
    for choice in CHOICES:
        if _item(ui, scale_text(choice), is_on=scale.chosen == choice):
            choose_scale(ui, choice)
    imgui.separator()
    imgui.text_disabled("Ctrl + plus and Ctrl + minus change it, too")
    drawn = imgui.get_io().display_framebuffer_scale.x
    if drawn < scale.wanted - 1e-3:
        imgui.text_disabled(f"Drawn at {scale_text(drawn)}: the window has no room for more")
    imgui.end_menu()


def _draw_window_menu(ui: UiState) -> None:
    for title in PANELS:
        if _item(ui, title):
            ui.wanted_panel = title
    imgui.separator()
    if _item(ui, "Reset the layout"):
        ui.is_layout_reset_requested = True
    if _item(ui, f"{Icon.HELP}  Keys and mouse", "F1", is_on=ui.is_help_open):
        ui.is_help_open = not ui.is_help_open


def _draw_recent_menu(session: MenuNeeds, dispatch: Dispatch, ui: UiState) -> None:
    if not imgui.begin_menu("Open a recent project", bool(session.recent.entries)):
        ui.mark("menu.recent")
        return
    for index, entry in enumerate(session.recent.entries):
        is_gone = entry.folder in session.recent.missing
        words = "not found" if is_gone else entry.trained_text
        if imgui.menu_item(f"{entry.name}##{index}", words, False, not is_gone)[0]:
            dispatch(open_recent(entry))
        ui.mark(f"menu.recent{index}")
        imgui.set_item_tooltip(str(entry.folder))
    gone = [entry.folder for entry in session.recent.entries if entry.folder in session.recent.missing]
    if gone:
        imgui.separator()
        if _item(ui, "Remove those that were not found"):
            for folder in gone:
                dispatch(ForgetRecent(folder))
    imgui.end_menu()


def _draw_name(session: MenuNeeds, ui: UiState) -> None:
    """What is open: name, how far it is trained and where it lies, as much of it as there is room for."""
    opened = session.project_status
    name = "no project open" if opened is None else f"{opened.name} - {opened.trained_text}"
    room = imgui.get_window_width() - imgui.get_cursor_pos_x() - 40
    if opened is not None:
        path_room = room - imgui.calc_text_size(f"{name} - ").x
        if path_room > MIN_PATH_WIDTH:
            name = f"{name} - {elided_path(str(opened.folder), path_room)}"
    width = imgui.calc_text_size(name).x
    if width > room:
        return
    imgui.same_line(imgui.get_window_width() - width - 24)
    imgui.text_disabled(name)
    ui.mark("menu.project")
    if opened is not None:
        imgui.set_item_tooltip(str(opened.folder))
