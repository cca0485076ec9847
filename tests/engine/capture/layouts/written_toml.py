"""Writes the shared scene as Caliscope, anipose and Pose2Sim do: a TOML file, videos, and times of their frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from tests.engine.capture.layouts.scene import Scene

LENSES = ("pinhole", "opencv4", "opencv5", "fisheye")
"""What the layout can say."""


def write(folder: Path, scene: Scene, *, kind: str = "anipose", has_times: bool = True) -> None:
    """Write the scene into this folder. kind: "anipose", or "caliscope" whose cameras have numbers for names."""
    folder.mkdir(parents=True, exist_ok=True)
    sections = []
    for row in sorted(range(len(scene.names)), key=lambda row: scene.names[row]):  # as text, as anipose has them
        name, lens = scene.names[row], scene.lenses[row]
        scene.write_video(folder / f"{name}.mp4", row)
        K = scene.Ks[row].copy()
        K[:2, 2] -= 0.5
        rotation = scene.world_to_camera[row, :3, :3]
        is_matrix = kind == "caliscope"
        lines = [
            f"[cameras.{row}]\ncam_id = {row}" if is_matrix else f'[cam_{row}]\nname = "{name}"',
            f"size = {list(scene.size)}",
            f"matrix = {K.tolist()}",
            f"distortions = {[*lens.params, 0.0, 0.0, 0.0, 0.0][: max(len(lens.params), 4)]}",
            f"rotation = {(rotation if is_matrix else Rotation.from_matrix(rotation).as_rotvec()).tolist()}",
            f"translation = {scene.world_to_camera[row, :3, 3].tolist()}",
            f"fisheye = {str(lens.model == 'fisheye').lower()}",
        ]
        sections.append("\n".join(lines))
    sections.append("[metadata]\nadjusted = false\nerror = 0.3")
    name = "camera_array.toml" if kind == "caliscope" else "Calib_scene.toml"
    (folder / name).write_text("\n\n".join(sections) + "\n", encoding="utf-8")
    if has_times:
        rows = ["cam_id,frame_time"]
        for t in range(scene.n_frames):  # cameras a few milliseconds apart
            rows += [f"{camera},{100 + t / scene.fps + 0.002 * camera:.6f}" for camera in range(len(scene.names))]
        (folder / "timestamps.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


def wrong_clock(folder: Path, scene: Scene, late_frames: int) -> None:
    """Times that say the last camera started late by so many frames."""
    rows = ["cam_id,frame_time"]
    for t in range(scene.n_frames):
        for camera in range(len(scene.names)):
            late = late_frames if camera == len(scene.names) - 1 else 0
            rows.append(f"{camera},{np.float64(100 + (t + late) / scene.fps):.6f}")
    (folder / "timestamps.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
