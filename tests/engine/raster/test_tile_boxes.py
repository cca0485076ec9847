"""Tile boxes: no tile outside of a Gaussian's box holds a trace of it, and both back ends find the same boxes."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from app.lab.synthetic.gaussian_scenes import GaussianScene, layered_scene
from engine.backends.table import backend_called
from engine.raster import TILE_PX, Gaussians, TileBoxes, rasterize, tile_boxes
from engine.raster.pinhole_view import n_tiles

BACKENDS = ("cpu", "reference")


def boxes_of(scene: GaussianScene, gaussians: Gaussians, backend: str) -> TileBoxes:
    viewmats, Ks, width, height = scene.arguments
    return tile_boxes(
        gaussians, viewmats[0], Ks[0], width, height, near_plane=scene.near_plane, backend=backend_called(backend)
    )


def as_float32(gaussians: Gaussians) -> Gaussians:
    return Gaussians(*(tensor.float() for tensor in gaussians.tensors()))


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@settings(deadline=None, max_examples=20)
@given(size_px=st.sampled_from([0.3, 3.0, 30.0]), seed=st.integers(0, 99), n_rows=st.integers(0, 40))
def test_nothing_is_drawn_outside_of_the_boxes(backend, size_px, seed, n_rows):
    scene = layered_scene(40, 150, 90, size_px, seed=seed)
    gaussians = as_float32(scene.gaussians)[:n_rows]
    mask = boxes_of(scene, gaussians, backend).mask()
    assert mask.shape == n_tiles(150, 90)
    alpha = rasterize(gaussians, *scene.arguments, backend=backend_called(backend)).alpha[0, ..., 0]
    pixels = mask.repeat_interleave(TILE_PX, 0).repeat_interleave(TILE_PX, 1)[:90, :150]
    assert not alpha[~pixels].any()


def test_every_box_holds_what_its_gaussian_draws():
    scene = layered_scene(60, 150, 90, 8.0)
    gaussians = as_float32(scene.gaussians)
    boxes = boxes_of(scene, gaussians, "cpu")
    drawn = set(boxes.drawn().tolist())
    n_seen = 0
    for row in range(60):
        alpha = rasterize(gaussians[row : row + 1], *scene.arguments, backend=backend_called("cpu")).alpha[0, ..., 0]
        tiles = boxes[row : row + 1].mask()
        pixels = tiles.repeat_interleave(TILE_PX, 0).repeat_interleave(TILE_PX, 1)[:90, :150]
        assert not alpha[~pixels].any()
        assert tiles.any() == (row in drawn)
        n_seen += bool(alpha.any())
    assert n_seen > 20


def test_back_ends_find_the_same_boxes():
    scene = layered_scene(500, 300, 200, 6.0)
    fast = boxes_of(scene, as_float32(scene.gaussians), "cpu")
    slow = boxes_of(scene, scene.gaussians, "reference")
    assert (fast.packed == slow.packed).all(
        1
    ).float().mean() > 0.99  # a border on a pixel's centre may fall to either side
    assert torch.equal(fast.drawn(), slow.drawn())


@pytest.mark.parametrize("backend", BACKENDS)
def test_rows_that_cannot_be_drawn_have_no_box(backend):
    scene = layered_scene(20, 150, 90, 8.0)
    gaussians = as_float32(scene.gaussians)
    gaussians.means[3] = torch.nan
    gaussians.opacities[5] = 0.0
    gaussians.means[7] = -1000.0 * gaussians.means[7]
    boxes = boxes_of(scene, gaussians, backend)
    assert not {3, 5, 7} & set(boxes.drawn().tolist())


def test_meeting_rows_are_those_over_a_wanted_tile():
    scene = layered_scene(300, 300, 200, 6.0)
    boxes = boxes_of(scene, as_float32(scene.gaussians), "cpu")
    tile_mask = torch.from_numpy(np.random.default_rng(0).random(boxes.shape) < 0.2)
    rows = torch.arange(1000, 1300)
    expected = [1000 + row for row in range(300) if (boxes[row : row + 1].mask() & tile_mask).any()]
    assert 0 < len(expected) < 300
    assert boxes.meeting(tile_mask, rows).tolist() == expected
    assert not len(boxes.meeting(torch.zeros_like(tile_mask), rows))


def test_arguments_are_checked():
    scene = layered_scene(4, 150, 90, 8.0)
    with pytest.raises(TypeError, match="float64"):
        boxes_of(scene, scene.gaussians, "cpu")


def test_a_mask_or_rows_that_do_not_fit_the_boxes_are_named():
    scene = layered_scene(5, 70, 40, 2.0)
    boxes = tile_boxes(scene.gaussians, scene.viewmats[0], scene.Ks[0], 70, 40, backend=backend_called("reference"))
    with pytest.raises(ValueError, match=r"tile_mask must be bool \[2, 3\], got torch.bool \[1, 3\]"):
        boxes.meeting(torch.ones(1, 3, dtype=torch.bool), torch.arange(5))
    with pytest.raises(ValueError, match=r"rows must be \[5\] to match boxes \[5, 2\], got \[4\]"):
        boxes.meeting(torch.ones(2, 3, dtype=torch.bool), torch.arange(4))
    with pytest.raises(TypeError, match="viewmat must be a torch tensor"):
        tile_boxes(scene.gaussians, scene.viewmats[0].numpy(), scene.Ks[0], 70, 40, backend=backend_called("reference"))  # pyright: ignore[reportArgumentType]
