"""Photometric loss: fused kernel against torch, and SSIM against an independent implementation."""

import numpy as np
import pytest
import torch
from skimage.metrics import structural_similarity

from engine.training.losses import LossWorkspace, photometric_loss, photometric_loss_reference, ssim_map


def make_pair(height: int, width: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    truth = torch.rand(height, width, 3, generator=generator)
    image = (truth + 0.1 * torch.randn(height, width, 3, generator=generator)).clamp(0, 1)
    return image, truth


@pytest.mark.parametrize(("height", "width"), [(48, 64), (1, 1), (7, 3), (33, 129)])
@pytest.mark.parametrize("ssim_weight", [0.0, 0.2, 1.0])
def test_fused_loss_matches_reference_forward_and_gradient(height, width, ssim_weight):
    image, truth = make_pair(height, width)
    fast, slow = image.clone().requires_grad_(True), image.double().requires_grad_(True)
    workspace = LossWorkspace(height, width)
    loss_fast = photometric_loss(fast, truth, ssim_weight=ssim_weight, workspace=workspace)
    loss_slow = photometric_loss_reference(slow, truth.double(), ssim_weight=ssim_weight)
    loss_fast.backward()
    loss_slow.backward()
    assert abs(loss_fast.item() - loss_slow.item()) < 2e-5  # variances are differences of float32 moments
    assert fast.grad is not None
    assert slow.grad is not None
    error = (fast.grad - slow.grad).norm() / slow.grad.norm().clamp_min(1e-12)
    assert error < 2e-4  # worst seen 3e-5; flat windows divide by C2 = 9e-4


def test_workspace_can_be_reused_for_other_pictures():
    workspace = LossWorkspace(20, 30)
    first = photometric_loss(*make_pair(20, 30, 0), ssim_weight=0.2, workspace=workspace)
    photometric_loss(*make_pair(20, 30, 1), ssim_weight=0.2, workspace=workspace)
    again = photometric_loss(*make_pair(20, 30, 0), ssim_weight=0.2, workspace=workspace)
    assert float(first) == float(again)


def test_identical_pictures_cost_nothing():
    _, truth = make_pair(16, 16)
    assert float(photometric_loss(truth, truth, ssim_weight=0.2, workspace=LossWorkspace(16, 16))) < 1e-6


def test_ssim_agrees_with_scikit_image_away_from_the_border():
    image, truth = make_pair(40, 50)
    ours = ssim_map(image.double(), truth.double())[5:-5, 5:-5].numpy()
    theirs = structural_similarity(
        truth.double().numpy(),
        image.double().numpy(),
        channel_axis=2,
        data_range=1.0,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        full=True,
    )[1]
    assert np.abs(ours - theirs[5:-5, 5:-5]).max() < 1e-9
