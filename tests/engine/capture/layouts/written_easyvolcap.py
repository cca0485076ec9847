"""Writes the shared scene as EasyMocap does: intri.yml, extri.yml and images/<camera>/."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from tests.engine.capture.layouts.scene import Scene

LENSES = ("pinhole", "opencv5", "opencv4")
"""What the layout can say."""


def write(
    folder: Path,
    scene: Scene,
    *,
    has_videos: bool = False,
    has_vectors: bool = True,
    color_matrix: np.ndarray | None = None,
) -> None:
    """Write the scene into this folder. has_vectors: rotations as R_, otherwise as Rot_."""
    folder.mkdir(parents=True, exist_ok=True)
    intri, extri = [_names(scene.names)], [_names(scene.names)]
    for row, name in enumerate(scene.names):
        if has_videos:
            scene.write_video(folder / "videos" / f"{name}.mp4", row)
        else:
            scene.write_images(folder / "images" / name, row)
        K = scene.Ks[row].copy()
        K[:2, 2] -= 0.5
        rotation, translation = scene.world_to_camera[row, :3, :3], scene.world_to_camera[row, :3, 3:]
        distortions = np.zeros(5)
        distortions[: len(scene.lenses[row].params)] = scene.lenses[row].params
        intri += [_matrix(f"K_{name}", K), _matrix(f"{'D' if has_vectors else 'dist'}_{name}", distortions[:, None])]
        intri += [f"W_{name}: {scene.size[0]:.10f}", f"H_{name}: {scene.size[1]:.10f}"]
        if color_matrix is not None:
            intri.append(_matrix(f"ccm_{name}", color_matrix))
        if has_vectors:
            extri.append(_matrix(f"R_{name}", Rotation.from_matrix(rotation).as_rotvec()[:, None]))
        else:
            extri.append(_matrix(f"Rot_{name}", rotation))
        extri += [_matrix(f"T_{name}", translation), f"t_{name}: 0.0000000000"]
    for file_name, parts in (("intri.yml", intri), ("extri.yml", extri)):
        (folder / file_name).write_text(
            "%YAML:1.0\r\n---\r\n" + "\r\n".join(parts) + "\r\n", encoding="utf-8", newline=""
        )


def _names(names: Sequence[str]) -> str:
    return "\r\n".join(["names:", *(f'  - "{name}"' for name in names)])


def _matrix(key: str, values: np.ndarray) -> str:
    data = ", ".join(f"{value:.10f}" for value in values.ravel())
    rows = [f"{key}: !!opencv-matrix", f"  rows: {values.shape[0]}", f"  cols: {values.shape[1]}", "  dt: d"]
    return "\r\n".join([*rows, f"  data: [{data}]"])
