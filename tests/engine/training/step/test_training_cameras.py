"""Cameras that learn: their gradient against finite differences, their gauge, and what stays as it is."""

import numpy as np
import pytest
import torch
from torch import Tensor

from app.lab.synthetic.gaussian_scenes import GaussianScene, layered_scene
from app.lab.synthetic.rigs import looking_at
from engine.backends.table import backend_called
from engine.camera.corrections import LOG_FOCAL, N_VALUES, corrected, corrected_camera
from engine.camera.rig import CameraRig
from engine.model.clip_view import View, render_gaussians
from engine.raster.gaussians import Gaussians
from engine.training.step.training_cameras import TrainingCameras, correction_gradient

WIDTH, HEIGHT = 48, 40
VALUES = np.array([0.02, -0.03, 0.04, 0.05, -0.04, 0.03, 0.02])


def small_scene(seed: int) -> GaussianScene:
    return layered_scene(30, WIDTH, HEIGHT, 4.0, faint=True, seed=seed)


def loss_of(scene: GaussianScene, gaussians: Gaussians, values: np.ndarray, weights: Tensor) -> Tensor:
    pose, K = corrected_camera(scene.viewmats[0].numpy(), scene.Ks[0].numpy(), values)
    view = View(torch.from_numpy(pose), torch.from_numpy(K), WIDTH, HEIGHT, 0.01)
    return (render_gaussians(gaussians, view, backend=backend_called("reference")).image[0] * weights).sum()


def derivatives(scene: GaussianScene, weights: Tensor) -> tuple[np.ndarray, np.ndarray]:
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
    assert np.allclose(found[:LOG_FOCAL], expected[:LOG_FOCAL], rtol=1e-5, atol=1e-5 * np.abs(expected).max())
    assert found[LOG_FOCAL] == pytest.approx(expected[LOG_FOCAL], rel=0.1, abs=0.02 * np.abs(expected).max())


# ---------------------------------------------------------------- learning


def ring(n_cameras: int = 6) -> CameraRig:
    """Cameras round the Gaussians of `round_scene`."""
    angles = 2 * np.pi * np.arange(n_cameras) / n_cameras
    centers = np.column_stack([3 * np.cos(angles), 3 * np.sin(angles), 1 + 0.5 * np.cos(3 * angles)])
    poses = np.stack([looking_at(center, np.zeros(3)) for center in centers])
    K = np.array([[60.0, 0, WIDTH / 2], [0, 60.0, HEIGHT / 2], [0, 0, 1]])
    names = tuple(f"cam{i}" for i in range(n_cameras))
    return CameraRig(names, poses, np.repeat(K[None], n_cameras, 0), np.tile([WIDTH, HEIGHT], (n_cameras, 1)))


def round_scene() -> Gaussians:
    rng = np.random.default_rng(3)
    means = rng.normal(size=(150, 3)) * 0.5
    columns = (
        means,
        rng.normal(size=(150, 4)),
        rng.uniform(0.04, 0.12, (150, 3)),
        np.full(150, 0.8),
        rng.random((150, 3)),
    )
    return Gaussians(*(torch.from_numpy(column.astype(np.float32)) for column in columns))


def cameras_of(rig: CameraRig, **arguments: object) -> TrainingCameras:
    given = {"near_plane": 0.1, "start": None, "is_learning": True, "like": torch.zeros(())} | arguments
    return TrainingCameras(rig, **given)  # type: ignore[arg-type]


def learn(cameras: TrainingCameras, truth: list[Tensor], gaussians: Gaussians, n_steps: int, rate: float) -> None:
    backend = backend_called("cpu")
    adam = torch.optim.Adam([cameras.pixels], lr=rate)
    for step in range(n_steps):
        row = step % len(truth)
        seen = Gaussians(*(tensor.clone().requires_grad_() for tensor in gaussians.tensors()))
        cameras.watch(seen)
        image = render_gaussians(seen, cameras.view(row), backend=backend).image[0]
        (image - truth[row]).square().mean().backward()
        cameras.take_gradient(row)
        adam.param_groups[0]["lr"] = rate * 0.02 ** (step / n_steps)
        adam.step()
        cameras.settle()


