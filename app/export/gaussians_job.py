"""Frames of a trained project as files of Gaussians: a folder with a file per frame, read back and measured, and a
document beside them that says what they are."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from app.background.kernels import use_threads
from app.evaluation.headless import TrainedProject
from app.export.expected_rows import expected_rows
from app.export.export_progress import ExportEstimate, ExportProgress, ExportResult, Report, written
from app.export.gaussian_files import SIDECAR, WrittenPart
from app.export.gaussian_sequence import GaussianSequence
from app.export.picked_frames import PickedFrames
from app.export.scene_frames import SceneFrames
from app.export.staging import check_target, staged_folder
from engine.errors import ProjectError
from engine.export.formats.table import FORMATS, Format
from engine.export.world import AXES, World, world
from engine.storage.json_files import json_text

FileAxes = Literal["ply", "rub"]
_SCALES = (1e-6, 1e6)


@dataclass(frozen=True, slots=True)
class GaussiansJob:
    """What is asked for.

    Attributes:
        out: A new or empty folder.
        format: One of `engine.export.formats.table.FORMATS`.
        frames: Of the capture; None for all that are trained.
        part: What is written; "static" once as long as it stays the same, "moving" per frame, "split" both.
        up: Axis of the files that the scene's up is turned to, one of `engine.export.world.AXES`; None leaves it.
        scale: Units of the files per scene unit; None for metres where the user has said how long a scene unit is, else
            1.
        axes: "ply" as they are; "rub" turned by 180 degrees about x, for programs of Niantic.
        has_edits: Whether the edits of the project are applied.
        scene_up: Which way is up in the capture; None for what the user has said of the project, else for what its
            cameras agree on. [3]
    """

    out: Path
    format: str = "ply"
    frames: range | PickedFrames | None = None
    part: WrittenPart = "all"
    up: str | None = None
    scale: float | None = None
    axes: FileAxes = "ply"
    scene_up: tuple[float, float, float] | None = None
    has_edits: bool = True


def estimate(opened: TrainedProject, job: GaussiansJob) -> ExportEstimate:
    """How many files and bytes, of the headers of the clips. Raises ProjectError where a frame is not trained."""
    scene = _scene(opened, job)
    frames = _frames(scene, job)
    stretches = Counter((scene.clip_at(frame).clip_index, scene.effects(frame)) for frame in frames)
    n_gaussians = 0
    for (clip_index, _), n_frames in stretches.items():  # as many as there are without edits
        n_static, n_moving = expected_rows(opened.header(clip_index))
        if job.part in ("static", "split"):
            n_gaussians += n_static
        if job.part != "static":
            n_gaussians += n_frames * (n_moving + (n_static if job.part == "all" else 0))
    n_files = (0 if job.part == "static" else len(frames)) + (len(stretches) if job.part in ("static", "split") else 0)
    text = f"Coordinates: {_world(opened, job).text}."
    return ExportEstimate(n_files + 1, round(n_gaussians * _kind(job).bytes_each), (text,))


def run(opened: TrainedProject, job: GaussiansJob, report: Report) -> ExportResult:
    """Write the files; memory does not grow with the number of frames.

    Args:
        report: Told how far it is; what it raises ends the work, and then nothing is left.
    Raises:
        ProjectError: A frame is not trained, the folder is taken, or a value does not fit the format.
        DiskError: The disk refused.
    """
    started_s = time.monotonic()
    scene = _scene(opened, job)
    frames = _frames(scene, job)
    n_threads = use_threads(None)  # of this process: a job beside a training has but one
    sequence = GaussianSequence(scene, frames, job.part, _kind(job), _world(opened, job), n_threads=n_threads)
    check_target(job.out, opened=opened, is_folder=True)
    report(ExportProgress(0, len(frames), message="Checking the clips"))
    scene.check(frames)
    check_target(job.out, n_bytes=estimate(opened, job).n_bytes, is_folder=True)
    with staged_folder(job.out, what="The export") as folder:
        sequence.write(folder, report)
        document = sequence.document() | {
            "settings": {"format": job.format, "part": job.part, "axes": job.axes, "up": job.up, "scale": job.scale},
            "seconds": round(time.monotonic() - started_s, 2),
        }
        (folder / f"{sequence.name}{SIDECAR}").write_text(json_text(document, indent=1) + "\n", encoding="utf-8")
    return written(job.out, psnr_db=sequence.psnr_db, lines=sequence.lines())


def _scene(opened: TrainedProject, job: GaussiansJob) -> SceneFrames:
    return SceneFrames(opened, edits=None if job.has_edits else ())


def _frames(scene: SceneFrames, job: GaussiansJob) -> list[int]:
    frames = scene.trained_frames if job.frames is None else list(job.frames)
    for frame in frames:
        scene.clip_at(frame)
    if not frames:
        raise ProjectError("There are no frames to export.", path=scene.opened.project.folder)
    return frames


def _kind(job: GaussiansJob) -> Format:
    if job.format not in FORMATS:
        raise ProjectError(f"There is no format '{job.format}'.", hint=f"Formats are {', '.join(FORMATS)}.")
    return FORMATS[job.format]


def _world(opened: TrainedProject, job: GaussiansJob) -> World:
    """Where the scene lies in the files. Raises ProjectError where that cannot be."""
    if job.up is not None and job.up not in AXES:
        raise ProjectError(f"There is no axis '{job.up}'.", hint=f"Axes are {', '.join(AXES)}.")
    said = opened.project.document.world.meters_per_unit
    scale = job.scale if job.scale is not None else 1.0 if said is None else said
    if not _SCALES[0] <= scale <= _SCALES[1]:
        raise ProjectError(f"The scale is {scale:g}.", hint=f"Give a number from {_SCALES[0]} to {_SCALES[1]:.0f}.")
    scene_up = opened.up if job.scene_up is None else np.array(job.scene_up)
    return world(scene_up, up=job.up, scale=scale, is_rub=job.axes == "rub")
