"""Figures of one picture against independent implementations, hand values and what must hold for any picture."""

import math

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.metrics import peak_signal_noise_ratio, structural_similarity
from torchmetrics.functional.image import (
    multiscale_structural_similarity_index_measure,
    structural_similarity_index_measure,
)

from engine.backends.reference.loss import ssim_map
from engine.images.psnr import MAX_PSNR_DB, psnr
from engine.metrics.columns import COLUMNS
from engine.metrics.pictures.colors import as_shown, fit_colors
from engine.metrics.pictures.flip import flip
from engine.metrics.pictures.picture import measure_picture
from engine.metrics.pictures.similarity import Similarity, dssim1, dssim_ms, dssim_range2, ssim
from tests.engine.metrics.made_pictures import disturbed, scene

pytestmark = pytest.mark.slow  # left out by make check, as the file takes seconds as a whole

SIZES = ((41, 60), (180, 240), (181, 333))


def pair(size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    truth = scene(*size)
    return disturbed(truth), truth


def batch(picture: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(picture.transpose(2, 0, 1)[None].astype(np.float64))


def similarity_at(data_range: float, image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    similarity = Similarity.of(image, truth)
    return similarity.ssim if data_range == 1.0 else similarity.ssim_range2


# ---------------------------------------------------------------- PSNR


def test_psnr_is_that_of_scikit_image():
    image, truth = pair((60, 80))
    assert psnr(image, truth) == pytest.approx(peak_signal_noise_ratio(truth, image, data_range=1.0), abs=1e-4)


def test_psnr_by_hand():
    truth = np.zeros((4, 5, 3))
    assert psnr(np.full_like(truth, 0.1), truth) == pytest.approx(20.0)
    one_channel = truth.copy()
    one_channel[..., 0] = 0.1  # a third of the squared error: 10 log10(3) dB more
    assert psnr(one_channel, truth) == pytest.approx(20.0 + 10 * math.log10(3))
    assert psnr(truth, truth) == MAX_PSNR_DB
    assert psnr(truth - 5.0, truth) == MAX_PSNR_DB  # what is shown is clamped


def test_psnr_of_a_mask_looks_at_nothing_else():
    image, truth = pair((30, 40))
    mask = np.zeros((30, 40), bool)
    mask[3:9, 5:30] = True
    assert psnr(image, truth, mask) == pytest.approx(psnr(image[3:9, 5:30], truth[3:9, 5:30]))
    assert math.isnan(psnr(image, truth, np.zeros_like(mask)))


# ---------------------------------------------------------------- SSIM and its kin


@pytest.mark.parametrize("size", SIZES)
def test_ssim_is_that_of_the_loss(size):
    image, truth = pair(size)
    expected = ssim_map(torch.from_numpy(image).double(), torch.from_numpy(truth).double()).numpy()
    assert np.abs(Similarity.of(image, truth).ssim - expected).max() < 5e-4  # single precision in flat places
    assert ssim(image, truth) == pytest.approx(expected.mean(), abs=2e-6)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("data_range", [1.0, 2.0])
def test_ssim_is_that_of_scikit_image_and_torchmetrics_inside_the_border(size, data_range):
    image, truth = pair(size)
    found_pair = structural_similarity(
        truth.astype(np.float64),
        image.astype(np.float64),
        data_range=data_range,
        channel_axis=-1,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        full=True,
    )
    expected = np.asarray(found_pair[1])
    found = similarity_at(data_range, image, truth)
    inside = slice(5, -5)
    assert np.abs(found[inside, inside] - expected[inside, inside]).max() < 5e-4
    other = structural_similarity_index_measure(batch(image), batch(truth), data_range=data_range)  # mirrors the border
    mirrored = (np.pad(picture, ((5, 5), (5, 5), (0, 0)), mode="reflect") for picture in (image, truth))
    found = similarity_at(data_range, *mirrored)
    assert found[inside, inside].mean(dtype=np.float64) == pytest.approx(float(other), abs=2e-6)  # type: ignore[arg-type]


def test_ssim_of_flat_pictures_by_hand():
    a, b = np.full((40, 40, 3), 0.25), np.full((40, 40, 3), 0.75)
    # without texture the constants are all there is, and rounding of the squares weighs: seen 1.6e-4
    luminance = (2 * 0.25 * 0.75 + 1e-4) / (0.25**2 + 0.75**2 + 1e-4)
    middle = np.zeros((40, 40), bool)
    middle[5:-5, 5:-5] = True  # no window reaches the zeros around the picture
    assert ssim(a, b, middle) == pytest.approx(luminance, abs=2e-4)
    luminance2 = (2 * 0.25 * 0.75 + 4e-4) / (0.25**2 + 0.75**2 + 4e-4)
    assert Similarity.of(a, b).ssim_range2[20, 20] == pytest.approx(luminance2, abs=2e-4)


def test_dssims_differ_and_say_so():
    image, truth = pair((180, 240))
    assert dssim1(image, truth) == pytest.approx((1 - ssim(image, truth)) / 2)
    # the same constants in the other place: pictures of half the contrast with data range 1
    assert dssim_range2(image, truth) == pytest.approx(dssim1(image / 2, truth / 2), abs=1e-6)
    assert dssim_range2(image, truth) < dssim1(image, truth)
    assert abs(dssim_ms(image, truth) - dssim1(image, truth)) > 0.01


@pytest.mark.parametrize("size", [(176, 176), (180, 240), (191, 333)])
def test_dssim_ms_is_that_of_torchmetrics(size):
    image, truth = pair(size)
    expected = multiscale_structural_similarity_index_measure(batch(image), batch(truth), data_range=1.0)
    assert dssim_ms(image, truth) == pytest.approx((1 - float(expected)) / 2, abs=2e-6)  # type: ignore[arg-type]


def test_dssim_ms_needs_sides_of_176_px():
    image, truth = pair((175, 300))
    assert math.isnan(dssim_ms(image, truth))


def test_masked_ssim_parts_make_up_the_whole():
    image, truth = pair((50, 70))
    mask = np.random.default_rng(2).random((50, 70)) < 0.2
    share = mask.mean()
    parts = share * ssim(image, truth, mask) + (1 - share) * ssim(image, truth, ~mask)
    assert parts == pytest.approx(ssim(image, truth), abs=1e-6)
    assert math.isnan(ssim(image, truth, np.zeros_like(mask)))


# ---------------------------------------------------------------- any picture


@settings(deadline=None, max_examples=40)
@given(
    truth=hnp.arrays(np.float32, (12, 14, 3), elements=st.floats(0, 1, width=32)),
    image=hnp.arrays(np.float32, (12, 14, 3), elements=st.floats(0, 1, width=32)),
)
def test_identical_pictures_are_the_best_and_order_does_not_matter(truth, image):
    assert psnr(truth, truth) == MAX_PSNR_DB
    assert ssim(truth, truth) == pytest.approx(1.0, abs=1e-4)
    assert dssim1(truth, truth) == pytest.approx(0.0, abs=1e-4)
    assert dssim_range2(truth, truth) == pytest.approx(0.0, abs=1e-4)
    assert flip(truth, truth) == pytest.approx(0.0, abs=1e-6)
    assert psnr(image, truth) == pytest.approx(psnr(truth, image), abs=1e-9)
    assert ssim(image, truth) == pytest.approx(ssim(truth, image), abs=1e-4)  # single precision
    assert flip(image, truth) == pytest.approx(flip(truth, image), abs=1e-5)
    assert -1e-4 <= dssim1(image, truth) <= 1 + 1e-4
    assert 0 <= flip(image, truth) <= 1
    assert psnr(fit_colors(image, truth), truth) >= psnr(image, truth) - 1e-6


def test_more_noise_is_worse_by_every_figure():
    truth = scene(180, 240)
    pixels, nothing_moves = (truth * 255).astype(np.uint8), np.zeros((180, 240), bool)
    little, much = (measure_picture(disturbed(truth, amount=a), pixels, nothing_moves).figures for a in (0.02, 0.1))
    compared = 0
    for name, column in COLUMNS.items():
        a, b = little[name], much[name]
        if a is not None and b is not None and column.is_higher_better is not None:
            assert (a > b) == column.is_higher_better, name
            compared += 1
    # six bases raw and fitted, three again on pixels that do not move; light; PSNR after another correction of colours
    assert compared == 2 * (5 + 1 + 3) + 2


# ---------------------------------------------------------------- colours


def test_8_bit_is_what_a_png_holds(tmp_path):
    from PIL import Image

    image = np.random.default_rng(0).uniform(-0.2, 1.2, (16, 16, 3))
    levels = (np.clip(image, 0, 1) * 255.0 + 0.5).astype(np.uint8)
    Image.fromarray(levels).save(tmp_path / "a.png")
    read = np.asarray(Image.open(tmp_path / "a.png"))
    assert np.array_equal(as_shown(image, "8bit"), read.astype(np.float32) / np.float32(255))
    assert np.array_equal(as_shown(as_shown(image, "8bit"), "8bit"), as_shown(image, "8bit"))
    assert np.array_equal(as_shown(image, "float"), np.clip(image, 0, 1).astype(np.float32))


def test_precision_reaches_the_figures():
    pixels = np.full((20, 20, 3), 100, np.uint8)
    image = np.full((20, 20, 3), 100.4 / 255)
    still = np.zeros((20, 20), bool)
    found = {p: measure_picture(image, pixels, still, metrics="quick", precision=p).figures for p in ("float", "8bit")}
    assert found["8bit"]["psnr"] == MAX_PSNR_DB
    assert found["float"]["psnr"] == pytest.approx(20 * math.log10(255 / 0.4), abs=0.01)


def test_the_colour_fit_undoes_a_cast():
    truth = scene(20, 30).astype(np.float64)
    cast = truth * [0.5, 0.9, 0.7] + [0.1, 0.0, 0.2]
    assert np.abs(fit_colors(cast, truth) - truth).max() < 1e-9
    assert np.allclose(fit_colors(np.full_like(truth, 0.3), truth), truth.mean((0, 1)))


# ---------------------------------------------------------------- what is missing says why


def test_every_column_is_there_and_every_gap_has_a_reason():
    image, truth = pair((60, 80))
    pixels, is_moving = (truth * 255).astype(np.uint8), np.zeros((60, 80), bool)
    found = measure_picture(image, pixels, is_moving)
    assert list(found.figures) == list(COLUMNS)
    assert {name for name, value in found.figures.items() if value is None} == set(found.missing)
    assert found.missing["psnr_moving"] == found.missing["flip_fit_moving"] == "no moving pixels"
    assert "60 px" in found.missing["dssim_ms"]
    assert found.figures["flip_rest"] == found.figures["flip"]
    is_moving[:] = True
    assert measure_picture(image, pixels, is_moving).missing["ssim_rest"] == "no pixels that do not move"


def test_quick_is_psnr_ssim_and_what_follows_from_it_with_the_same_values():
    image, truth = pair((60, 80))
    pixels, is_moving = (truth * 255).astype(np.uint8), truth[..., 0] > 0.6
    quick, full = (measure_picture(image, pixels, is_moving, metrics=m) for m in ("quick", "all"))
    for name, column in COLUMNS.items():
        if column.is_quick:
            assert quick.figures[name] == full.figures[name] is not None
        else:
            assert quick.figures[name] is None
            assert "quick" in quick.missing[name]
    assert quick.figures["dssim1"] == pytest.approx((1.0 - (quick.figures["ssim"] or 0.0)) / 2.0)


def test_a_picture_with_a_nan_has_no_figures_and_says_so():
    image, truth = pair((60, 80))
    image[3, 4, 1] = np.nan
    found = measure_picture(image, (truth * 255).astype(np.uint8), truth[..., 0] > 0.6)
    assert set(found.figures.values()) == {None}
    assert "not finite" in found.missing["psnr"]
