"""From a folder of plain videos to calibrated cameras, by a child process: see engine.calibration.child.

Nothing is written but temporary files, and the folder of videos is only read.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import msgspec
import numpy as np

from engine.calibration.calibrated import CalibratedRig, Calibration, MissingCamera
from engine.calibration.options import CalibrationOptions
from engine.calibration.videos import find_videos
from engine.camera.lens import Lens
from engine.camera.rig import CameraRig
from engine.children.running import STALL_S, child_folder, run_child
from engine.errors import CaptureError, PreparationError
from engine.progress import Progress, ReportProgress
from engine.storage.files import disk_error

FOLDER_PREFIX = "clipgstream-calibration-"


def calibrate(
    folder: Path,
    options: CalibrationOptions,
    *,
    report: ReportProgress,
    alive: Callable[[], None] = lambda: None,
    stall_s: float = STALL_S,
) -> Calibration:
    """Find the cameras of a folder of plain videos.

    Args:
        folder: One video, or one folder of images, per camera.
        options: Lens, scale, up.
        report: Told stage and share of the whole that is done. What it raises ends the work.
        alive: Called several times a second; what it raises ends the work within a moment.
        stall_s: Seconds without any work of the child after which it is taken for hung.
    Raises:
        CaptureError: The folder has no videos that can be used, or an option names a camera that is not there.
        PreparationError: The cameras could not be found from these videos; says what helps.
        DiskError: There is no room for temporary files.
    """
    names = [video.name for video in find_videos(folder)]
    check_distance(options, names, folder)
    with child_folder(FOLDER_PREFIX, what="Temporary files of the calibration") as scratch:
        job, result = scratch / "job.json", scratch / "result.npz"
        told = _Told(job.with_name("progress.json"), report)

        def look() -> None:
            alive()
            told.look()

        try:
            job.write_bytes(msgspec.json.encode({"folder": str(folder.absolute()), "options": options}))
        except OSError as error:
            raise disk_error(error, what="Temporary files of the calibration", path=job) from error
        reason, _ = run_child(
            "engine.calibration.child", job, result, what="The calibration process", alive=look, stall_s=stall_s
        )
        if reason:
            raise PreparationError(f"{reason}.", hint="Try again; the log may say more.", path=folder)
        return _read_result(result, folder)


def check_distance(options: CalibrationOptions, names: list[str], folder: Path) -> None:
    """Refuse a distance between cameras that are not there, between a camera and itself, or not above 0."""
    known = options.distance
    if known is None:
        return
    hint = f"Cameras are {', '.join(names[:8])}{' and more' if len(names) > 8 else ''}."
    for name in (known.first, known.second):
        if name not in names:
            raise CaptureError(f"There is no camera '{name}'.", hint=hint, path=folder)
    if known.first == known.second or not (np.isfinite(known.metres) and known.metres > 0):
        text = f"The distance from {known.first} to {known.second} is {known.metres:g} m."
        raise CaptureError(text, hint="Give a distance above 0 between two cameras.", path=folder)


class _Told:
    """What the child has said last."""

    def __init__(self, path: Path, report: ReportProgress) -> None:
        self._path, self._report, self._last = path, report, b""

    def look(self) -> None:
        """Pass on what is new."""
        with suppress(OSError):
            said = self._path.read_bytes()
            if said == self._last:
                return
            self._last = said
            document = json.loads(said)
            self._report(Progress(document["stage"], document["done"], document["message"]))


def _read_result(path: Path, folder: Path) -> Calibration:
    with np.load(path) as arrays:
        document = json.loads(str(arrays["document"]))
        if "error" in document:
            kind = CaptureError if document["is_bad_input"] else PreparationError
            raise kind(document["error"], hint=document["hint"], path=folder)
        rig = CameraRig(
            tuple(document["names"]), arrays["world_to_camera"], arrays["Ks"], arrays["image_sizes"].astype(np.int64)
        )
        found = CalibratedRig(
            rig=rig,
            lenses=tuple(Lens(document["lens_model"], tuple(row)) for row in arrays["lens_params"].tolist()),
            points=arrays["points"],
            point_errors_px=arrays["point_errors_px"],
            camera_errors_px=arrays["camera_errors_px"],
            n_sightings=arrays["n_sightings"],
            explained_shares=arrays["explained_shares"],
            doubts=tuple(document["doubts"]),
            is_metric=document["is_metric"],
            up=document["up"],
        )
    missing = tuple(MissingCamera(**row) for row in document["missing"])
    return Calibration(found, missing, tuple(document["warnings"]))
