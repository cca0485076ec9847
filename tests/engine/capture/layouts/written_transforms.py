"""Writes the shared scene as nerfstudio does: transforms.json with a time per picture, or one picture per camera."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from tests.engine.capture.layouts.scene import Scene

LENSES = ("pinhole", "opencv4", "opencv5", "fisheye")
"""What the layout can say."""
NAMES = {"opencv": ("k1", "k2", "p1", "p2", "k3"), "fisheye": ("k1", "k2", "k3", "k4"), "pinhole": ()}


def write(folder: Path, scene: Scene, *, kind: str = "times", split: bool = False) -> None:
    """Write the scene into this folder.

    Args:
        kind: "times" with a picture per time, "folders" with the first picture of each camera, "videos" likewise.
        split: Into transforms_train.json and transforms_test.json, which has the last camera.
    """
    folder.mkdir(parents=True, exist_ok=True)
    frames: list[list[dict[str, Any]]] = []
    for row, name in enumerate(scene.names):
        lens = scene.lenses[row]
        pose = np.linalg.inv(scene.world_to_camera[row]) @ np.diag([1.0, -1.0, -1.0, 1.0])
        camera = {
            "transform_matrix": pose.tolist(),
            "fl_x": scene.Ks[row, 0, 0],
            "fl_y": scene.Ks[row, 1, 1],
            "cx": scene.Ks[row, 0, 2],
            "cy": scene.Ks[row, 1, 2],
            "camera_model": "OPENCV_FISHEYE" if lens.model == "fisheye" else "OPENCV",
        } | dict(zip(NAMES[lens.model], lens.params, strict=False))
        if kind == "videos":
            scene.write_video(folder / "videos" / f"{name}.mp4", row)
        else:
            scene.write_images(folder / "images" / name, row)
        place = f"videos/{name}.png" if kind == "videos" else f"images/{name}/{{:06d}}.png"
        times = range(scene.n_frames) if kind == "times" else [0]
        own = [camera | {"file_path": place.format(t)} for t in times]
        if kind == "times":
            own = [frame | {"time": t / max(scene.n_frames - 1, 1)} for t, frame in enumerate(own)]
        frames.append(own)
    shared = {"w": scene.size[0], "h": scene.size[1], "applied_transform": np.eye(4)[:3].tolist()}
    parts = {"transforms.json": frames}
    if split:
        parts = {"transforms_train.json": frames[:-1], "transforms_test.json": frames[-1:]}
    for file_name, rows in parts.items():
        document = shared | {"frames": [frame for own in rows for frame in own]}
        (folder / file_name).write_text(json.dumps(document), encoding="utf-8")
