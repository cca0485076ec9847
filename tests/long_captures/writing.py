"""Writes long captures in the layout of the sample: what each camera sees is cast once, then changed and written.

Change, sensor noise, then clipping and rounding, as in a camera. The videos are coded without loss; only the turn to
YUV and back rounds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from app.lab.synthetic.raycast import SceneCamera
from app.lab.synthetic.scene import SyntheticScene
from app.lab.synthetic.writing import cameras_document, write_json, write_video
from tests.long_captures.changes import Change

NOISE = 1.0 / 255.0
"""Standard deviation of the sensor noise, of display-encoded colours in 0..1."""
LOSSLESS = 0
"""Quality of x264 that keeps every bit."""


def write_long_captures(
    folder: Path,
    scene: SyntheticScene,
    changes: Mapping[str, Change],
    *,
    noise: float = NOISE,
    seed: int = 0,
    supersampling: int = 3,
    report: Callable[[str], None] = lambda line: None,
) -> None:
    """Write one capture per change.

    Args:
        folder: Gets a folder of each name, whose files are replaced.
        changes: By name.
        noise: Standard deviation, of display-encoded colours in 0..1.
        seed: Of the noise, which is the same in every capture.
        supersampling: Rays along each side of a pixel.
        report: Gets one line per camera.
    """
    for camera_index, name in enumerate(scene.rig.names):
        footage = CameraFootage(scene, camera_index, supersampling=supersampling)
        for change_name, change in changes.items():
            (folder / change_name).mkdir(parents=True, exist_ok=True)
            frames = footage.pictures(change, noise=noise, seed=seed)
            write_video(folder / change_name / f"{name}.mp4", frames, fps=scene.fps, crf=LOSSLESS)
        report(f"{name}: {scene.n_frames} frames, {len(changes)} captures")
    for change_name in changes:  # comes last: without it a folder is not a capture
        write_json(folder / change_name / "cameras.json", cameras_document(scene))


class CameraFootage:
    """What one camera sees over the whole capture, kept for all changes: 24 bytes per pixel and frame.

    Args:
        scene: The scene.
        camera_index: Which camera.
        supersampling: Rays along each side of a pixel.
    """

    def __init__(self, scene: SyntheticScene, camera_index: int, *, supersampling: int = 3) -> None:
        self.scene, self.camera_index = scene, camera_index
        camera = SceneCamera(scene, camera_index, supersampling=supersampling)
        self._seen = [
            (surfaces.colors.astype(np.float32), surfaces.positions.astype(np.float32))
            for surfaces in map(camera.surfaces, range(scene.n_frames))
        ]

    def pictures(self, change: Change, *, noise: float = NOISE, seed: int = 0) -> Iterator[np.ndarray]:
        """What the camera takes, frame by frame, [H, W, 3] uint8."""
        for frame_index, (colors, positions) in enumerate(self._seen):
            generator = np.random.default_rng([seed, self.camera_index, frame_index])
            grain = noise * generator.standard_normal(colors.shape, dtype=np.float32)
            changed = colors * change.factors(self.camera_index, frame_index, positions) + grain
            yield np.floor(np.clip(changed, 0, 1) * 255 + 0.5).astype(np.uint8)
