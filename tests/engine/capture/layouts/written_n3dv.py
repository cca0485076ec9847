"""Writes the shared scene with poses_bounds.npy, as Neural 3D Video and MeetRoom have it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.engine.capture.layouts.scene import Scene


def poses_bounds(scene: Scene, *, times: float = 1.0) -> np.ndarray:
    """Rows of the file. times: how much larger the pictures were that the poses are for. [C, 17]"""
    rows = []
    for K, pose in zip(scene.Ks, scene.world_to_camera, strict=True):
        camera_to_world = np.linalg.inv(pose)
        right, down, forward, center = camera_to_world[:3].T
        height_width_focal = times * np.array([scene.size[1], scene.size[0], K[0, 0]])
        matrix = np.stack([down, right, -forward, center, height_width_focal], axis=1)
        rows.append(np.concatenate([matrix.ravel(), [0.1, 100.0]]))
    return np.stack(rows)


def write(folder: Path, scene: Scene, *, frames: str = "videos", times: float = 1.0) -> None:
    """The scene, which has centred principal points and one focal length.

    Args:
        frames: "videos", or where the images of a camera lie, as "images" or "" for its folder itself.
        times: How much larger the pictures were that the poses are for.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for row, name in enumerate(scene.names):
        if frames == "videos":
            scene.write_video(folder / f"{name}.mp4", row)
        else:
            scene.write_images(folder / name / frames, row, "{:04d}.png".format)
    np.save(folder / "poses_bounds.npy", poses_bounds(scene, times=times))
