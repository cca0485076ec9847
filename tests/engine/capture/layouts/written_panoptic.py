"""Writes the shared scene as CMU Panoptic captures are packaged for Dynamic 3D Gaussians."""

from __future__ import annotations

import json
from pathlib import Path

from tests.engine.capture.layouts.scene import Scene

LENSES = ("pinhole",)
"""What the layout can say."""


def write(folder: Path, scene: Scene) -> None:
    """Write the scene into this folder; cameras are called 0, 1 and so on, the last is held out."""
    rows = range(len(scene.names))
    for file_name, own in (("train_meta.json", rows[:-1]), ("test_meta.json", rows[-1:])):
        for row in own:
            scene.write_images(folder / "ims" / str(row), row)
        document = {
            "w": scene.size[0],
            "h": scene.size[1],
            "k": [[scene.Ks[row].tolist() for row in own]] * scene.n_frames,
            "w2c": [[scene.world_to_camera[row].tolist() for row in own]] * scene.n_frames,
            "fn": [[f"{row}/{t:06d}.png" for row in own] for t in range(scene.n_frames)],
            "cam_id": [list(own)] * scene.n_frames,
        }
        (folder / file_name).write_text(json.dumps(document), encoding="utf-8")
