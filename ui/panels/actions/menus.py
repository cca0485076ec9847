"""Which menu each action stands in: the one that it names, else that of the first part of its id, else of its group.

A path such as "View/Theme" is a menu inside a menu. Actions of a group that is not listed here get a menu of that name,
so that none is left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ui.panels.actions.action import (
    BOOKMARKS,
    COMPARE,
    EDIT,
    MARK,
    MODE,
    NAVIGATE,
    PATH,
    PLAY,
    SELECT,
    TAKE,
    TIME,
    TRAIN,
    VIEW,
    WINDOW,
    Action,
)
from ui.panels.actions.table import ACTIONS

MOST_ITEMS = 24
"""As many fit into the smallest window."""
MENUS = ("File", "Edit", "View", "Time", "Train", "Select", "Mark", "Camera", "Window", "Help")
"""From left to right; others follow before the last."""
OTHERS = "others"
_ORDER: dict[str, tuple[str | None, ...]] = {
    "File": (
        *("window.open", "window.new_project", "window.open_read_only", None),
        *("window.save_as", "window.start_over", OTHERS, None),
        *("export.ask", None, "window.calibrate", "window.synchronise", "doctor.examine", None),
        *("window.preferences", "window.keys", None, "window.quit"),
    ),
    "Edit": ("mark.undo", "mark.redo", None, OTHERS),
    "Train": ("train.next", "train.all", "train.from_here", "train.settings", "train.stop", None, OTHERS),
    "Help": ("window.help", "window.palette", None, OTHERS, None, "window.about"),
}
"""Entries that people look for first, by the title of its menu: ids of actions, lines, and where the rest stands."""
_MENU_OF_GROUP = {
    TIME: "Time",
    VIEW: "View",
    COMPARE: "View",
    SELECT: "Select",
    EDIT: "Edit",
    MARK: "Mark",
    PATH: "Camera",
    TRAIN: "Train",
    WINDOW: "Window",
}
_MENU_OF_GROUP |= {
    NAVIGATE: "View/Navigate",
    BOOKMARKS: "View/Bookmarks",
    MODE: "View/Mode",
    PLAY: "Time/Play",
    TAKE: "Time/Take",
}
_MENU_OF_TOPIC = {
    "clips": "Train/Clips",
    "compare": "View/Compare",
    "content": "View/Draw only",
    "copies": "Edit/Copies",
    "heat": "View/Residuals",
    "mend": "Train/Mend",
    "live": "Train/Live view",
    "mode": "View/Mode",
    "objects": "Edit/Objects",
    "navigation": "View/Navigate/Mouse",
    "play": "Time/Play",
    "queue": "Train/Queue",
    "show": "View/Show",
    "timeline": "Time/Timeline",
}
"""By the beginning of an id, up to the first dot."""


@dataclass
class Menu:
    """One menu.

    Attributes:
        items: Actions, menus inside this one, and None for a line between groups.
    """

    title: str
    items: list[Action | Menu | None] = field(default_factory=list)

    def inside(self, title: str) -> Menu:
        """The menu of this title in this one; made where it is not there yet."""
        for item in self.items:
            if isinstance(item, Menu) and item.title == title:
                return item
        made = Menu(title)
        self.items.append(made)
        return made


def menu_path(action: Action) -> str:
    """Titles of the menus in which an action stands, joined by slashes."""
    topic = action.id.partition(".")[0]
    return action.menu or _MENU_OF_TOPIC.get(topic) or _MENU_OF_GROUP.get(action.group, action.group)


def menus(actions: tuple[Action, ...] = ACTIONS) -> list[Menu]:
    """All menus with every action in exactly one of them."""
    top = {title: Menu(title) for title in MENUS}
    groups: dict[str, str] = {}
    for action in actions:
        path = menu_path(action).split("/")
        menu = top.setdefault(path[0], Menu(path[0]))
        for title in path[1:]:
            menu = menu.inside(title)
        where = "/".join(path)
        if groups.setdefault(where, action.group) != action.group:
            menu.items.append(None)
            groups[where] = action.group
        menu.items.append(action)
    for title, order in _ORDER.items():
        top[title].items = _ordered(top[title].items, order)
    last = top.pop(MENUS[-1])
    return [menu for menu in (*top.values(), last) if menu.items]


def _ordered(items: list[Action | Menu | None], order: tuple[str | None, ...]) -> list[Action | Menu | None]:
    """The same items as an order of `_ORDER` has them; without lines at the ends or one after the other."""
    named = {item.id: item for item in items if isinstance(item, Action) and item.id in order}
    others = [item for item in items if not (isinstance(item, Action) and item.id in named)]
    placed: list[Action | Menu | None] = []
    for name in order:
        placed += others if name == OTHERS else [named[name]] if name in named else [None] if name is None else []
    lined = [item for item, before in zip(placed, [None, *placed], strict=False) if not (item is None is before)]
    return lined[:-1] if lined and lined[-1] is None else lined
