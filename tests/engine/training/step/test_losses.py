"""Photometric loss: both back ends against float64, masks and gains, and SSIM against an independent implementation."""

import gc

import numba
import numpy as np
import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from skimage.metrics import structural_similarity

from engine.backends.backend import PhotometricLoss
from engine.backends.cpu.step.fused_loss import LossWorkspace
from engine.backends.reference.loss import ssim_map
from engine.backends.table import backend_called
from engine.raster.pinhole_view import TILE_PX, n_tiles
from engine.training.step.losses import photometric_loss

SIZES = [(1, 1), (1, 40), (40, 1), (3, 40), (37, 50), (100, 70), (70, 700)]


def make_truth(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def make_image(truth: np.ndarray, seed: int = 1) -> torch.Tensor:
    noise = 0.1 * np.random.default_rng(seed).standard_normal(truth.shape)
    return torch.from_numpy((truth / 255.0 + noise).clip(0, 1).astype(np.float32))


def differentiate(
    image: torch.Tensor,
    truth: np.ndarray,
    gain: torch.Tensor | None = None,
    *,
    backend: str = "cpu",
    ssim_weight: float = 0.2,
    **options,
) -> tuple[PhotometricLoss, torch.Tensor, torch.Tensor | None]:
    """Loss and gradients; masks are arrays too."""
    image = image.clone().requires_grad_()
    gain = None if gain is None else gain.to(image.dtype).clone().requires_grad_()
    tensors = {k: torch.from_numpy(v) if isinstance(v, np.ndarray) else v for k, v in options.items()}
    result = photometric_loss(
        image,
        torch.from_numpy(truth),
        backend=backend_called(backend),
        ssim_weight=ssim_weight,
        gain=gain,
        **tensors,
    )
    result.loss.backward()
    assert image.grad is not None
    return result, image.grad, None if gain is None else gain.grad


def relative_error(found: torch.Tensor | None, expected: torch.Tensor | None) -> float:
    assert found is not None
    assert expected is not None
    return float((found.double() - expected).norm() / expected.norm().clamp_min(1e-4))


def compare(image: torch.Tensor, truth: np.ndarray, gain: torch.Tensor | None = None, *, error=5e-5, **options):
    """Fused against the float64 reference, value and gradients."""
    shown = image.double() * (1.0 if gain is None else gain.double())
    difference = (shown - torch.from_numpy(truth / 255.0 if truth.dtype == np.uint8 else truth)).abs()
    # the sign of a difference as small as its rounding error is arbitrary
    image = torch.where((difference > 0) & (difference < 1e-6), image + 1e-3, image)
    slow_truth = truth if truth.dtype == np.uint8 else truth.astype(np.float64)
    fast, fast_grad, fast_gain = differentiate(image, truth, gain, backend="cpu", **options)
    slow, slow_grad, slow_gain = differentiate(image.double(), slow_truth, gain, backend="reference", **options)
    # typical 1e-9, 5e-10 and 2e-7 on random pictures; variances are differences of float32 sums
    assert abs(float(fast.loss.detach()) - float(slow.loss.detach())) < 5e-6
    assert abs(fast.mean_square - slow.mean_square) < 1e-7
    assert relative_error(fast_grad, slow_grad) < error
    if gain is not None:
        assert relative_error(fast_gain, slow_gain) < error


@pytest.mark.parametrize(("height", "width"), SIZES)
@pytest.mark.parametrize("ssim_weight", [0.0, 0.2, 1.0])
def test_fused_matches_reference(height, width, ssim_weight):
    truth = make_truth(height, width)
    compare(make_image(truth), truth, ssim_weight=ssim_weight)


@settings(deadline=None, max_examples=30)
@given(
    size=st.sampled_from(SIZES) | st.tuples(st.integers(1, 80), st.integers(1, 80)),
    seed=st.integers(0, 99),
    has=st.tuples(*[st.booleans()] * 4),
)
def test_fused_matches_reference_for_any_size_and_options(size, seed, has):
    has_gain, has_counted, has_tiles, is_float = has
    random = np.random.default_rng(seed)
    truth = make_truth(size[0], size[1], seed)
    compare(
        make_image(truth, seed),
        (truth / np.float32(255)).astype(np.float32) if is_float else truth,
        torch.tensor([0.8, 1.1, 1.0]) if has_gain else None,
        is_counted=random.random(size) < 0.7 if has_counted else None,
        tile_mask=random.random(n_tiles(size[1], size[0])) < 0.5 if has_tiles else None,
    )


@pytest.mark.parametrize("image_value", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("truth_value", [0, 77, 255])
def test_flat_pictures(image_value, truth_value):
    # no variance at all: what is left of it is rounding, divided by C2 = 9e-4; worst seen 6e-5
    compare(torch.full((40, 45, 3), image_value), np.full((40, 45, 3), truth_value, np.uint8), error=3e-4)


def test_bytes_and_floats_of_the_truth_are_the_same():
    truth = make_truth(50, 60)
    as_float = torch.from_numpy(truth).float() / 255
    bytes_loss, bytes_grad, _ = differentiate(make_image(truth), truth)
    float_loss, float_grad, _ = differentiate(make_image(truth), as_float.numpy())
    assert abs(float((bytes_loss.loss - float_loss.loss).detach())) < 1e-7  # value / 255 and value * (1 / 255)
    assert relative_error(bytes_grad, float_grad.double()) < 1e-5


@pytest.mark.parametrize("backend", ["cpu", "reference"])
def test_masked_loss_is_the_full_loss_where_the_rest_is_right(backend):
    height, width = 100, 130
    truth = make_truth(height, width)
    tile_mask = np.zeros(n_tiles(width, height), bool)
    tile_mask[1, 1:3] = tile_mask[3, 4] = True
    pixels = tile_mask.repeat(TILE_PX, 0).repeat(TILE_PX, 1)[:height, :width, None]
    right = torch.from_numpy(truth).float() / 255
    image = torch.where(torch.from_numpy(pixels), make_image(truth), right)
    full, full_grad, _ = differentiate(image, truth, backend=backend)
    background = torch.where(torch.from_numpy(pixels), image, torch.tensor(0.25))  # what unrendered tiles hold
    masked, masked_grad, _ = differentiate(background, truth, tile_mask=tile_mask, backend=backend)
    assert abs(float((full.loss - masked.loss).detach())) < 2e-7
    assert abs(full.mean_square - masked.mean_square) < 1e-9
    assert not masked_grad[~torch.from_numpy(pixels[..., 0])].any()
    inside = torch.from_numpy(pixels).expand_as(image)
    assert relative_error(masked_grad[inside], full_grad[inside].double()) < 1e-5


@pytest.mark.parametrize("backend", ["cpu", "reference"])
def test_nothing_active_is_no_loss(backend):
    truth = make_truth(40, 70)
    tile_mask = np.zeros(n_tiles(70, 40), bool)
    result, gradient, _ = differentiate(make_image(truth), truth, tile_mask=tile_mask, backend=backend)
    assert abs(float(result.loss.detach())) < 1e-6  # the reference computes SSIM of equal pictures
    assert not gradient.any()


def test_nan_in_what_does_not_count_stays_there():
    truth = make_truth(60, 80)
    image, is_counted = make_image(truth), np.ones((60, 80), bool)
    clean = image.clone()
    is_counted[20:30, 40:50] = False
    image[20:30, 40:50] = torch.nan
    gain = torch.tensor([0.9, 1.0, 1.1])
    result, gradient, gain_grad = differentiate(image, truth, gain, is_counted=is_counted)
    expected, expected_grad, expected_gain = differentiate(clean, truth, gain, is_counted=is_counted)
    assert float(result.loss.detach()) == float(expected.loss.detach())
    assert torch.equal(gradient, expected_grad)
    assert not gradient[20:30, 40:50].any()
    assert gain_grad is not None
    assert expected_gain is not None
    assert torch.equal(gain_grad, expected_gain)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_number_that_is_not_finite_shows_in_the_loss(value):
    truth = make_truth(60, 80)
    image = make_image(truth)
    image[30, 40, 1] = value
    result, _, _ = differentiate(image, truth)
    assert not np.isfinite(float(result.loss.detach()))
    assert not result.mean_square.isfinite()


def test_same_bits_for_any_number_of_threads():
    truth = make_truth(130, 340)
    image, gain = make_image(truth), torch.tensor([0.9, 1.0, 1.1])
    tile_mask = np.random.default_rng(0).random(n_tiles(340, 130)) < 0.6
    before, found = numba.get_num_threads(), []
    try:
        for n_threads in {1, 2, before}:
            numba.set_num_threads(min(n_threads, before))
            for mask in (None, tile_mask):
                result, gradient, gain_grad = differentiate(image, truth, gain, tile_mask=mask)
                assert gain_grad is not None
                found.append((result.loss.detach(), result.mean_square, gradient, gain_grad))
    finally:
        numba.set_num_threads(before)
    for index, other in enumerate(found):
        assert all(torch.equal(x, y) for x, y in zip(other, found[index % 2], strict=True))


def test_scratch_is_used_again_for_other_pictures():
    truths = [make_truth(40, 50, seed) for seed in range(2)]
    first, first_grad, _ = differentiate(make_image(truths[0]), truths[0])
    kept = first_grad.clone()
    differentiate(make_image(truths[1]), truths[1], is_counted=np.zeros((40, 50), bool))
    assert torch.equal(first_grad, kept)  # memory that somebody holds is not written to
    again, again_grad, _ = differentiate(make_image(truths[0]), truths[0])
    assert torch.equal(first.loss, again.loss)
    assert torch.equal(again_grad, kept)


@pytest.mark.slow
def test_memory_of_a_dropped_gradient_is_used_again():
    workspace = LossWorkspace(8, 8)
    first = workspace.gradient()
    address = first.data_ptr()
    other = workspace.gradient()
    assert other.data_ptr() != address
    del first
    gc.collect()
    assert workspace.gradient().data_ptr() == address


def test_loss_can_be_scaled_before_it_is_differentiated():
    truth = make_truth(20, 30)
    image = make_image(truth).requires_grad_()
    pixels = torch.from_numpy(truth)
    (3 * photometric_loss(image, pixels, backend=backend_called("cpu"), ssim_weight=0.2).loss).backward()
    _, expected, _ = differentiate(image.detach(), truth)
    assert image.grad is not None
    assert torch.allclose(image.grad, 3 * expected, rtol=1e-6, atol=0)


def test_strided_pictures_are_taken():
    truth = make_truth(40, 60)
    expected, _, _ = differentiate(make_image(truth), truth)
    wide = np.zeros((40, 120, 3), np.uint8)
    wide[:, ::2] = truth
    found, _, _ = differentiate(make_image(truth), wide[:, ::2])
    assert torch.equal(found.loss, expected.loss)


@pytest.mark.parametrize(
    ("options", "name"),
    [
        (
            {"truth": torch.zeros(9, 8, 3, dtype=torch.uint8)},
            r"truth must be \[8, 8, 3\] to match image \[8, 8, 3\], got \[9",
        ),
        ({"truth": [[1.0]]}, "truth must be a torch tensor"),
        ({"image": np.zeros((8, 8, 3), np.float32)}, "image must be a torch tensor, got numpy.ndarray"),
        ({"image": torch.zeros(8, 8, 3, device="meta")}, "image must hold numbers"),
        ({"truth": torch.zeros(8, 8, 3, device="meta")}, "truth must hold numbers"),
        ({"gain": torch.ones(3, device="meta")}, "gain must hold numbers"),
        ({"gain": [1.0, 1.0, 1.0]}, "gain must be a torch tensor"),
        ({"rest": torch.zeros(8, 8, 3, device="meta")}, "rest must hold numbers"),
        ({"is_counted": np.ones((8, 8), bool)}, "is_counted must be a torch tensor"),
        ({"tile_mask": [[True]]}, "tile_mask must be a torch tensor"),
        ({"ssim_weight": "a"}, "ssim_weight must be a number"),
        ({"ssim_weight": 1.5}, r"ssim_weight must lie in 0\.\.1, got 1\.5"),
        ({"ssim_weight": float("nan")}, "ssim_weight"),
        ({"truth": torch.zeros(8, 8, 3, dtype=torch.int64)}, "truth"),
        ({"gain": torch.ones(4)}, "gain"),
        ({"gain": torch.ones(3, dtype=torch.float64)}, "gain"),
        ({"is_counted": torch.ones(8, 9, dtype=torch.bool)}, "is_counted"),
        ({"is_counted": torch.ones(8, 8, dtype=torch.uint8)}, "is_counted"),
        ({"tile_mask": torch.ones(2, 1, dtype=torch.bool)}, "tile_mask"),
        ({"rest": torch.zeros(9, 8, 3)}, "rest"),
        ({"rest": torch.zeros(8, 8, 3, dtype=torch.float64)}, "rest"),
        ({"image": torch.zeros(8, 8)}, "image"),
        ({"image": torch.zeros(8, 8, 3, dtype=torch.int64)}, "image"),
        ({"image": torch.zeros(8, 8, 3, dtype=torch.float64)}, "image"),
    ],
)
def test_argument_that_does_not_fit_is_named(options, name):
    arguments = {"image": torch.zeros(8, 8, 3), "truth": torch.zeros(8, 8, 3, dtype=torch.uint8), "ssim_weight": 0.2}
    with pytest.raises((ValueError, TypeError), match=name):
        photometric_loss(**(arguments | options), backend=backend_called("cpu"))


def test_ssim_agrees_with_scikit_image_away_from_the_border():
    truth = make_truth(40, 50)
    image = make_image(truth).double()
    ours = ssim_map(image, torch.from_numpy(truth / 255.0))[5:-5, 5:-5].numpy()
    theirs = structural_similarity(
        truth / 255.0,
        image.numpy(),
        channel_axis=2,
        data_range=1.0,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        full=True,
    )[1]
    assert np.abs(ours - theirs[5:-5, 5:-5]).max() < 1e-9


def composed(height: int, width: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, torch.Tensor, torch.Tensor]:
    """A tile mask, its pixels [H, W, 1], a picture that stays in the other tiles and an image that holds it there."""
    tile_mask = np.random.default_rng(seed).random(n_tiles(width, height)) < 0.35
    pixels = tile_mask.repeat(TILE_PX, 0).repeat(TILE_PX, 1)[:height, :width, None]
    rest = torch.rand(height, width, 3, generator=torch.Generator().manual_seed(seed))
    image = torch.where(torch.from_numpy(pixels), make_image(make_truth(height, width, seed)), rest)
    return tile_mask, pixels, rest, image


@pytest.mark.parametrize("backend", ["cpu", "reference"])
@pytest.mark.parametrize(("height", "width"), [(100, 130), (37, 50), (70, 700)])
@pytest.mark.parametrize("has_gain", [False, True])
def test_loss_of_active_tiles_and_a_rest_is_the_full_loss_up_to_a_constant(backend, height, width, has_gain):
    truth = make_truth(height, width)
    tile_mask, pixels, rest, image = composed(height, width)
    gain = torch.tensor([0.9, 1.0, 1.1]) if has_gain else None
    drawn = torch.where(torch.from_numpy(pixels), image, torch.tensor(torch.nan))  # whatever other tiles hold
    masked, gradient, _ = differentiate(drawn, truth, gain, tile_mask=tile_mask, rest=rest, backend=backend)
    full, full_gradient, _ = differentiate(image, truth, gain, backend=backend)
    masked_rest, _, _ = differentiate(rest, truth, gain, tile_mask=tile_mask, rest=rest, backend=backend)
    full_rest, _, _ = differentiate(rest, truth, gain, backend=backend)
    change, full_change = (float((a.loss - b.loss).detach()) for a, b in ((masked, masked_rest), (full, full_rest)))
    assert abs(full_change) > 1e-3
    # losses around 0.5 in float32: 3e-8 of rounding each, and sums of 1e5 values in different order
    assert abs(change - full_change) < 5e-7
    square_change = masked.mean_square - masked_rest.mean_square
    assert abs(square_change - (full.mean_square - full_rest.mean_square)) < 1e-7
    inside = torch.from_numpy(pixels).expand_as(image)
    assert not gradient[~inside].any()
    if backend == "cpu":
        assert torch.equal(gradient[inside], full_gradient[inside])
    else:
        assert relative_error(gradient[inside], full_gradient[inside].double()) < 1e-6


@settings(deadline=None, max_examples=20)
@given(
    size=st.tuples(st.integers(1, 120), st.integers(1, 120)),
    seed=st.integers(0, 99),
    has=st.tuples(st.booleans(), st.booleans()),
)
def test_fused_matches_reference_with_a_rest(size, seed, has):
    has_gain, has_counted = has
    truth = make_truth(size[0], size[1], seed)
    tile_mask, _, rest, image = composed(size[0], size[1], seed)
    gain = torch.tensor([0.8, 1.1, 1.0]) if has_gain else None
    gap = (image.double() * (1.0 if gain is None else gain.double()) - torch.from_numpy(truth / 255.0)).abs()
    assume(not ((gap > 0) & (gap < 3e-7)).any())  # |a - b| has no slope at 0, and float32 may see the other side of it
    is_counted = np.random.default_rng(seed).random(size) < 0.7 if has_counted else None
    options = {"tile_mask": tile_mask, "is_counted": is_counted}
    fast, fast_grad, fast_gain = differentiate(image, truth, gain, rest=rest, backend="cpu", **options)
    slow, slow_grad, slow_gain = differentiate(
        image.double(), truth, gain, rest=rest.double(), backend="reference", **options
    )
    assert abs(fast.mean_square - slow.mean_square) < 1e-7
    assert relative_error(fast_grad, slow_grad) < 5e-5
    if gain is not None:
        assert relative_error(fast_gain, slow_gain) < 5e-5


@pytest.mark.parametrize("backend", ["cpu", "reference"])
def test_what_does_not_count_is_right_in_the_rest_too(backend):
    truth = make_truth(60, 80)
    tile_mask, pixels, rest, image = composed(60, 80, seed=3)
    assert tile_mask.any()
    assert not tile_mask.all()
    is_counted = pixels[..., 0].copy()  # nothing of the rest counts: as if it were the truth
    found, found_grad, _ = differentiate(
        image, truth, tile_mask=tile_mask, rest=rest, is_counted=is_counted, backend=backend
    )
    expected, expected_grad, _ = differentiate(image, truth, tile_mask=tile_mask, backend=backend)
    assert float(found.loss.detach()) == float(expected.loss.detach())
    assert torch.equal(found_grad, expected_grad)
