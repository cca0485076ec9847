"""The matrix of frames and cameras: one cell per picture, on a range that never changes. A click goes there."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.playback.modes.color_maps import mapped
from app.status import CELL_RANGES, LOW_IS_BAD, ResidualStatus
from engine.camera.rig import CameraRig
from engine.capture.clip import Clip
from ui.gl import ImageTexture
from ui.panels.pieces.widgets import elided
from ui.panels.state import Rect, UiState
from ui.panels.timeline.rows.stage import SMALL_TEXT, small_text
from ui.style import theme

NAME_WIDTH = 74.0
"""For the cameras' names, units."""
ROW_HEIGHTS = (3.0, 16.0)
"""Least and most of a row, units."""
HEIGHT = 250.0
"""Of the matrix where there are many cameras, units."""
NAME_HEIGHT = 12.0
"""A name takes as much, units; where rows are lower, some are left out."""
NOTHING = (0.17, 0.19, 0.23)
"""Of a cell that is not measured."""


def cell_colors(values: np.ndarray, column: str) -> np.ndarray:
    """Colours of cells, bright where it is bad. [...] to [..., 3] uint8"""
    low, high = CELL_RANGES[column]
    if column in LOW_IS_BAD:
        return mapped(-values, "inferno", -high, -low, nothing=NOTHING)
    return mapped(values, "inferno", low, high, nothing=NOTHING)


