"""Pictures and maps of several projects in rows and columns, as PNG files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.lab.figures import new_figure, plain_texts, png_of
from app.lab.report.charts import WIDTH_INCHES, add_color_bar, map_options, shortened
from app.playback.modes import hues

MAX_COLUMNS = 5
"""Maps side by side; more begin another row."""
_DPI = 150
_FADED = 0.35
"""Contrast of a picture that others are drawn over."""
_TIMES = 3
"""How many times a part of a picture is enlarged."""
_MAX_MIDDLES = 400
"""Dots that are tried as the middle of that part."""


@dataclass(frozen=True, slots=True)
class ChangeColumn:
    """R and E of one project. change_said, excess_said: their means. change, excess: [H, W] in 0..1."""

    title: str
    change_said: str
    excess_said: str
    change: np.ndarray
    excess: np.ndarray


def draw_change_maps(
    truth_change: np.ndarray,
    truth_said: str,
    truth: np.ndarray,
    columns: Sequence[ChangeColumn],
    value_range: tuple[float, float],
) -> bytes:
    """R above E for every project; before them G of the capture above its picture.

    Args:
        truth_change: G. [H, W] in 0..1
        truth_said: Its mean.
        truth: The later frame. [H, W, 3] uint8
        value_range: Ends of the colour range of all maps.
    """
    n_columns = min(len(columns) + 1, MAX_COLUMNS)
    n_bands = -(-(len(columns) + 1) // n_columns)
    height, width = truth_change.shape
    cell_inches = 0.88 * WIDTH_INCHES / n_columns
    with plain_texts():
        figure = new_figure(WIDTH_INCHES, 2 * n_bands * (cell_inches * height / width + 0.42), dpi=_DPI)
        grid = figure.subplots(2 * n_bands, n_columns, squeeze=False)
        for axes in grid.flat:
            axes.set_axis_off()
        options = map_options(value_range)
        shown = _show(grid[0, 0], truth_change, f"capture\nG {truth_said}", options)
        _show(grid[1, 0], truth, "captured picture", {})
        for i, column in enumerate(columns, start=1):
            band, place = divmod(i, n_columns)
            name = shortened(column.title)
            _show(grid[2 * band, place], column.change, f"{name}\nR {column.change_said}", options)
            _show(grid[2 * band + 1, place], column.excess, f"E {column.excess_said}", options)
        add_color_bar(figure, shown, grid.flat, "mean absolute difference, colours in 0..1")
        return png_of(figure)


def draw_picture_rows(titles: Sequence[str], rows: Sequence[tuple[str, Sequence[tuple[np.ndarray, str]]]]) -> bytes:
    """Pictures [H, W, 3] in rows, each with a text below it.

    Args:
        titles: Of the columns.
        rows: The label of each row, and a picture and its text for each column.
    """
    height, width = rows[0][1][0][0].shape[:2]
    with plain_texts():
        cell_inches = 0.96 * WIDTH_INCHES / len(titles)
        figure = new_figure(WIDTH_INCHES, len(rows) * (cell_inches * height / width + 0.2) + 0.2, dpi=_DPI)
        grid = figure.subplots(len(rows), len(titles), squeeze=False)
        for axes_row, (label, pictures) in zip(grid, rows, strict=True):
            axes_row[0].set_ylabel(label, fontsize=8)
            for axes, (picture, said) in zip(axes_row, pictures, strict=True):
                axes.imshow(as_8bit(picture), interpolation="nearest")
                axes.set_xticks([])
                axes.set_yticks([])
                axes.set_xlabel(said, fontsize=7.5, loc="left")
        for axes, title in zip(grid[0], titles, strict=True):
            axes.set_title(title, loc="left", fontsize=9)
        return png_of(figure)


def draw_spheres(
    truth: np.ndarray, centers: np.ndarray, radii: np.ndarray, *, outside: np.ndarray, inside: np.ndarray
) -> bytes:
    """Spheres as circles and anchors as dots over a faint picture, and again over the part with most of those outside.

    Args:
        truth: [H, W, 3] uint8
        centers, radii: Of the spheres, px. [S, 2], [S]
        outside, inside: Anchors, px. [P, 2] each
    """
    height, width = truth.shape[:2]
    grey = 255.0 - _FADED * (255.0 - truth.mean(-1))
    with plain_texts():
        cell_inches = 0.49 * WIDTH_INCHES
        figure = new_figure(WIDTH_INCHES, cell_inches * height / width + 0.3, dpi=_DPI)
        whole, part = figure.subplots(1, 2)
        dots = next((places for places in (outside, inside) if len(places)), centers)
        x, y, part_width, part_height = _most_of(dots, width, height)
        for axes, (left, top, across, down), size in (
            (whole, (0, 0, width, height), 1.0),
            (part, (x, y, part_width, part_height), 6.0),
        ):
            axes.imshow(grey, cmap="gray", vmin=0, vmax=255)
            _add_circles(axes, centers, radii, linewidth=0.08 * size)
            for places, color, share in (
                (centers, hues.SKY, 0.7),
                (inside, hues.GREEN, 1.0),
                (outside, hues.VERMILLION, 1.6),
            ):
                axes.scatter(places[:, 0], places[:, 1], s=share * size, color=[color], linewidths=0, zorder=3)
            axes.set(xlim=(left, left + across), ylim=(top + down, top), xticks=[], yticks=[])
        whole.set_title("whole picture", loc="left", fontsize=8)
        part.set_title(f"{_TIMES} times as large", loc="left", fontsize=8)
        return png_of(figure)


def _most_of(dots: np.ndarray, width: int, height: int) -> tuple[float, float, float, float]:
    """A third of the picture around one of its dots [P, 2], so that it holds most others: left, top, width, height."""
    size = np.array([width, height])
    shown = dots[((dots >= 0) & (dots < size)).all(1)]
    middles = shown[:: len(shown) // _MAX_MIDDLES + 1] if len(shown) else size[None] / 2
    corners = np.clip(middles - size / (2 * _TIMES), 0, size - size / _TIMES)
    counts = [int(((shown >= corner) & (shown < corner + size / _TIMES)).all(1).sum()) for corner in corners]
    left, top = corners[int(np.argmax(counts))]
    return float(left), float(top), width / _TIMES, height / _TIMES


def _add_circles(axes: Any, centers: np.ndarray, radii: np.ndarray, *, linewidth: float) -> None:
    from matplotlib.collections import EllipseCollection

    axes.add_collection(
        EllipseCollection(
            2 * radii,
            2 * radii,
            np.zeros(len(radii)),
            units="xy",
            offsets=centers,
            offset_transform=axes.transData,
            facecolors="none",
            edgecolors=hues.SKY,
            linewidths=linewidth,
        )
    )


def as_8bit(picture: np.ndarray) -> np.ndarray:
    """A picture for the screen: bytes as they are, colours in 0..1 rounded, NaN black. uint8"""
    if picture.dtype == np.uint8:
        return picture
    return np.rint(255.0 * np.clip(np.nan_to_num(picture), 0.0, 1.0)).astype(np.uint8)


def _show(axes: Any, picture: np.ndarray, title: str, options: dict[str, Any]) -> Any:
    axes.set_title(title, loc="left", fontsize=7.5)
    return axes.imshow(picture if picture.ndim == 3 else np.ma.masked_invalid(picture), **options)
