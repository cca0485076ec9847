"""Cameras for compositing: those of the capture and the camera paths of a project as a USD stage.

A camera of USD looks along -z with +y up, its matrices stand on the right of row vectors, and its film is measured in
tenths of a scene unit: here it is 36 wide, so that focal lengths read as those of a 35 mm camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from engine.camera.camera_path import CameraPath
from engine.capture.layout.format_result import CameraEntry
from engine.export.usd_library import state_unit, usd_module, writing_usd
from engine.export.world import FileWorld

FILE = "cameras.usda"
FILM = 36.0
"""Width of the film. A path has no size of its own: its film is as high as that of 16:9."""
PATH_ASPECT = 16.0 / 9.0
CLIPPING = (1e-3, 1e6)
_TO_USD = np.diag([1.0, -1.0, -1.0, 1.0])
"""From x right, y down, z forward to x right, y up, z backwards."""


def write_usd_cameras(
    folder: Path,
    cameras: Sequence[CameraEntry],
    paths: Sequence[CameraPath],
    *,
    n_frames: int,
    fps: float,
    world: FileWorld,
    meters_per_unit: float | None,
) -> tuple[str, ...]:
    """Write cameras.usda. Time codes are frames of the capture.

    Args:
        folder: It is there.
        cameras: Of the capture, which stand still.
        paths: With a sample at each frame.
        n_frames, fps: Of the capture.
        world: Where the scene lies in the stage.
        meters_per_unit: Of the stage; None where unknown.
    Returns:
        Sentences about what USD does not hold.
    Raises:
        ProjectError: USD's library is missing.
        OSError: The disk refused.
    """
    Usd, UsdGeom = usd_module("Usd"), usd_module("UsdGeom")
    with writing_usd():
        stage = Usd.Stage.CreateNew(str(folder / FILE))
    axis, lines = _up_axis(np.array(world.up))
    UsdGeom.SetStageUpAxis(stage, axis)
    state_unit(stage, meters_per_unit)
    stage.SetFramesPerSecond(fps)
    stage.SetTimeCodesPerSecond(fps)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(n_frames - 1)
    root = UsdGeom.Xform.Define(stage, "/cameras")
    stage.SetDefaultPrim(root.GetPrim())
    moving = [path for path in paths if path.keys]
    names = _names([*(entry.name for entry in cameras), *(path.name for path in moving)])
    for entry, name in zip(cameras, names, strict=False):
        _write_camera(UsdGeom.Camera.Define(stage, f"/cameras/{name}"), entry, world)
    frames = np.arange(n_frames, dtype=np.float64)
    for path, name in zip(moving, names[len(cameras) :], strict=True):
        _write_path(UsdGeom.Camera.Define(stage, f"/cameras/{name}"), path, frames, world)
    with writing_usd():
        stage.GetRootLayer().Save()
    n_bent = sum(not entry.lens.is_pinhole for entry in cameras)
    if n_bent:
        what = "The lens of 1 camera bends" if n_bent == 1 else f"The lenses of {n_bent} cameras bend"
        lines += (f"{what} straight lines, which USD does not hold: take that out of footage first.",)
    empty = [path.name for path in paths if not path.keys]
    return (*lines, *(f"The camera path '{name}' has no keys and is left out." for name in empty))


def _up_axis(up: np.ndarray) -> tuple[str, tuple[str, ...]]:
    """Y or Z, whichever is nearer to up in the stage, and a sentence where neither is near."""
    axis = "Y" if abs(up[1]) >= abs(up[2]) else "Z"
    along = float(up["XYZ".index(axis)])
    if along > 0.99:
        return axis, ()
    direction = ", ".join(f"{value:.3g}" for value in up)
    said = f"USD knows y and z as the way up. Up is ({direction}) here, and the stage says {axis}."
    return axis, (said,)


def _names(wanted: Sequence[str]) -> list[str]:
    """Names as USD allows them, each different."""
    Tf = usd_module("Tf")
    found: list[str] = []
    for name in wanted:
        plain = base = Tf.MakeValidIdentifier(name or "camera")
        number = 2
        while plain in found:
            plain, number = f"{base}_{number}", number + 1
        found.append(plain)
    return found


def _matrix(world_to_camera: np.ndarray, world: FileWorld) -> Any:
    Gf = usd_module("Gf")
    to_world = world.placed_cameras(world_to_camera[None])[0] @ _TO_USD
    return Gf.Matrix4d(*to_world.T.ravel().tolist())


def _write_camera(camera: Any, entry: CameraEntry, world: FileWorld) -> None:
    Gf = usd_module("Gf")
    camera.AddTransformOp().Set(_matrix(entry.world_to_camera, world))
    (width, height), K = entry.image_size, entry.K
    per_pixel = FILM / width
    camera.CreateHorizontalApertureAttr(FILM)
    # pixels that are not square: the film is as high as the lens sees
    camera.CreateVerticalApertureAttr(height * per_pixel * K[0, 0] / K[1, 1])
    camera.CreateHorizontalApertureOffsetAttr((width / 2 - K[0, 2]) * per_pixel)
    camera.CreateVerticalApertureOffsetAttr((K[1, 2] - height / 2) * per_pixel * K[0, 0] / K[1, 1])
    camera.CreateFocalLengthAttr(K[0, 0] * per_pixel)
    camera.CreateClippingRangeAttr(Gf.Vec2f(*CLIPPING))


def _write_path(camera: Any, path: CameraPath, frames: np.ndarray, world: FileWorld) -> None:
    Gf = usd_module("Gf")
    poses, fovs_rad = path.poses(frames)
    place = camera.AddTransformOp()
    height = FILM / PATH_ASPECT
    camera.CreateHorizontalApertureAttr(FILM)
    camera.CreateVerticalApertureAttr(height)
    camera.CreateClippingRangeAttr(Gf.Vec2f(*CLIPPING))
    focal = camera.CreateFocalLengthAttr()
    for frame, pose, fov_rad in zip(frames, poses, fovs_rad, strict=True):
        place.Set(_matrix(pose, world), frame)
        focal.Set(float(height / 2 / np.tan(fov_rad / 2)), frame)
