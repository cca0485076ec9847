"""Writes the shared scene as capture.json with a video per camera."""

from __future__ import annotations

import json
from pathlib import Path

from tests.engine.capture.layouts.scene import Scene


def write(folder: Path, scene: Scene) -> None:
    """Write the scene into this folder."""
    folder.mkdir(parents=True, exist_ok=True)
    cameras = []
    for row, name in enumerate(scene.names):
        scene.write_video(folder / f"{name}.mp4", row)
        cameras.append(
            {
                "name": name,
                "width": scene.size[0],
                "height": scene.size[1],
                "K": scene.Ks[row].tolist(),
                "world_to_camera": scene.world_to_camera[row].tolist(),
                "video": f"{name}.mp4",
                "lens": {"model": scene.lenses[row].model, "params": list(scene.lenses[row].params)},
            }
        )
    (folder / "capture.json").write_text(json.dumps({"schema": 1, "cameras": cameras}), encoding="utf-8")
