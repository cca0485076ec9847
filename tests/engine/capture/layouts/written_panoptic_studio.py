"""Writes the shared scene as CMU Panoptic Studio is downloaded, with a VGA camera that is not to be read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tests.engine.capture.layouts.scene import Scene

LENSES = ("pinhole", "opencv5")
"""What the layout can say."""


def write(folder: Path, scene: Scene) -> None:
    """Write the scene into this folder; names as 00_03."""
    folder.mkdir(parents=True, exist_ok=True)
    cameras = []
    for row, name in enumerate(scene.names):
        scene.write_video(folder / "hdVideos" / f"hd_{name}.mp4", row)
        K = scene.Ks[row].copy()
        K[:2, 2] -= 0.5
        distortions = np.zeros(5)
        distortions[: len(scene.lenses[row].params)] = scene.lenses[row].params
        cameras.append(
            {
                "name": name,
                "type": "hd",
                "resolution": list(scene.size),
                "panel": 0,
                "node": row,
                "K": K.tolist(),
                "distCoef": distortions.tolist(),
                "R": scene.world_to_camera[row, :3, :3].tolist(),
                "t": (100 * scene.world_to_camera[row, :3, 3:]).tolist(),
            }
        )
    cameras.append(cameras[0] | {"name": "01_01", "type": "vga"})
    cameras.append(cameras[0] | {"name": "00_30"})  # its video was not downloaded
    document = {"calibDataSource": "160906_calib_norm", "cameras": cameras}
    (folder / "calibration_160906_pizza1.json").write_text(json.dumps(document), encoding="utf-8")
