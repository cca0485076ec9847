"""Small made-up scenes and cameras, and the rasterizer's picture of them."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace

import numpy as np
import torch

from engine.backends.table import backend_called
from engine.camera.rig import CameraRig
from engine.raster import Gaussians, rasterize

FIELDS = ("means", "quats", "scales", "opacities", "colors")


@dataclass(frozen=True)
class Splats:
    """Arrays as ui.gl.SplatRenderer takes them."""

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    colors: np.ndarray
    key: Hashable = None
    n_still: int = 0
    still_key: Hashable = None

    def __len__(self) -> int:
        return len(self.means)

    def rows(self, index: np.ndarray | slice) -> Splats:
        """Some rows, in the given order."""
        return replace(self, **{name: getattr(self, name)[index] for name in FIELDS})


@dataclass(frozen=True)
class Camera:
    """What every draw() takes, in its order."""

    world_to_camera: np.ndarray
    K: np.ndarray
    width: int
    height: int

    @property
    def arguments(self) -> tuple[np.ndarray, np.ndarray, int, int]:
        """For draw(target, *camera.arguments)."""
        return self.world_to_camera, self.K, self.width, self.height

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels of world points, written out from the definition. [N, 3] -> [N, 2]"""
        in_camera = points @ self.world_to_camera[:3, :3].T + self.world_to_camera[:3, 3]
        homogeneous = in_camera @ self.K.T
        return homogeneous[:, :2] / homogeneous[:, 2:]


def turned(yaw_rad: float, pitch_rad: float = 0.0) -> np.ndarray:
    """A rotation about y, then x. [3, 3]"""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    about_y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    c, s = np.cos(pitch_rad), np.sin(pitch_rad)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ about_y


def make_camera(
    *, width: int = 96, height: int = 72, distance: float = 3.0, yaw_rad: float = 0.0, pitch_rad: float = 0.0
) -> Camera:
    """Looks at the origin; the principal point is off centre and the focal lengths differ, to catch mix-ups."""
    world_to_camera = np.eye(4)
    world_to_camera[:3, :3] = turned(yaw_rad, pitch_rad)
    world_to_camera[2, 3] = distance
    K = np.array([[0.85 * width, 0, 0.52 * width], [0, 0.80 * width, 0.46 * height], [0, 0, 1.0]])
    return Camera(world_to_camera, K, width, height)


def centered_camera(size: int = 64, focal_px: float = 64.0, distance: float = 4.0) -> Camera:
    """A square picture with the origin in the middle of its pixel (size/2, size/2)."""
    world_to_camera = np.eye(4)
    world_to_camera[2, 3] = distance
    middle = size // 2 + 0.5
    return Camera(world_to_camera, np.array([[focal_px, 0, middle], [0, focal_px, middle], [0, 0, 1.0]]), size, size)


def make_splats(n: int, seed: int = 0, *, scale: float = 0.05, key: Hashable = None) -> Splats:
    """Random Gaussians in a cube of side two about the origin."""
    rng = np.random.default_rng(seed)
    return Splats(
        means=rng.uniform(-1, 1, (n, 3)).astype(np.float32),
        quats=rng.normal(size=(n, 4)).astype(np.float32),
        scales=(scale * rng.uniform(0.3, 1.5, (n, 3))).astype(np.float32),
        opacities=rng.uniform(0.1, 1.0, n).astype(np.float32),
        colors=rng.uniform(0, 1, (n, 3)).astype(np.float32),
        key=key,
    )


def ball(position: tuple[float, float, float], color: tuple[float, float, float], **settings: float) -> Splats:
    """One round Gaussian; settings are scale (0.2) and opacity (1)."""
    return Splats(
        means=np.array([position], dtype=np.float32),
        quats=np.array([[1, 0, 0, 0]], dtype=np.float32),
        scales=np.full((1, 3), settings.get("scale", 0.2), dtype=np.float32),
        opacities=np.array([settings.get("opacity", 1.0)], dtype=np.float32),
        colors=np.array([color], dtype=np.float32),
    )


def joined(*parts: Splats) -> Splats:
    """All rows one after another."""
    return replace(parts[0], **{name: np.concatenate([getattr(part, name) for part in parts]) for name in FIELDS})


def rasterized(splats: Splats, camera: Camera, *, near: float = 0.01) -> np.ndarray:
    """Premultiplied RGBA over nothing, from engine.raster's float64 reference. [H, W, 4]"""
    gaussians = Gaussians(**{name: torch.from_numpy(getattr(splats, name)).double() for name in FIELDS})
    rendering = rasterize(
        gaussians,
        torch.from_numpy(camera.world_to_camera)[None],
        torch.from_numpy(camera.K)[None],
        camera.width,
        camera.height,
        near_plane=near,
        backend=backend_called("reference"),
    )
    return torch.cat([rendering.image, rendering.alpha], dim=-1)[0].numpy()


def make_ring_rig(n_cameras: int = 6, *, width: int = 64, height: int = 48, radius: float = 1.6) -> CameraRig:
    """Cameras on a circle, all looking at the middle."""
    poses = []
    for yaw_rad in np.linspace(0, 2 * np.pi, n_cameras, endpoint=False):
        pose = np.eye(4)
        pose[:3, :3] = turned(yaw_rad, 0.2)
        pose[2, 3] = radius
        poses.append(pose)
    K = np.array([[60.0, 0, 30.0], [0, 62.0, 25.0], [0, 0, 1.0]])
    return CameraRig(
        names=tuple(f"cam{i:02d}" for i in range(n_cameras)),
        world_to_camera=np.array(poses),
        Ks=np.tile(K, (n_cameras, 1, 1)),
        image_sizes=np.tile(np.array([width, height]), (n_cameras, 1)),
    )