@pytest.mark.slow
def test_wrong_cameras_are_found_again_where_the_scene_is_known() -> None:
    rig, gaussians = ring(), round_scene()
    right = cameras_of(rig)
    with torch.no_grad():
        truth = [render_gaussians(gaussians, view, backend=backend_called("cpu")).image[0] for view in right.views]
    # wrong by two pixels or so, but not all cameras alike
    wrong = cameras_of(rig)
    with torch.no_grad():
        wrong.pixels.copy_(torch.from_numpy(np.random.default_rng(5).normal(size=wrong.pixels.shape)))
    wrong.settle()
    learning = cameras_of(wrong.rig)
    before = _distance(rig, learning.rig)
    learn(learning, truth, gaussians, 300, 0.1)
    assert before > 1.0
    assert _distance(rig, learning.rig) < 0.1 * before


def _distance(rig: CameraRig, other: CameraRig) -> float:
    """How far the points of the scene land from where they ought to, pixels, RMS."""
    points = np.column_stack([round_scene().means.numpy(), np.ones(150)])
    pixels = []
    for r in (rig, other):
        seen = np.einsum("cij,nj->cni", r.Ks @ r.world_to_camera[:, :3], points)
        pixels.append(seen[..., :2] / seen[..., 2:])
    return float(np.sqrt(((pixels[0] - pixels[1]) ** 2).sum(-1).mean()))


def test_what_moves_all_cameras_alike_is_taken_out() -> None:
    rig = ring()
    cameras = cameras_of(rig)
    with torch.no_grad():
        cameras.pixels.copy_(torch.from_numpy(0.5 + np.random.default_rng(1).normal(size=cameras.pixels.shape)))
    cameras.settle()
    settled = cameras.pixels.detach().clone()
    cameras.settle()
    assert torch.allclose(settled, cameras.pixels, atol=1e-6)
    assert settled[:, LOG_FOCAL].mean().abs() < 1e-6
    # a similarity of the whole rig leaves nothing at all
    angle, factor, offset = 0.01, 1.01, np.array([0.02, -0.01, 0.015])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    corrections = []
    for pose in rig.world_to_camera:
        rotation = pose[:3, :3] @ turn.T
        center = factor * turn @ (-pose[:3, :3].T @ pose[:3, 3]) + offset
        about = rotation @ pose[:3, :3].T
        vector = np.array([about[2, 1] - about[1, 2], about[0, 2] - about[2, 0], about[1, 0] - about[0, 1]]) / 2
        corrections.append([*vector, *(-rotation @ center - about @ pose[:3, 3]), 0.0])
    moved = cameras_of(rig, start=np.array(corrections))
    size = moved.pixels.detach().norm()
    moved.settle()
    assert moved.pixels.detach().norm() < 0.02 * size


def test_cameras_that_do_not_learn_are_those_of_the_capture_bit_for_bit() -> None:
    rig = ring()
    cameras = cameras_of(rig, is_learning=False)
    assert cameras.corrections is None
    assert cameras.rig is rig
    for row, view in enumerate(cameras.views):
        assert np.array_equal(view.world_to_camera.numpy(), rig.world_to_camera[row].astype(np.float32))
        assert np.array_equal(view.K.numpy(), rig.Ks[row].astype(np.float32))


def test_corrections_change_the_cameras_they_name_and_no_other() -> None:
    rig = ring()
    values = np.tile(VALUES.astype(np.float32), (2, 1))
    found = corrected(rig, ["cam4", "elsewhere"], values)
    others = [0, 1, 2, 3, 5]
    assert np.array_equal(found.world_to_camera[others], rig.world_to_camera[others])
    assert np.array_equal(found.Ks[others], rig.Ks[others])
    assert not np.array_equal(found.world_to_camera[4], rig.world_to_camera[4])
    assert np.allclose(found.world_to_camera[4, :3, :3] @ found.world_to_camera[4, :3, :3].T, np.eye(3))
    assert found.Ks[4, 0, 0] == pytest.approx(rig.Ks[4, 0, 0] * np.exp(np.float32(0.02)))
