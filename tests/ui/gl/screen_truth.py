"""Compares what GL draws with the CPU rasterizer's picture, as a screen shows both.

    python -m tests.ui.gl.screen_truth PROJECT

draws every clip of a trained project from random views and prints the worst figures.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import torch

from app.playback.modes.arrays import BACKGROUND, GaussianArrays
from engine.backends.table import backend_called
from engine.raster import Gaussians, rasterize
from tests.ui.gl.scenes import FIELDS, Camera
from ui.gl.splat_renderer import SplatRenderer
from ui.gl.splat_rows import SplatArrays
from ui.gl.targets import Target

LEAST_PSNR_DB = 45.0
MOST_PIXELS_OFF = 0.001
"""Share of pixels that may be off by more than OFF."""
OFF = 2
"""Of 255."""


def random_cameras(
    n: int, size: tuple[int, int], *, distance: float, center: np.ndarray | None = None, seed: int = 0
) -> list[Camera]:
    """Cameras all around that look at about the centre, with different lenses."""
    rng = np.random.default_rng(seed)
    center = np.zeros(3) if center is None else center
    cameras = []
    for _ in range(n):
        forward = rng.normal(size=3)
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, rng.normal(size=3))
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        eye = center + rng.normal(scale=0.1 * distance, size=3) - rng.uniform(0.7, 1.3) * distance * forward
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, -rotation @ eye
        focal = rng.uniform(0.6, 1.6) * size[0]
        K = np.array([[focal, 0, 0.5 * size[0]], [0, focal, 0.5 * size[1]], [0, 0, 1.0]])
        cameras.append(Camera(pose, K, *size))
    return cameras


def compared(
    renderer: SplatRenderer, target: Target, splats: SplatArrays, camera: Camera, background: tuple[float, float, float]
) -> tuple[float, float]:
    """PSNR in dB of GL's picture against the rasterizer's, and the share of pixels that are off by more than OFF."""
    near = 0.01
    target.clear()
    renderer.draw(target, *camera.arguments, near)
    drawn = np.frombuffer(target.resolve(background).read(), np.uint8).reshape(camera.height, camera.width, 4)[..., :3]
    gaussians = Gaussians(**{name: torch.from_numpy(getattr(splats, name)) for name in FIELDS})
    with torch.no_grad():
        rendering = rasterize(
            gaussians,
            torch.from_numpy(camera.world_to_camera.astype(np.float32))[None],
            torch.from_numpy(camera.K.astype(np.float32))[None],
            camera.width,
            camera.height,
            near_plane=near,
            background=torch.tensor(background),
            backend=backend_called("cpu"),
        )
    expected = (rendering.image[0].clamp(0.0, 1.0) * 255.0 + 0.5).to(torch.uint8).numpy()
    error = drawn.astype(np.float64) - expected
    psnr_db = 10.0 * np.log10(255.0**2 / max(float(np.mean(error**2)), 1e-9))
    return psnr_db, float((np.abs(error).max(axis=2) > OFF).mean())


def main(folder: Path) -> None:
    """Every clip of a project, from twenty random views each."""
    from app.evaluation.headless import open_trained
    from app.project.opening.project_access import open_project
    from ui.gl import make_headless_context

    size = (960, 600)
    ctx = make_headless_context()
    target, renderer = Target(ctx, size), SplatRenderer(ctx, on_thread_above=1 << 30)
    trained = open_trained(open_project(folder, is_writable=False))
    rig = trained.capture.rig
    center = rig.focus_point()
    distance = float(np.linalg.norm(rig.centers - center, axis=1).mean())
    for clip_index in trained.trained:
        with torch.no_grad():
            gaussians = trained.load(clip_index).model.decode(0.0)
        arrays = [tensor.numpy() for tensor in gaussians.tensors()]
        splats = GaussianArrays(*arrays, key=None)
        renderer.upload(splats)
        figures = [
            compared(renderer, target, splats, camera, BACKGROUND)
            for camera in random_cameras(20, size, distance=distance, center=center, seed=clip_index)
        ]
        worst_db, worst_share = min(psnr for psnr, _ in figures), max(share for _, share in figures)
        worst = f"at least {worst_db:.1f} dB, {worst_share:.3%} of pixels off"
        sys.stdout.write(f"clip {clip_index}, {len(splats)} Gaussians: {worst}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
