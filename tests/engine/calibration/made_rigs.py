"""Rigs with known truth, points that they see, and how far estimates are from the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.lab.synthetic.rigs import looking_at
from engine.calibration.solving.bundle import Observations
from engine.calibration.solving.cameras import N_LENS, Cameras, rotation_of
from engine.camera.rig import CameraRig

SIZE = (640, 480)
LENS_PARAMS = {
    "pinhole": [],
    "simple": [-0.12],
    "opencv": [-0.15, 0.04, 0.002, -0.001],
    "fisheye": [0.02, -0.01, 0.004, -0.001],
}


@dataclass(frozen=True)
class Seen:
    """A rig, points of the scene and noisy sightings of them."""

    truth: Cameras
    points: np.ndarray
    sightings: Observations


def make_seen(kind: str, lens: str = "pinhole", *, noise_px: float = 0.15, n_points: int = 500, seed: int = 1) -> Seen:
    """A ring of 20 cameras or 12 that face forward; each point is seen by about half of those that could."""
    generator = np.random.default_rng(seed)
    if kind == "ring":
        angles = 2 * np.pi * np.arange(20) / 20
        centers = np.stack([2.7 * np.cos(angles), 2.7 * np.sin(angles), 1.0 + 0.8 * (np.arange(20) % 2)], axis=-1)
        poses = [looking_at(center, np.array([0, 0, 0.6])) for center in centers]
        points = generator.uniform([-1.8, -1.8, 0], [1.8, 1.8, 2.2], (n_points, 3))
    else:
        x, z = np.meshgrid(np.linspace(-1.2, 1.2, 4), np.linspace(0.6, 1.8, 3))
        centers = np.stack([x.reshape(-1), np.full(12, -3.0), z.reshape(-1)], axis=-1)
        poses = [looking_at(center, np.array([0, 1.0, 1.0])) for center in centers]
        points = generator.uniform([-2.5, -0.8, 0], [2.5, 3.0, 2.5], (n_points, 3))
    n = len(poses)
    focals = 500.0 * generator.uniform(0.96, 1.04, n)
    truth = Cameras(
        lens,
        np.array(poses)[:, :3, :3],
        np.array(poses)[:, :3, 3],
        focals,
        np.ones(n),
        np.array(SIZE) / 2 + generator.normal(0, 2, (n, 2)),
        np.tile(LENS_PARAMS[lens], (n, 1)).reshape(n, N_LENS[lens]),
    )
    cameras, numbers = (grid.reshape(-1) for grid in np.meshgrid(np.arange(n), np.arange(n_points), indexing="ij"))
    pixels, depths = truth.pixels(cameras, points[numbers])
    is_seen = (depths > 0.2) & (pixels > 0).all(1) & (pixels < np.array(SIZE)).all(1)
    is_seen &= generator.uniform(size=len(pixels)) < 0.5
    pixels = pixels + generator.normal(0, noise_px, pixels.shape)
    sightings = Observations(cameras[is_seen], numbers[is_seen], pixels[is_seen])
    is_enough = np.bincount(sightings.points, minlength=n_points) >= 2
    number = np.cumsum(is_enough) - 1
    kept = sightings.chosen(is_enough[sightings.points])
    return Seen(truth, points[is_enough], Observations(kept.cameras, number[kept.points], kept.pixels))


def rough(truth: Cameras, lens: str, *, seed: int = 2) -> Cameras:
    """The truth, two degrees and some centimetres off, without what is known of its lenses."""
    generator = np.random.default_rng(seed)
    n = len(truth)
    return Cameras(
        lens,
        rotation_of(generator.normal(0, 0.02, (n, 3))) @ truth.rotations,
        truth.translations + generator.normal(0, 0.05, (n, 3)),
        truth.focals * np.exp(generator.normal(0, 0.03, n)),
        np.ones(n),
        np.tile(np.array(SIZE) / 2.0, (n, 1)),
        np.zeros((n, N_LENS[lens])),
    )


def cameras_of(rig: CameraRig) -> Cameras:
    """The cameras of a capture, without their lenses."""
    poses, n = rig.world_to_camera, len(rig)
    focals, aspects = rig.Ks[:, 0, 0], rig.Ks[:, 1, 1] / rig.Ks[:, 0, 0]
    return Cameras("pinhole", poses[:, :3, :3], poses[:, :3, 3], focals, aspects, rig.Ks[:, :2, 2], np.zeros((n, 0)))


def off_truth(found: Cameras, truth: Cameras) -> tuple[float, float]:
    """Largest angle in degrees and largest distance as a share of the rig's radius, after the best similarity."""
    to_centers, from_centers = truth.centers - truth.centers.mean(0), found.centers - found.centers.mean(0)
    U, sizes, Vt = np.linalg.svd(to_centers.T @ from_centers)
    signs = np.array([1, 1, np.sign(np.linalg.det(U @ Vt))])
    rotation = (U * signs) @ Vt
    scale = (sizes * signs).sum() / (from_centers**2).sum()
    distances = np.linalg.norm(scale * from_centers @ rotation.T - to_centers, axis=-1)
    turned = (found.rotations @ rotation.T) @ truth.rotations.transpose(0, 2, 1)
    cosines = (np.trace(turned, axis1=1, axis2=2) - 1) / 2
    angles = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    return float(angles.max()), float(distances.max() / np.linalg.norm(to_centers, axis=-1).max())
