"""Sheets, maps and charts as files."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from app.lab.report.paper_figures.by_hand import InsetWindow
from app.lab.report.paper_figures.crop_sheet import SHEET_WIDTH_PX, Tile, draw_crops
from app.lab.report.paper_figures.drawing import ChangeColumn, draw_change_maps, draw_picture_rows, draw_spheres
from app.lab.report.paper_figures.length_chart import LengthPanel, Series, draw_over_length


def pixels_of(png: bytes) -> np.ndarray:
    with Image.open(io.BytesIO(png)) as picture:
        return np.asarray(picture.convert("RGB"))


def test_pixels_of_a_window_are_enlarged_by_a_whole_number(rng):
    truth = rng.integers(0, 255, (240, 320, 3), dtype=np.uint8)
    window = InsetWindow("cam", 3, 100, 50, 40, 30)
    tiles = [Tile(f"$n$ {i}", "20 dB", rng.integers(0, 255, (30, 40, 3), dtype=np.uint8)) for i in range(7)]
    sheet = draw_crops(truth, window, tiles)
    picture = pixels_of(sheet.png)
    assert sheet.n_times == 4
    assert picture.shape[1] <= SHEET_WIDTH_PX
    found = []
    for tile in tiles:
        enlarged = tile.pixels.repeat(4, 0).repeat(4, 1)
        rows, columns = np.nonzero((picture == enlarged[0, 0]).all(2))
        found += [
            (y, x)
            for y, x in zip(rows, columns, strict=True)
            if np.array_equal(picture[y : y + 120, x : x + 160], enlarged)
        ]
    assert len({y for y, _ in found}) == 2  # two rows
    assert len(set(found)) == len(tiles)
    assert (picture == (224, 0, 0)).all(2).sum() > 100  # the box
    assert draw_crops(truth, window, tiles).png == sheet.png


@pytest.mark.slow
def test_a_window_as_large_as_the_picture_is_shown_as_it_is(rng):
    truth = rng.integers(0, 255, (300, 1300, 3), dtype=np.uint8)
    sheet = draw_crops(truth, InsetWindow("cam", 3, 0, 0, 1300, 300), [Tile("truth", "", truth)] * 2)
    assert sheet.n_times == 1
    picture = pixels_of(sheet.png)
    assert (picture == truth[0, 0]).all(2).any()
    assert picture.shape[0] > 600


@pytest.mark.slow
def test_maps_share_one_locked_range():
    import matplotlib as mpl

    truth = np.zeros((24, 32, 3), np.uint8)

    def counts(value: float, n: int) -> list[int]:
        values = np.full((24, 32), value, np.float32)
        columns = [ChangeColumn(f"p{i}", "1.00/255", "", values, values) for i in range(n)]
        pixels = pixels_of(draw_change_maps(values, "1.00/255", truth, columns, (0.0, 0.1))).reshape(-1, 3)
        colors = [np.round(np.array(mpl.colormaps["cividis"](x)[:3]) * 255) for x in (0.0, 1.0)]
        return [int((np.abs(pixels - color) <= 1).all(1).sum()) for color in colors]

    low, high, many = counts(0.0, 2), counts(0.7, 2), counts(0.7, 6)
    assert low[0] > 100_000 > low[1]
    assert high[1] > 100_000 > high[0]
    assert many[1] > 100_000


@pytest.mark.slow
def test_equal_figures_are_equal_files(rng):
    pictures = [(rng.random((24, 32, 3), np.float32), "20 dB"), (np.full((24, 32, 3), np.nan, np.float32), "")]
    panels = [
        LengthPanel("PSNR", [Series(f"a $x$ {i}", [(5, 20.0 + i), (10, None), (15, 21.0)]) for i in range(12)]),
        LengthPanel("nothing", [Series(str(i), [(5, None)]) for i in range(12)]),
    ]
    for draw in (
        lambda: draw_picture_rows(["truth", "render"], [("clip 0", pictures), ("clip 1", pictures)]),
        lambda: draw_over_length(panels, "M", ticks=[5, 10, 15]),
        lambda: draw_over_length(panels, "N"),
    ):
        first = draw()
        assert first == draw()
        assert pixels_of(first).shape[1] > 900


def test_spheres_are_drawn_also_where_there_are_none_or_no_dots(rng):
    truth, none = rng.integers(0, 255, (48, 64, 3), dtype=np.uint8), np.zeros((0, 2))
    places, radii = rng.random((30, 2)) * (64, 48), np.full(30, 4.0)

    def n_colored(centers: np.ndarray, radii: np.ndarray, **dots: np.ndarray) -> list[int]:
        png = draw_spheres(truth, centers, radii, **dots)
        assert png == draw_spheres(truth, centers, radii, **dots)
        red, green, blue = pixels_of(png).astype(int).reshape(-1, 3).T
        return [int((high > low + 40).sum()) for high, low in ((blue, red), (red, blue), (green, red))]

    blue, red, _ = n_colored(places, radii, outside=none, inside=none)
    assert blue > 1000
    assert red == 0
    _, red, _ = n_colored(none, none[:, 0], outside=places, inside=none)
    assert red > 20
    assert n_colored(none, none[:, 0], outside=none, inside=places)[2] > 20
    assert n_colored(none, none[:, 0], outside=none, inside=none) == [0, 0, 0]
