"""MotionMasks against plain arrays of flags, at widths that fill no whole bytes."""

import numpy as np
import pytest

from engine.cloud.background.motion_masks import MotionMasks


@pytest.mark.parametrize("width", [1, 8, 13, 64])
def test_flags_are_kept(width: int):
    flags = np.random.default_rng(width).random((3, 2, 5, width)) < 0.3
    masks = MotionMasks.of(flags)
    assert masks.shape == flags.shape
    assert masks.share == pytest.approx(flags.mean())
    for frame in range(3):
        assert np.array_equal(masks.of_frame(frame), flags[frame])
    for row in range(2):
        assert np.array_equal(masks.of_camera(row), flags[:, row])


def test_cameras_are_put_one_by_one_and_nothing_moves_before():
    flags = np.random.default_rng(0).random((3, 2, 5, 11)) < 0.5
    masks = MotionMasks(3, 2, 5, 11)
    assert masks.share == 0.0
    masks.put_camera(1, np.packbits(flags[:, 1], axis=-1))
    assert np.array_equal(masks.of_camera(1), flags[:, 1])
    assert not masks.of_camera(0).any()
