"""Writes the shared scene as Technicolor's light fields come."""

from __future__ import annotations

from pathlib import Path

from scipy.spatial.transform import Rotation

from tests.engine.capture.layouts.scene import Scene

LENSES = ("pinhole",)
"""What the layout can say."""
FIRST_FRAME = 151


def write(folder: Path, scene: Scene) -> None:
    """Write the scene into this folder; cameras are called 00, 01 and so on."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = ["f cu cv ar sk qw qx qy qz tx ty tz"]
    for row in range(len(scene.names)):
        scene.write_images(folder, row, lambda t, row=row: f"Birthday_undist_{FIRST_FRAME + t:05d}_{row:02d}.png")
        K, pose = scene.Ks[row], scene.world_to_camera[row]
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        values = [K[0, 0], K[0, 2], K[1, 2], K[1, 1] / K[0, 0], 0.0, w, x, y, z, *pose[:3, 3]]
        rows.append(" ".join(f"{value:.12g}" for value in values))
    (folder / "cameras_parameters.txt").write_text("\n".join(rows) + "\n", encoding="utf-8")
