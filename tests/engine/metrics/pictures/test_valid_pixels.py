"""Figures of pictures of which a camera sees a part: what lies elsewhere changes none of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import ndimage

from engine.images.psnr import psnr
from engine.metrics.clips.seams import seam_maps
from engine.metrics.pictures.flip import flip_map
from engine.metrics.pictures.picture import measure_picture
from engine.metrics.pictures.similarity import Similarity, ssim_pixels
from tests.engine.metrics.made_pictures import disturbed, scene

SIZE = (180, 200)


def case() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Image, pixels [H, W, 3] uint8, what moves and a round valid region, black outside of it."""
    truth = scene(*SIZE)
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    is_valid = ((x - 95) / 100.0) ** 2 + ((y - 90) / 90.0) ** 2 < 1.0
    pixels = np.where(is_valid[..., None], (255 * truth).astype(np.uint8), np.uint8(0))
    return disturbed(truth), pixels, x < 60, is_valid


@pytest.mark.slow
def test_what_is_rendered_where_nothing_is_seen_changes_no_figure() -> None:
    image, pixels, is_moving, is_valid = case()
    other = np.where(is_valid[..., None], image, 1.0 - image)
    found = measure_picture(image, pixels, is_moving, is_valid=is_valid)
    assert found.figures == measure_picture(other, pixels, is_moving, is_valid=is_valid).figures
    moves_outside = is_moving | ~is_valid
    assert found.figures == measure_picture(image, pixels, moves_outside, is_valid=is_valid).figures
    unmasked = measure_picture(image, pixels, is_moving).figures
    assert found.figures["psnr"] > unmasked["psnr"] + 3  # type: ignore[operator]


def test_figures_are_means_over_valid_pixels_of_pictures_equal_elsewhere() -> None:
    image, pixels, is_moving, is_valid = case()
    truth = pixels.astype(np.float32) / np.float32(255.0)
    found = measure_picture(image, pixels, is_moving, is_valid=is_valid).figures
    shown = np.where(is_valid[..., None], np.clip(image, 0, 1), truth).astype(np.float32)
    assert found["psnr"] == pytest.approx(psnr(shown, truth, is_valid), abs=1e-5)
    assert found["psnr_moving"] == pytest.approx(psnr(shown, truth, is_valid & is_moving), abs=1e-5)
    alike = ssim_pixels(Similarity.of(shown, truth))
    assert found["ssim"] == pytest.approx(float(alike[is_valid].mean(dtype=np.float64)), abs=1e-9)
    assert found["dssim1"] == pytest.approx(0.5 * (1 - float(alike[is_valid].mean(dtype=np.float64))), abs=1e-9)
    assert found["flip"] == pytest.approx(float(flip_map(shown, truth)[is_valid].mean(dtype=np.float64)), abs=1e-9)
    assert found["moving_share"] == pytest.approx((is_moving & is_valid).sum() / is_valid.sum())
    # no window of a pixel this far inside reaches what is not seen: there the map is that of the whole pictures
    far_inside = ndimage.distance_transform_edt(is_valid) > 8  # type: ignore[operator]
    whole = ssim_pixels(Similarity.of(image, scene(*SIZE).astype(np.float32)))
    assert np.abs(whole - alike)[far_inside].max() < 0.02  # apart from the truth's rounding


def test_all_pixels_valid_gives_the_figures_without_a_mask() -> None:
    image, pixels, is_moving, _ = case()
    everywhere = np.ones(SIZE, bool)
    masked = measure_picture(image, pixels, is_moving, is_valid=everywhere).figures
    plain = measure_picture(image, pixels, is_moving).figures
    assert {name: value for name, value in masked.items() if value is not None} == pytest.approx(
        {name: value for name, value in plain.items() if value is not None}, rel=1e-12
    )


def test_a_camera_that_sees_nothing_has_no_figures_and_says_so() -> None:
    image, pixels, is_moving, is_valid = case()
    nothing = measure_picture(image, pixels, is_moving, is_valid=np.zeros_like(is_valid))
    assert nothing.figures["psnr"] is None
    assert nothing.missing["psnr"] == "the camera sees nothing of the picture"
    corner = np.zeros_like(is_valid)
    corner[:20, :20] = True
    little = measure_picture(image, pixels, is_moving, is_valid=corner)
    assert little.missing["dssim_ms"] == "the camera sees too little of the picture"
    assert little.figures["psnr"] is not None


def test_seams_are_of_valid_pixels() -> None:
    image, pixels, is_moving, is_valid = case()
    still, truth = np.zeros(SIZE, bool), pixels.astype(np.float32) / 255
    shown = np.where(is_valid[..., None], image, 0.0).astype(np.float32)
    before = np.where(is_valid[..., None], shown + np.float32(0.05), shown)
    maps = seam_maps(shown, before, truth, truth, still, is_valid)
    assert maps.means(maps.change)[0] == pytest.approx(0.05, abs=1e-6)
    assert maps.means(maps.change)[1] is None  # what is not seen does not count as moving
    assert maps.static_share == 1.0
    half = seam_maps(shown, before, truth, truth, is_moving, is_valid)
    assert half.static_share == pytest.approx((is_valid & ~is_moving).sum() / is_valid.sum())
    assert not math.isclose(half.static_share, half.is_static.mean())
