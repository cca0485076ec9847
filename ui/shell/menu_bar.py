"""The menu bar, made from the table of actions: the same words and keys as in the palette and the help sheet. What
depends on what is open, such as recent projects and kept layouts, is added here.
"""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from app.session.projects.project_commands import ForgetRecent, OpenCapture
from app.session.session_view import SessionView
from engine.text import one_line
from ui.panels.actions.action import Action
from ui.panels.actions.menus import Menu, menus
from ui.panels.actions.window import choose_scale
from ui.panels.pieces.widgets import elided_path
from ui.panels.state import Dispatch, UiState
from ui.panels.training.training import next_label
from ui.panels.welcome.recent_rows import open_recent
from ui.panels.welcome.welcome import SAMPLE_PATH
from ui.style.theme import Icon
from ui.style.ui_scale import CHOICES, scale_text

FIRST_MENU = "File"
MIN_PATH_WIDTH = 60.0
"""Less of a path says nothing."""
MENUS = menus()


def draw_menu_bar(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """All menus, and the name of what is open at the right end."""
    if not imgui.begin_main_menu_bar():
        return
    if ui.is_menu_wanted:
        ui.is_menu_wanted = False
        bar = imgui.internal.get_current_window()
        imgui.internal.set_focus_id(bar.get_id(FIRST_MENU), bar)  # from there the arrow keys go to the other menus
        imgui.open_popup(FIRST_MENU)
    for menu in MENUS:
        if _begin_menu(menu.title, ui):
            _draw_items(menu, session, dispatch, ui)
            imgui.end_menu()
    _draw_name(session, ui)
    imgui.end_main_menu_bar()


def _begin_menu(title: str, ui: UiState) -> bool:
    menu_id = imgui.internal.get_current_window().get_id(title)
    if imgui.get_current_context().nav_just_moved_to_id == menu_id:
        imgui.open_popup(title)  # an arrow key moved on to this menu: it opens as under the pointer
    is_open = imgui.begin_menu(title)
    if not is_open:
        ui.mark(f"menu.{title}")
    return is_open


def _draw_items(menu: Menu, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The actions of one menu, and the entries added after some of them."""
    for item in menu.items:
        match item:
            case None:
                imgui.separator()
            case Menu():
                if imgui.begin_menu(item.title):
                    _draw_items(item, session, dispatch, ui)
                    imgui.end_menu()
                else:
                    ui.mark(f"menu.{item.title}")
            case _:
                _draw_action(item, session, dispatch, ui)
                if item.id in _AFTER:
                    _AFTER[item.id](session, dispatch, ui)
    if menu.title == "View":
        imgui.separator()
        _draw_scale_menu(ui)


def _draw_action(action: Action, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if action.needs_choosing and not ui.regions.is_active:
        return  # they would be most of their menu, and almost always grey
    why_not = action.why_not(session, ui)
    is_on = not why_not and action.is_on is not None and action.is_on(session)
    label = _train_label(session) if action.id == "train.next" else action.text
    is_chosen = imgui.menu_item(label, ui.keys.label(action), is_on, not why_not)[0]
    ui.mark(f"menu.{label.rpartition('  ')[2]}")
    if why_not and imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
        imgui.set_tooltip(why_not)
    if is_chosen:
        action.run(session, dispatch, ui)


def _train_label(session: SessionView) -> str:
    """Label of the key for training at the moment."""
    if not session.training.is_going:
        return next_label(session)
    return f"{Icon.PLAY}  Resume" if session.training.is_paused else f"{Icon.PAUSE}  Pause"


def _item(ui: UiState, label: str, key_label: str = "", *, is_on: bool = False) -> bool:
    is_chosen = imgui.menu_item(label, key_label, is_on, True)[0]
    ui.mark(f"menu.{label.rpartition('  ')[2]}")
    return is_chosen


def _name_item(name: str, width: float, *, words: str = "", is_enabled: bool = True) -> bool:
    """A row of a menu that shows any name as it is. width: Of the widest name."""
    start = imgui.get_cursor_screen_pos()
    gap = imgui.calc_text_size(words).x + 24 if words else 0.0
    flags = imgui.SelectableFlags_.none if is_enabled else imgui.SelectableFlags_.disabled
    is_chosen = imgui.selectable("##name", False, flags, ImVec2(width + gap, 0))[0]
    draw = imgui.get_window_draw_list()
    dim = imgui.get_color_u32(imgui.Col_.text_disabled)
    draw.add_text(start, imgui.get_color_u32(imgui.Col_.text) if is_enabled else dim, one_line(name))
    if words:
        draw.add_text(ImVec2(start.x + width + 24, start.y), dim, words)
    return is_chosen


def _draw_scale_menu(ui: UiState) -> None:
    if not imgui.begin_menu("Size of the interface"):
        ui.mark("menu.scale")
        return
    scale = ui.scale
    if _item(ui, f"Automatic ({scale_text(scale.of_screen)})", is_on=scale.chosen is None):
        choose_scale(ui, None)
    for choice in CHOICES:
        if _item(ui, scale_text(choice), is_on=scale.chosen == choice):
            choose_scale(ui, choice)
    drawn = imgui.get_io().display_framebuffer_scale.x
    if drawn < scale.wanted - 1e-3:
        imgui.text_disabled(f"Drawn at {scale_text(drawn)}: the window is too small for more")
    imgui.end_menu()


def _draw_layouts(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Layouts that the user has kept: shown by a click, forgotten in a menu of their own."""
    names = list(ui.preferences.layouts)
    if not names:
        return
    width = max(imgui.calc_text_size(one_line(name)).x for name in names)
    for index, name in enumerate(names):
        imgui.push_id(index)
        if _name_item(name, width):
            ui.wishes.layout = name
        ui.mark(f"menu.layout{index}")
        imgui.pop_id()
    if imgui.begin_menu("Remove a layout"):
        for index, name in enumerate(names):
            imgui.push_id(index)
            if _name_item(name, width):
                ui.wishes.layout_removed = name
            ui.mark(f"menu.layout{index}.remove")
            imgui.pop_id()
        imgui.end_menu()
    else:
        ui.mark("menu.Remove a layout")


def _draw_recent_menu(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if imgui.begin_menu("Open a recent project", bool(session.recent.entries)):
        width = max(imgui.calc_text_size(one_line(entry.name)).x for entry in session.recent.entries)
        for index, entry in enumerate(session.recent.entries):
            is_gone = entry.folder in session.recent.missing
            imgui.push_id(index)
            words = "not found" if is_gone else entry.trained_text
            if _name_item(entry.name, width, words=words, is_enabled=not is_gone):
                dispatch(open_recent(entry))
            ui.mark(f"menu.recent{index}")
            imgui.set_item_tooltip(str(entry.folder))
            imgui.pop_id()
        gone = [entry.folder for entry in session.recent.entries if entry.folder in session.recent.missing]
        if gone:
            imgui.separator()
            if _item(ui, "Remove missing"):
                for folder in gone:
                    dispatch(ForgetRecent(folder))
        imgui.end_menu()
    else:
        ui.mark("menu.recent")
    if SAMPLE_PATH.is_dir() and _item(ui, f"{Icon.FILM}  Open the sample capture"):
        dispatch(OpenCapture(SAMPLE_PATH))


_AFTER: dict[str, Callable[[SessionView, Dispatch, UiState], None]] = {
    "window.open": _draw_recent_menu,
    "window.save_layout": _draw_layouts,
}
"""Text added behind an action, by its id."""


def _draw_name(session: SessionView, ui: UiState) -> None:
    """The open project: name, progress and folder, as far as there is room."""
    opened = session.project_status
    name = "no project open" if opened is None else f"{one_line(opened.name)} - {opened.trained_text}"
    room = imgui.get_window_width() - imgui.get_cursor_pos_x() - 40
    if opened is not None:
        path_room = room - imgui.calc_text_size(f"{name} - ").x
        if path_room > MIN_PATH_WIDTH:
            name = f"{name} - {elided_path(one_line(str(opened.folder)), path_room)}"
    width = imgui.calc_text_size(name).x
    if width > room:
        return
    imgui.same_line(imgui.get_window_width() - width - 24)
    imgui.text_disabled(name)
    ui.mark("menu.project")
    if opened is not None:
        imgui.set_item_tooltip(str(opened.folder))
