"""Where the panels are: the layout to begin with, and the sizes below which no docked panel gets, whatever is dragged.

The picture in the middle gives way when the window changes its size; the panels around it keep theirs.
"""

from __future__ import annotations

from collections.abc import Mapping

from imgui_bundle import ImVec2, imgui

from ui.panels.state import (
    CAPTURE,
    DOCTOR,
    DRAWER,
    EDIT,
    EXPORTS,
    HISTORY,
    LAYOUTS,
    LOG,
    PATHS,
    RESIDUALS,
    TIMELINE,
    TRAINING,
    VIEWPORT,
)

SIDE, DRAWN = (236.0, 0.0), (0.0, 96.0)
SMALLEST = {
    CAPTURE: (176.0, 0.0),
    TRAINING: SIDE,
    EDIT: SIDE,
    RESIDUALS: SIDE,
    PATHS: (176.0, 0.0),
    LOG: DRAWN,
    DOCTOR: DRAWN,
    EXPORTS: DRAWN,
    HISTORY: DRAWN,
    TIMELINE: (0.0, 116.0),
}
"""Width and height of docked panels, units. The timeline has its buttons, ruler and bands at this height."""
SMALLEST_PICTURE = (336.0, 150.0)
TALL_TIMELINE = 0.4
"""Share of the height that the timeline has in the layout for long captures."""
WIDE_UNITS = 1240.0
"""In a window narrower than this the panels at the sides begin narrower."""


def lay_out(dock_id: int, name: str = LAYOUTS[0]) -> None:
    """Capture and camera path left, training, editing and residuals right, the timeline below, the picture in the rest;
    the drawer takes a part of the picture's room once it is opened.

    Args:
        name: One of LAYOUTS; others are laid out as the first.
    """
    internal = imgui.internal
    size = imgui.get_main_viewport().work_size
    is_wide = size.x >= WIDE_UNITS
    left_width, right_width = (236.0, 344.0) if is_wide else (206.0, 270.0)
    internal.dock_builder_remove_node(dock_id)
    internal.dock_builder_add_node(dock_id, internal.DockNodeFlagsPrivate_.dock_space)
    internal.dock_builder_set_node_size(dock_id, size)
    bottom_height, drawer_height = (220.0, 236.0) if size.y >= 700.0 else (152.0, 170.0)
    if name == "Long capture":
        bottom_height = max(bottom_height, size.y * TALL_TIMELINE)
    _, bottom, top = internal.dock_builder_split_node_py(dock_id, imgui.Dir.down, bottom_height / max(size.y, 1.0))
    _, left, rest = internal.dock_builder_split_node_py(top, imgui.Dir.left, left_width / max(size.x, 1.0))
    right_share = right_width / max(size.x - left_width, 1.0)
    _, right, middle = internal.dock_builder_split_node_py(rest, imgui.Dir.right, right_share)
    drawer_share = drawer_height / max(size.y - bottom_height, 1.0)
    _, drawer, middle = internal.dock_builder_split_node_py(middle, imgui.Dir.down, drawer_share)
    for title, node_id in (
        (VIEWPORT, middle),
        (PATHS, left),
        (CAPTURE, left),
        (TRAINING, right),
        (EDIT, right),
        (RESIDUALS, right),
        (TIMELINE, bottom),
        *((title, drawer) for title in DRAWER),
    ):
        internal.dock_builder_dock_window(title, node_id)
    node = internal.dock_builder_get_node(middle)  # it stays the central node: the one that gives way
    node.set_local_flags(node.local_flags | internal.DockNodeFlagsPrivate_.no_tab_bar)
    internal.dock_builder_finish(dock_id)


def is_laid_out(dock_id: int) -> bool:
    """Do panels lie in the window, as after a layout was read?"""
    node = imgui.internal.dock_builder_get_node(dock_id)
    return node is not None and node.is_split_node()


def hold_sizes(dock_ids: Mapping[str, int]) -> None:
    """Give panels back what was taken of them below their smallest size, and the picture what they have too much.

    Args:
        dock_ids: Of the nodes of docked panels, by title; from the frame that was just drawn.
    """
    internal = imgui.internal
    for title, smallest in SMALLEST.items():
        node = internal.dock_builder_get_node(dock_ids.get(title, 0))
        if node is not None and (node.size.x < smallest[0] - 0.5 or node.size.y < smallest[1] - 0.5):
            _resize(node, max(node.size.x, smallest[0]), max(node.size.y, smallest[1]))
    picture = internal.dock_builder_get_node(dock_ids.get(VIEWPORT, 0))
    if picture is None:
        return
    missing_x = SMALLEST_PICTURE[0] - picture.size.x
    missing_y = SMALLEST_PICTURE[1] - picture.size.y
    for title, (width, height) in SMALLEST.items():
        node = internal.dock_builder_get_node(dock_ids.get(title, 0))
        if node is None or node.id_ == picture.id_:
            continue
        if missing_x > 0.5 and width and node.size.x > width + 0.5:
            given = min(missing_x, node.size.x - width)
            missing_x -= given
            _resize(node, node.size.x - given, node.size.y)
        if missing_y > 0.5 and height and node.size.y > height + 0.5:
            given = min(missing_y, node.size.y - height)
            missing_y -= given
            _resize(node, node.size.x, node.size.y - given)


def _resize(node: imgui.internal.DockNode, width: float, height: float) -> None:
    imgui.internal.dock_builder_set_node_size(node.id_, ImVec2(width, height))