def matrix_picture(cells: np.ndarray, column: str, width: int, height: int) -> np.ndarray:
    """The matrix at a size in pixels; ImGui blends between the pixels of a texture, so each of the screen is its own.

    Args:
        cells: [n_frames, n_cameras]
    Returns:
        One row of pixels or more per camera, frames from left to right; where several frames share a column, the worst
        of them. [height, width, 3] uint8
    """
    n = frames_per_column(len(cells), width)
    worst = worst_of(cells, n, is_higher_better=column in LOW_IS_BAD)
    colors = cell_colors(worst.T, column)
    return np.ascontiguousarray(
        colors[pixel_cells(colors.shape[0], height)][:, np.minimum(pixel_cells(len(cells), width) // n, len(worst) - 1)]
    )


class Matrix:
    """Owns the texture of the cells. GL thread only."""

    def __init__(self, make_texture: Callable[[], ImageTexture]) -> None:
        self._image = make_texture()

    def release(self) -> None:
        """Free the texture."""
        self._image.release()

    def draw(
        self,
        status: ResidualStatus,
        column: str,
        rig: CameraRig,
        clips: Sequence[Clip],
        at: tuple[int, int | None],
        ui: UiState,
    ) -> tuple[tuple[int, int] | None, tuple[int, int] | None]:
        """Draw it over the width there is.

        Args:
            column: One of app.status.CELL_COLUMNS.
            at: Frame of the playhead and camera looked through.
        Returns:
            Frame and camera of the cell under the pointer, and of the one that is pressed; None for neither.
        """
        cells = status.cells[column]
        n_frames, n_cameras = cells.shape
        row_height = float(np.clip(HEIGHT / max(n_cameras, 1), *ROW_HEIGHTS))
        origin, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
        area = Rect(origin.x + NAME_WIDTH, origin.y, origin.x + max(room, NAME_WIDTH + 40), origin.y)
        area = Rect(area.x0, area.y0, area.x1, area.y0 + row_height * n_cameras)
        imgui.invisible_button("matrix", ImVec2(area.x1 - origin.x, area.height))
        ui.mark_rect("residuals.matrix", area)
        pointer = imgui.get_io().mouse_pos
        shares = ((pointer.x - area.x0) / area.width, (pointer.y - area.y0) / area.height)
        hovered = cell_at(*shares, n_frames, n_cameras) if imgui.is_item_hovered() else None
        pressed = cell_at(*shares, n_frames, n_cameras) if imgui.is_item_active() else None
        density = imgui.get_io().display_framebuffer_scale.x
        size = (max(round(area.width * density), 1), max(round(area.height * density), 1))
        key = (status.revision, column, size, n_frames, n_cameras)
        if key != self._image.key and n_frames and n_cameras:
            self._image.set(matrix_picture(cells, column, *size), key=key)
        draw = imgui.get_window_draw_list()
        if not self._image.is_empty:
            draw.add_image(imgui.ImTextureRef(self._image.texture.glo), area.low, area.high)
        self._draw_clips(draw, area, clips, n_frames)
        _draw_names(draw, Rect(origin.x, area.y0, area.x0, area.y1), rig, status.is_held_out, row_height, at[1])
        _draw_playhead(draw, area, at, n_frames, row_height)
        return hovered, pressed

    def _draw_clips(self, draw: imgui.ImDrawList, area: Rect, clips: Sequence[Clip], n_frames: int) -> None:
        """Lines between clips, as long as there is room between them."""
        if len(clips) > area.width / 6:
            return
        line = theme.u32(theme.faded(theme.ON_PICTURE.playhead, 0.35))
        for clip in clips[1:]:
            draw.add_line_v(area.x0 + area.width * clip.start / max(n_frames, 1), area.y0, area.y1, line, 1)


def named_rows(n_rows: int, row_height: float, shown: int | None) -> set[int]:
    """Rows whose names do not lie over each other: every one, or every n-th; in any case that of the camera shown."""
    step = max(int(np.ceil(NAME_HEIGHT / row_height)), 1)
    named = range(0, n_rows, step)
    if shown is None:
        return set(named)
    return {row for row in named if abs(row - shown) >= step} | {shown}


def _draw_names(
    draw: imgui.ImDrawList,
    area: Rect,
    rig: CameraRig,
    is_held_out: Sequence[bool],
    row_height: float,
    shown: int | None,
) -> None:
    """As many names as there is room for; a bar of their colour next to held-out cameras in any case."""
    named = named_rows(len(rig.names), row_height, shown)
    for index, name in enumerate(rig.names):
        y = area.y0 + index * row_height
        color = theme.HELD_OUT if is_held_out[index] else theme.TEXT if index == shown else theme.TEXT_DIM
        if is_held_out[index]:
            draw.add_rect_filled(ImVec2(area.x1 - 5, y), ImVec2(area.x1 - 2, y + row_height), theme.u32(color))
        if index in named:
            small_text(draw, area.x0, y + (row_height - SMALL_TEXT) / 2, elided(name, area.width - 12), color)


def _draw_playhead(
    draw: imgui.ImDrawList, area: Rect, at: tuple[int, int | None], n_frames: int, row_height: float
) -> None:
    frame_index, camera_index = at
    x0 = area.x0 + area.width * frame_index / max(n_frames, 1)
    x1 = max(area.x0 + area.width * (frame_index + 1) / max(n_frames, 1), x0 + 2)
    draw.add_rect(ImVec2(x0, area.y0), ImVec2(x1, area.y1), theme.u32(theme.ON_PICTURE.playhead))
    if camera_index is not None:
        y = area.y0 + camera_index * row_height
        draw.add_rect(ImVec2(area.x0, y), ImVec2(area.x1, y + row_height), theme.u32(theme.ON_PICTURE.sky))


def pixel_cells(n_cells: int, n_pixels: int) -> np.ndarray:
    """Which cell each pixel of a side shows, where there are at least as many pixels as cells. [n_pixels] int64"""
    return np.arange(n_pixels, dtype=np.int64) * n_cells // max(n_pixels, 1)


def frames_per_column(n_frames: int, n_pixels: int) -> int:
    """Frames that share a column of pixels; 1 where there is room for all."""
    return max(1, -(-n_frames // max(n_pixels, 1)))


def worst_of(cells: np.ndarray, n: int, *, is_higher_better: bool) -> np.ndarray:
    """The worst of every n frames: what stands out must not vanish where there is no room for all of them.

    Args:
        cells: NaN where not measured. [n_frames, n_cameras]
    Returns:
        [ceil(n_frames / n), n_cameras] float32
    """
    if n == 1:
        return cells
    n_groups = -(-len(cells) // n)
    padded = np.full((n_groups * n, cells.shape[1]), np.nan, np.float32)
    padded[: len(cells)] = cells
    groups = padded.reshape(n_groups, n, cells.shape[1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a group without any figure has none
        return np.nanmin(groups, axis=1) if is_higher_better else np.nanmax(groups, axis=1)


def cell_at(x_share: float, y_share: float, n_frames: int, n_cameras: int) -> tuple[int, int] | None:
    """Frame and camera under a place given as shares of width and height; None outside."""
    if not (0.0 <= x_share < 1.0 and 0.0 <= y_share < 1.0) or n_frames < 1 or n_cameras < 1:
        return None
    return int(x_share * n_frames), int(y_share * n_cameras)
