"""What a step knows of valid pixels: flags, tiles and shares, and nothing where all is seen."""

from __future__ import annotations

import numpy as np
import torch

from engine.training.step.valid_pixels import ValidPixels, tiles_with_any


def test_cameras_that_see_all_have_no_masks() -> None:
    picture = torch.rand(40, 70, 3)
    for valid in (ValidPixels(None, "cpu"), ValidPixels(list(np.ones((2, 40, 70), bool)), "cpu")):
        assert valid.of(1) is None
        assert valid.tiles_of(1) is None
        assert valid.share_of(1) == 1.0
        assert valid.shown(1, picture) is picture


def test_a_tile_is_drawn_where_one_of_its_pixels_counts() -> None:
    is_valid = np.ones((2, 40, 70), bool)
    is_valid[1] = False
    is_valid[1, 39, 69] = is_valid[1, 0, 32] = True
    valid = ValidPixels(list(is_valid), "cpu")
    assert valid.of(0) is None
    tiles = valid.tiles_of(1)
    assert tiles is not None
    assert tiles.tolist() == [[False, True, False], [False, False, True]]
    assert valid.share_of(1) == 2 / 2800
    shown = valid.shown(1, torch.ones(40, 70, 3))
    assert shown.sum() == 6
    assert shown[39, 69].all()


def test_tiles_at_the_border_of_any_size() -> None:
    for height, width in ((1, 1), (32, 32), (33, 31), (64, 65)):
        flags = torch.zeros(height, width, dtype=torch.bool)
        assert not tiles_with_any(flags).any()
        flags[height - 1, width - 1] = True
        tiles = tiles_with_any(flags)
        assert tiles.shape == (-(-height // 32), -(-width // 32))
        assert tiles[-1, -1]
        assert tiles.sum() == 1
