"""Cameras that learn: their gradient against finite differences, their gauge, and what stays as it is."""

import numpy as np
import pytest
import torch
from torch import Tensor

from engine.backends.table import backend_called
from engine.camera.corrections import LOG_FOCAL, N_VALUES, corrected, corrected_camera
from engine.camera.rig import CameraRig
from engine.model.clip_view import View, render_gaussians
from engine.raster.gaussians import Gaussians
from engine.synthetic.gaussian_scenes import Scene, layered_scene
from engine.synthetic.rigs import looking_at
from engine.training.step.training_cameras import TrainingCameras, correction_gradient

WIDTH, HEIGHT = 48, 40
VALUES = np.array([0.02, -0.03, 0.04, 0.05, -0.04, 0.03, 0.02])


def small_scene(seed: int) -> Scene:
    return layered_scene(30, WIDTH, HEIGHT, 4.0, faint=True, seed=seed)


def loss_of(scene: Scene, gaussians: Gaussians, values: np.ndarray, weights: Tensor) -> Tensor:
    pose, K = corrected_camera(scene.viewmats[0].numpy(), scene.Ks[0].numpy(), values)
    view = View(torch.from_numpy(pose), torch.from_numpy(K), WIDTH, HEIGHT, 0.01)
    return (render_gaussians(gaussians, view, backend=backend_called("reference")).image[0] * weights).sum()


def derivatives(scene: Scene, weights: Tensor) -> tuple[np.ndarray, np.ndarray]:
    """As the cameras learn by, and by central differences. [7] each"""
    gaussians = Gaussians(*(tensor.clone().requires_grad_() for tensor in scene.gaussians.tensors()))
    loss_of(scene, gaussians, VALUES, weights).backward()
    pose, _ = corrected_camera(scene.viewmats[0].numpy(), scene.Ks[0].numpy(), VALUES)
    step, differences = 1e-6, []
    with torch.no_grad():
        for i in range(N_VALUES):
            ends = [loss_of(scene, scene.gaussians, VALUES + s * step * np.eye(N_VALUES)[i], weights) for s in (1, -1)]
            differences.append(float(ends[0] - ends[1]) / (2 * step))
    return correction_gradient(gaussians, pose, VALUES), np.array(differences)


@pytest.mark.parametrize("seed", range(4))
def test_gradient_is_that_of_finite_differences(seed: int) -> None:
    scene = small_scene(seed)
    weights = torch.from_numpy(np.random.default_rng(seed).standard_normal((HEIGHT, WIDTH, 3)))
    found, expected = derivatives(scene, weights)
    print(found, expected)
    assert np.allclose(found[:LOG_FOCAL], expected[:LOG_FOCAL], rtol=1e-5, atol=1e-5 * np.abs(expected).max())
    assert found[LOG_FOCAL] == pytest.approx(expected[LOG_FOCAL], rel=0.1, abs=0.02 * np.abs(expected).max())
