"""Writes the shared scene as Google Immersive has it: models.json and fisheye videos."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from scipy.spatial.transform import Rotation

from tests.engine.capture.layouts.scene import Scene

LENSES = ("fisheye2",)
"""What the layout can say: k1 and k2 of a fisheye."""


def simplified(scene: Scene) -> Scene:
    """The scene with one focal length for both directions."""
    Ks = scene.Ks.copy()
    Ks[:, 1, 1] = Ks[:, 0, 0]
    return replace(scene, Ks=Ks)


def write(folder: Path, scene: Scene) -> None:
    """Write the scene into this folder."""
    folder.mkdir(parents=True, exist_ok=True)
    models = []
    for row, name in enumerate(scene.names):
        scene.write_video(folder / f"{name}.mp4", row)
        rotation, translation = scene.world_to_camera[row, :3, :3], scene.world_to_camera[row, :3, 3]
        models.append(
            {
                "name": name,
                "width": float(scene.size[0]),
                "height": float(scene.size[1]),
                "focal_length": scene.Ks[row, 0, 0],
                "principal_point": scene.Ks[row, :2, 2].tolist(),
                "radial_distortion": [*scene.lenses[row].params, 0.0],
                "orientation": Rotation.from_matrix(rotation).as_rotvec().tolist(),
                "position": (-rotation.T @ translation).tolist(),
                "projection_type": "fisheye",
            }
        )
    (folder / "models.json").write_text(json.dumps(models), encoding="utf-8")
