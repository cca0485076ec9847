"""Writes the shared scene as the shipped sample is: cameras.json and a video per camera."""

from __future__ import annotations

import json
from pathlib import Path

from tests.engine.capture.layouts.scene import Scene

LENSES = ("pinhole",)
"""What the layout can say."""


def write(folder: Path, scene: Scene) -> None:
    """Write the scene into this folder."""
    folder.mkdir(parents=True, exist_ok=True)
    cameras = []
    for row, name in enumerate(scene.names):
        scene.write_video(folder / f"{name}.mp4", row)
        camera = {"name": name, "file": f"{name}.mp4", "width": scene.size[0], "height": scene.size[1]}
        numbers = {"K": scene.Ks[row].tolist(), "world_to_camera": scene.world_to_camera[row].tolist()}
        cameras.append(camera | numbers)
    document = {"schema": 1, "fps": scene.fps, "n_frames": scene.n_frames, "cameras": cameras}
    (folder / "cameras.json").write_text(json.dumps(document), encoding="utf-8")
