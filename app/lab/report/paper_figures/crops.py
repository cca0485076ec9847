"""The section with the same windows cut out of the capture and of every project."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from app.lab.report.page.parts import Figure, Section
from app.lab.report.page.tables import Table, TableColumn
from app.lab.report.paper_figures.by_hand import InsetWindow, Places
from app.lab.report.paper_figures.crop_sheet import Tile, draw_crops
from app.lab.report.paper_figures.drawing import as_8bit
from app.lab.report.paper_figures.pictured import Pictured, of_main_group, trained_on
from engine.images.psnr import psnr

N_PLACES = 3
"""Windows that are chosen by the rule."""
WINDOW_SHARE = 0.25
"""Side of such a window, of the shorter side of its picture."""
RULE = (
    f"Pictures are those in which the PSNR of the projects differs most, at most {N_PLACES} and as far as possible of "
    "different clips; in each the window is the one in which the renders differ most: the standard deviation over the "
    "projects, mean over the window and the channels."
)


def crops_section(projects: Sequence[Pictured], places: Places, left_out: Sequence[str]) -> Section:
    """Windows chosen by hand, or by RULE where none are and there are two projects to distinguish.

    Args:
        projects: The page's own first.
        left_out: Sentences on projects that are in no picture.
    """
    parts: list[Any] = []
    rows: list[dict[str, Any]] = []
    windows = list(places.windows)
    pictures = [(window.camera, window.frame_index) for window in windows]
    if not windows:
        parts.append(RULE)
        pictures = pictures_that_differ(projects)
    for number, (camera, frame) in enumerate(pictures, start=1):
        shown, missing = trained_on(projects, [frame])
        pairs = [_pair(one, frame, camera) for one in shown]
        renders = [render for _, render in pairs]
        window = windows[number - 1] if windows else window_that_differs(renders, camera, frame)
        truth = pairs[0][0]
        found = [(one.name, _psnr(truth, render, window)) for one, render in zip(shown, renders, strict=True)]
        rows += [{"place": number, **_place(window), "project": name, "psnr": value} for name, value in found]
        parts += [_figure(number, window, truth, renders, found, is_by_hand=bool(windows)), *missing]
    if rows:
        columns = (
            TableColumn("place", "Place"),
            TableColumn("camera", "Camera"),
            TableColumn("frame_index", "Frame"),
            TableColumn("window", "Window x, y, width, height"),
            TableColumn("project", "Project"),
            TableColumn("psnr", "PSNR of the window", 2, unit="dB"),
        )
        parts.append(Table("crops", "PSNR of the windows, raw colours", columns, rows))
    return Section("crops", "The same places in every project", [*parts, *left_out])


def pictures_that_differ(projects: Sequence[Pictured]) -> list[tuple[str, int]]:
    """Camera and frame of pictures in which the PSNR of the projects is spread widest, the widest first."""
    first = projects[0]
    tables = [
        {(row["camera"], row["frame_index"]): row["psnr"] for row in one.compared.evaluation["rows"]}
        for one in projects
    ]
    spreads: list[tuple[float, str, int]] = []
    for row in of_main_group(first.compared, first.compared.evaluation["rows"]):
        place = row["camera"], row["frame_index"]
        values = [value for table in tables if (value := table.get(place)) is not None]
        if len(values) > 1:
            spreads.append((max(values) - min(values), *place))
    spreads.sort(key=lambda spread: -spread[0])
    chosen: list[tuple[str, int]] = []
    for is_same_clip_allowed in (False, True):  # neighbouring frames of one camera look the same: never both
        for _, camera, frame in spreads:
            seen = {(_clip_index(first, f), c) for c, f in chosen}
            clip = _clip_index(first, frame)
            is_new = (clip, camera) not in seen and (is_same_clip_allowed or clip not in {c for c, _ in seen})
            if is_new and len(chosen) < N_PLACES:
                chosen.append((camera, frame))
    return chosen


def window_that_differs(renders: Sequence[np.ndarray], camera: str, frame: int) -> InsetWindow:
    """The square window in which pictures [H, W, 3] of one place differ most; the upper left one of several."""
    stacked = np.stack([np.clip(np.nan_to_num(render), 0.0, 1.0) for render in renders])
    difference = stacked.std(0, dtype=np.float64).mean(2)
    side = max(round(WINDOW_SHARE * min(difference.shape)), 1)
    sums = np.pad(difference, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    means = (sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]) / side**2
    y, x = divmod(int(np.round(means, 12).argmax()), means.shape[1])
    return InsetWindow(camera, frame, x, y, side, side)


def _clip_index(project: Pictured, frame: int) -> int:
    clip = project.clip_at(frame)
    assert clip is not None
    return clip.clip_index


def _pair(project: Pictured, frame: int, camera: str) -> tuple[np.ndarray, np.ndarray]:
    return project.pictures.pair(_clip_index(project, frame), frame, camera)


def _cut(picture: np.ndarray, window: InsetWindow) -> np.ndarray:
    return picture[window.y : window.y + window.height, window.x : window.x + window.width]


def _psnr(truth: np.ndarray, render: np.ndarray, window: InsetWindow) -> float | None:
    value = psnr(_cut(render, window), _cut(truth, window) / 255.0)
    return value if np.isfinite(value) else None


def _place(window: InsetWindow) -> dict[str, Any]:
    return {
        "camera": window.camera,
        "frame_index": window.frame_index,
        "window": f"{window.x}, {window.y}, {window.width}, {window.height}",
    }


def _figure(
    number: int,
    window: InsetWindow,
    truth: np.ndarray,
    renders: Sequence[np.ndarray],
    found: Sequence[tuple[str, float | None]],
    *,
    is_by_hand: bool,
) -> Figure:
    tiles = [Tile("truth", "", _cut(truth, window))]
    tiles += [
        Tile(name, "" if value is None else f"{value:.2f} dB", as_8bit(_cut(render, window)))
        for (name, value), render in zip(found, renders, strict=True)
    ]
    sheet = draw_crops(truth, window, tiles)
    chosen = "chosen by hand" if is_by_hand else "chosen by the rule above"
    caption = (
        f"Camera {window.camera}, frame {window.frame_index}, {chosen}: --crop {window.as_argument}. Pixels are "
        f"{sheet.n_times} times as large; dB is the PSNR of the window."
    )
    names = ", ".join(tile.title for tile in tiles)
    return Figure(f"crop_{number:02d}", sheet.png, caption, f"The whole picture, and cut out of it {names}. {caption}")
