"""Writes the shared scene as Vicon does: an .xcp with a correction of what was seen, and a video per camera.

The lens is the other way round from OpenCV's: the scene finds where a ray was seen by iteration.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from engine.camera.lens import Lens
from tests.engine.capture.layouts.scene import Scene, make_scene

KINDS = ("Vicon3Parameter", "two numbers", "no lens")
_COEFFICIENTS = np.array([4e-5, -1.2e-8, 2e-12])
"""For distances in pixels; 48x32 pictures reach 29 px, where it is 2.5 % or 0.7 px."""
_OFF = np.array([0.6, -0.4])
"""Of the lens's centre from the principal point, pixels."""


@dataclass(frozen=True, eq=False)
class CorrectedScene(Scene):
    """A scene whose lenses correct what was seen. kind: one of `KINDS`."""

    kind: str = KINDS[0]

    def centre(self, row: int) -> np.ndarray:
        """From where the lens counts distances. [2]"""
        return self.Ks[row, :2, 2] + (_OFF if self.kind == KINDS[0] else 0.0)

    @property
    def coefficients(self) -> np.ndarray:
        """Of r^2, r^4 and r^6. [3]"""
        return _COEFFICIENTS * {KINDS[0]: (1, 1, 1), KINDS[1]: (1, 1, 0), KINDS[2]: (0, 0, 0)}[self.kind]

    def project(self, camera_index: int, points: np.ndarray) -> np.ndarray:
        straight = super().project(camera_index, points)  # the scene's own lenses are pinholes
        centre, seen = self.centre(camera_index), straight.copy()
        for _ in range(50):
            r2 = ((seen - centre) ** 2).sum(-1, keepdims=True)
            k1, k2, k3 = self.coefficients
            seen = centre + (straight - centre) / (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3)
        return seen


def make_corrected_scene(*, kind: str) -> CorrectedScene:
    """The shared scene, its cameras named by device."""
    scene = make_scene(lens="pinhole", names=("2120524", "2120525", "2120603", "2121041"))
    parts = (scene.names, scene.Ks, (Lens(),) * 4, scene.world_to_camera, scene.size, scene.n_frames, scene.fps)
    return CorrectedScene(*parts, kind=kind)


def write(folder: Path, scene: Scene, *, kind: str) -> None:
    """Write the scene into this folder."""
    assert isinstance(scene, CorrectedScene)
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for row, name in enumerate(scene.names):
        scene.write_video(folder / f"Walk01.{name}.20261123.mp4", row)
        K, pose = scene.Ks[row], scene.world_to_camera[row]
        quat = Rotation.from_matrix(pose[:3, :3]).as_quat()  # x y z w
        place = -pose[:3, :3].T @ pose[:3, 3] * 1000
        lens = {
            KINDS[0]: f'VICON_RADIAL2="Vicon3Parameter {_text([*scene.centre(row), *scene.coefficients])}"',
            KINDS[1]: f'VICON_RADIAL="{_text(scene.coefficients[:2])}"',
            KINDS[2]: "",
        }[kind]
        rows.append(
            f'<Camera DEVICEID="{name}" DISPLAY_TYPE="Vue" NAME="Vue_{row}" '
            f'PIXEL_ASPECT_RATIO="{float(K[0, 0] / K[1, 1])!r}" '
            f'SENSOR_SIZE="{scene.size[0]} {scene.size[1]}" SKEW="0" TYPE="Vue_VIDEO" USERID="{row + 1}">\n'
            f'<ControlFrames/><KeyFrames><KeyFrame FOCAL_LENGTH="{float(K[0, 0])!r}" FRAME="0" IMAGE_ERROR="0.2" '
            f'ORIENTATION="{_text(quat)}" POSITION="{_text(place)}" PRINCIPAL_POINT="{_text(K[:2, 2])}" {lens}/>'
            "</KeyFrames></Camera>"
        )
    rows.append('<Camera DEVICEID="99" SENSOR_SIZE="4704 3456" TYPE="T160"><KeyFrames/></Camera>')  # not calibrated
    content = '<?xml version="1.0" encoding="UTF-8" standalone="no" ?>\n<Cameras VERSION="1.0">\n' + "\n".join(rows)
    (folder / "Walk01.xcp").write_text(content + "\n</Cameras>\n", encoding="utf-8")


def _text(values: np.ndarray | list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
