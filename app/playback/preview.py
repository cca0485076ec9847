"""A capture before anything is trained: a hint at once, a first rough cloud after some seconds.

The hint places every camera's picture in space. The cloud is made by the same reconstruction as the real one, from
small pictures of a single moment, in a short separate process: compiling and computing must not hold up a window.
"""

from __future__ import annotations

import logging
from pathlib import Path

import msgspec
import numpy as np

from app.background.jobs import JobContext
from app.playback.capture_pictures import downsized
from app.playback.modes.arrays import PointArrays
from app.playback.point_spacing import point_spacing
from engine.camera.projection import to_world
from engine.capture.capture import Capture, open_capture
from engine.children.child import Parent
from engine.children.kind import ChildFailed, ChildKind
from engine.children.process import run_child
from engine.errors import EngineError, PreparationError, ProjectError
from engine.storage.array_files import ArraysError, read_arrays, write_arrays

logger = logging.getLogger(__name__)

PICTURE_WIDTH_PX = 40
DEPTH_SHARE = 0.16
"""The pictures of the hint stand this share of the way from their camera to the focus point."""
CLOUD_WIDTH_PX = 200
"""Pictures for the first cloud are at most this wide."""
MAX_CLOUD_POINTS = 20_000
NEXT_STEPS = {
    "Depths": "sweeping planes",
    "Depth sweep": "refining surfaces",
    "Slanted patches": "joining points",
    "Depth maps": "joining points",
    "Static cloud": "colouring points",
    "White balance": "looking behind what is seen",
}
"""The stage after a line of the reconstruction, by how the line begins."""


def picture_hint(capture: Capture, frame_index: int) -> PointArrays:
    """Small pictures of all cameras as points in front of them.

    Raises:
        CaptureError: A picture cannot be decoded.
    """
    rig = capture.rig
    focus = rig.focus_point()
    points, colors = [], []
    for camera in range(len(rig)):
        image = downsized(capture.frame(camera, frame_index), PICTURE_WIDTH_PX)
        height, width = image.shape[:2]
        ratio = rig.image_sizes[camera] / np.array([width, height])
        u, v = np.meshgrid((np.arange(width) + 0.5) * ratio[0], (np.arange(height) + 0.5) * ratio[1])
        pixels = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3)
        depth = DEPTH_SHARE * float(np.linalg.norm(focus - rig.centers[camera]))
        p_camera = depth * pixels @ np.linalg.inv(rig.Ks[camera]).T
        points.append(to_world(p_camera, rig.world_to_camera[camera]))
        colors.append(image.reshape(-1, 3) / 255.0)
    return PointArrays(
        np.concatenate(points).astype(np.float32),
        np.concatenate(colors).astype(np.float32),
        ("hint", capture.fingerprint, frame_index),
        kind="pictures",
    )


class CloudJob(msgspec.Struct, frozen=True):
    """The inputs of the first cloud.

    Attributes:
        capture: The capture.
        holdout: Cameras to leave out, as training does.
        path: File for the cloud.
        frames, follow_links, is_growing: As of the capture, see engine.capture.capture.
    """

    capture: Path
    holdout: tuple[int, ...]
    path: Path
    frames: tuple[int, int] | None = None
    follow_links: bool = False
    is_growing: bool = False


FIRST_CLOUD: ChildKind[CloudJob, str, None] = ChildKind(
    place="app.playback.preview:FIRST_CLOUD",
    work="app.playback.preview:write_cloud",
    what="the process that builds it",
    job=CloudJob,
    event=str,
    priority="lower",
)


def make_cloud(job: CloudJob, context: JobContext) -> Path:
    """Build the first cloud in a process and wait for it. To be run on a job's thread.

    Args:
        context: Receives signs of life; cancelling it ends the process.
    Raises:
        PreparationError: There is no cloud; states the cause.
    """
    doing = "starting a process"

    def tell(what: str) -> None:
        nonlocal doing
        doing = what
        context.report(0.0, what)

    try:
        run_child(FIRST_CLOUD, job, report=tell, alive=lambda: context.report(0.0, doing))
    except (ChildFailed, EngineError) as error:
        raise PreparationError(f"The first cloud could not be built: {error}") from error
    return job.path


def write_cloud(job: CloudJob, parent: Parent[str]) -> None:
    """Build and write the first cloud. Runs in the child, which reports its progress."""

    def report(line: str) -> None:
        logger.debug(line)
        parent.report(NEXT_STEPS.get(line.partition(":")[0], "finding surfaces"))

    parent.report("loading")
    from engine.cloud.stereo.static_cloud import build_static_cloud

    capture = open_capture(job.capture, frames=job.frames, follow_links=job.follow_links, is_growing=job.is_growing)
    widest = int(capture.rig.image_sizes[:, 0].max())
    if widest > CLOUD_WIDTH_PX:
        capture = capture.resized(CLOUD_WIDTH_PX / widest, job.frames)
    cameras = capture.training_cameras(job.holdout)
    parent.report(f"reading {len(cameras)} pictures")
    pictures = np.stack([capture.frame(camera, 0) for camera in cameras])
    parent.report("looking for the depth range")
    is_valid = capture.valid_of(cameras)
    cloud = build_static_cloud(
        pictures,
        np.ones(pictures.shape[:3], bool) if is_valid is None else is_valid,
        capture.rig.subset(cameras),
        is_valid=is_valid,
        max_points=MAX_CLOUD_POINTS,
        report=report,
    )
    arrays = {
        "points": np.ascontiguousarray(cloud.points, np.float32),
        "colors": np.ascontiguousarray(np.clip(cloud.colors, 0.0, 1.0), np.float32),
    }
    write_arrays(job.path, arrays, {}, what="The first cloud")


def read_cloud(path: Path) -> PointArrays:
    """A cloud written by `write_cloud`.

    Raises:
        ProjectError: The file is missing or damaged.
    """
    try:
        arrays, _ = read_arrays(path, ())
        points, colors = arrays["points"], arrays["colors"]
        if points.ndim != 2 or points.shape[1] != 3 or points.shape != colors.shape:
            raise ArraysError(f"its points are {points.shape}, its colours {colors.shape}")
        if {points.dtype, colors.dtype} != {np.dtype(np.float32)} or not np.isfinite([points, colors]).all():
            raise ArraysError("its numbers are not finite floats")
    except (OSError, ArraysError, KeyError) as error:
        raise ProjectError(f"The first cloud cannot be read ({error}).", path=path) from error
    key = ("first cloud", str(path), path.stat().st_mtime_ns)
    return PointArrays(points, colors, key, kind="moment", spacing=point_spacing(points))
