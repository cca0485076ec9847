"""A tiny capture in the panoptic layout, for tests that train or open one."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image


def look_at(eye: np.ndarray, target: np.ndarray, up: np.ndarray) -> np.ndarray:
    """World to camera, OpenCV axes. [4, 4]"""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, -rotation @ eye
    return matrix


def ring(n_cameras: int, *, radius: float = 3.0, height: float = 1.0) -> list[np.ndarray]:
    """Cameras on a circle around the origin, z up, looking at it."""
    angles = np.linspace(0, 2 * np.pi, n_cameras, endpoint=False)
    eyes = [np.array([radius * np.cos(a), radius * np.sin(a), height]) for a in angles]
    return [look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0])) for eye in eyes]


def write_capture(folder: Path, *, n_cameras: int = 4, n_frames: int = 6, size: tuple[int, int] = (32, 24)) -> Path:
    """A capture in the panoptic layout: a few small JPEGs per camera; camera 0 is its own hold-out."""
    width, height = size
    K = [[30.0, 0.0, width / 2], [0.0, 30.0, height / 2], [0.0, 0.0, 1.0]]
    poses = ring(n_cameras)
    rng = np.random.default_rng(0)
    for camera in range(n_cameras):
        (folder / "ims" / str(camera)).mkdir(parents=True, exist_ok=True)
        base = rng.integers(0, 255, (height, width, 3), dtype=np.uint8)
        for frame in range(n_frames):
            Image.fromarray(np.roll(base, frame, axis=1)).save(folder / "ims" / str(camera) / f"{frame:06d}.jpg")
    for name, cameras in (("train_meta.json", range(1, n_cameras)), ("test_meta.json", range(1))):
        cameras = list(cameras)
        meta = {
            "w": width,
            "h": height,
            "k": [[K for _ in cameras] for _ in range(n_frames)],
            "w2c": [[poses[c].tolist() for c in cameras] for _ in range(n_frames)],
            "fn": [[f"{c}/{frame:06d}.jpg" for c in cameras] for frame in range(n_frames)],
            "cam_id": [list(cameras) for _ in range(n_frames)],
        }
        (folder / name).write_text(json.dumps(meta))
    return folder
