"""Windows of pictures: they cover everything once, and what one shows is that part of the whole picture."""

import numpy as np
import pytest
import torch

from engine.backends.table import BACKENDS, backend_called
from engine.model.clip_view import View
from engine.raster import rasterize
from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import TILE_PX as RASTER_TILE_PX
from engine.training.windows import TILE_PX, WINDOW_PIXELS, Windows

SIZES = [(640, 360), (640, 480), (641, 480), (800, 600), (1280, 720), (1352, 1014), (1920, 1080), (1080, 1920),
         (3840, 2160), (9000, 40), (33, 20_000), (31, 31), (1, 1)]  # fmt: skip


def test_tiles_are_those_of_the_rasterizer():
    assert TILE_PX == RASTER_TILE_PX


@pytest.mark.parametrize("size", SIZES)
def test_windows_cover_every_pixel_once(size: tuple[int, int]):
    windows, (width, height) = Windows(*size), size
    n_covers = np.zeros((height, width), int)
    for window in (windows[index] for index in range(len(windows))):
        assert min(window.width, window.height) > 0
        assert (window.x % TILE_PX, window.y % TILE_PX) == (0, 0)
        assert window.width * window.height <= 1.2 * WINDOW_PIXELS  # of whole tiles
        n_covers[window.y : window.y + window.height, window.x : window.x + window.width] += 1
    assert (n_covers == 1).all()


@pytest.mark.parametrize(("size", "n"), [((640, 360), 1), ((640, 480), 1), ((1280, 720), 3), ((1920, 1080), 8)])
def test_small_pictures_are_one_window_and_large_ones_few(size: tuple[int, int], n: int):
    assert len(Windows(*size)) == n


def test_one_window_is_the_picture_itself():
    windows, picture = Windows(64, 48), np.zeros((48, 64, 3), np.uint8)
    view = View.from_arrays(np.eye(4), np.eye(3), width=64, height=48, near_plane=0.1)
    assert windows.cut(picture, 0) is picture
    assert windows.view(view, 0) is view


@pytest.mark.parametrize("name", BACKENDS)
def test_the_pictures_of_windows_are_the_parts_of_the_picture(name: str):
    generator = torch.Generator().manual_seed(0)
    n, width, height = 300, 200, 120
    means = torch.rand(n, 3, generator=generator) * torch.tensor([4.0, 2.4, 2.0]) - torch.tensor([2.0, 1.2, -2.0])
    gaussians = Gaussians(
        means=means,
        quats=torch.nn.functional.normalize(torch.randn(n, 4, generator=generator), dim=1),
        scales=torch.rand(n, 3, generator=generator) * 0.08 + 0.01,
        opacities=torch.rand(n, generator=generator),
        colors=torch.rand(n, 3, generator=generator),
    )
    K = np.array([[110.0, 0, 103.0], [0, 112.0, 57.0], [0, 0, 1]])
    view = View.from_arrays(np.eye(4), K, width=width, height=height, near_plane=0.1)

    def drawn(of: View) -> np.ndarray:
        picture = rasterize(
            gaussians,
            of.world_to_camera[None],
            of.K[None],
            of.width,
            of.height,
            backend=backend_called(name),
            near_plane=0.1,
        )
        return picture.image[0].numpy()

    whole, windows = drawn(view), Windows(width, height, max_pixels=90 * 70)
    assert len(windows) == 4
    for index, part in enumerate(windows.views([view])):
        # projections are linearised at the same places unless those lie outside, so only rounding differs
        np.testing.assert_allclose(drawn(part), windows.cut(whole, index), atol=2e-4)


def test_windows_of_all_cameras_are_numbered_camera_by_camera():
    windows = Windows(100, 64, max_pixels=64 * 64)
    pictures = np.arange(3 * 64 * 100).reshape(3, 64, 100)
    cut = windows.cut_all(pictures)
    assert cut is not None
    assert len(cut) == 3 * len(windows)
    assert np.array_equal(cut[windows.row(2, 1)], windows.cut(pictures[2], 1))
    assert windows.cut_all(None) is None
