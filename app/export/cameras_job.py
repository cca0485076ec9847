"""The cameras of a project's capture for other programs: as COLMAP's sparse model, as transforms.json, or as USD."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.evaluation.headless import TrainedProject
from app.export.export_progress import ExportEstimate, ExportProgress, ExportResult, Report, written
from app.export.gaussians.file_place import file_meters_per_unit, file_world
from app.export.jobs.cameras import CamerasJob
from app.export.staging import check_target, staged_folder
from app.export.usd_cameras import write_usd_cameras
from engine.camera.corrections import corrected_camera
from engine.capture.frames import ImageFrames
from engine.capture.layout.format_result import CameraEntry, Layout
from engine.capture.writers.conversion import convert
from engine.export.sequences.table import SEQUENCES
from engine.export.world import FileWorld

ROW_BYTES = {"colmap": 240, "transforms": 720, "usd": 900}
SAMPLE_BYTES = 400
"""Of a camera path, at a frame, as USD."""
WORLD = (
    "Cameras are in the coordinates and units of the capture, as are Gaussians that were neither turned nor scaled; "
    "frames are not copied."
)
USD_WORLD = "Cameras stand where USD files of the Gaussians have the scene ({})."


def estimate(opened: TrainedProject, job: CamerasJob) -> ExportEstimate:
    """See `JobModule`. Raises ProjectError where its entries do not go together."""
    job.check()
    layout = opened.capture.layout
    if job.format == "usd":
        n_samples = layout.n_frames * len(opened.project.document.camera_paths)
        lines = (USD_WORLD.format(_usd_world(opened, job).text),)
        return ExportEstimate(1, len(layout.cameras) * ROW_BYTES["usd"] + n_samples * SAMPLE_BYTES, lines)
    points = layout.points.stat().st_size if layout.points is not None and layout.points.is_file() else 0
    has_images = all(isinstance(entry.source, ImageFrames) for entry in layout.cameras)
    n_rows = len(layout.cameras) * (layout.n_frames if job.format == "transforms" and has_images else 1)
    n_files = 3 if job.format == "colmap" else 1 + (points > 0)
    return ExportEstimate(n_files, n_rows * ROW_BYTES[job.format] + points, (WORLD,))


def run(opened: TrainedProject, job: CamerasJob, report: Report) -> ExportResult:
    """See `JobModule`.

    Raises:
        CaptureError: The layout has no words for a lens.
        ProjectError: The folder cannot be written, or USD's library is missing.
    """
    n_cameras = len(opened.capture.layout.cameras)
    expected = estimate(opened, job)
    check_target(job.out, opened=opened, n_bytes=expected.n_bytes, is_folder=True)
    report(ExportProgress(0, n_cameras, "cameras"))
    layout, lines = _as_trained(opened)
    if job.format == "usd":
        world = _usd_world(opened, job)
        with staged_folder(job.out, what="The export") as folder:
            notes = write_usd_cameras(
                folder,
                layout.cameras,
                opened.project.document.camera_paths,
                n_frames=layout.n_frames,
                fps=layout.fps,
                world=world,
                meters_per_unit=file_meters_per_unit(opened, world),
            )
    else:
        notes = convert(layout, job.out, job.format).lines
    report(ExportProgress(n_cameras, n_cameras, "cameras"))
    return written(job.out, lines=(*expected.lines, *lines, *notes))


def _usd_world(opened: TrainedProject, job: CamerasJob) -> FileWorld:
    return file_world(opened, job, usual_up=SEQUENCES["usd"].up)


def _as_trained(opened: TrainedProject) -> tuple[Layout, tuple[str, ...]]:
    """The capture with its cameras as the reference clip refined them, and a sentence where it did."""
    layout, reference = opened.capture.layout, opened.reference
    corrections = None if reference is None else reference.corrections
    if reference is None or corrections is None:
        return layout, ()
    found = dict(zip(reference.header.camera_names, corrections.astype(np.float64), strict=True))
    cameras = tuple(
        _corrected(entry, found[entry.name]) if entry.name in found and found[entry.name].any() else entry
        for entry in layout.cameras
    )
    n_corrected = sum(new is not old for new, old in zip(cameras, layout.cameras, strict=True))
    if not n_corrected:
        return layout, ()
    which = "1 camera was" if n_corrected == 1 else f"{n_corrected} cameras were"
    said = f"{which} refined in training and exported as refined; all others are as in the capture."
    return replace(layout, cameras=cameras), (said,)


def _corrected(entry: CameraEntry, values: np.ndarray) -> CameraEntry:
    world_to_camera, K = corrected_camera(entry.world_to_camera, entry.K, values)
    return replace(entry, world_to_camera=world_to_camera, K=K)
