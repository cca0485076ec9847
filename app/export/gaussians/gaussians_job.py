"""Frames of a trained project as files of Gaussians: a folder with a file per frame, read back and measured, and a
document next to them that describes them."""

from __future__ import annotations

import time
from collections import Counter

from app.background.kernels import use_threads
from app.evaluation.headless import TrainedProject
from app.export.edits.written_edits import written_edits
from app.export.expected_rows import expected_rows
from app.export.export_progress import ExportEstimate, ExportProgress, ExportResult, Report, written
from app.export.gaussians.file_place import file_world
from app.export.gaussians.gaussian_files import SIDECAR
from app.export.gaussians.gaussian_sequence import GaussianSequence
from app.export.jobs.gaussians import GaussiansJob
from app.export.scene_frames import SceneFrames
from app.export.staging import check_target, staged_folder
from app.export.take import take_frames
from engine.errors import ProjectError
from engine.export.formats.table import FORMATS, FULL_PLY, Format
from engine.storage.json_files import json_text


def estimate(opened: TrainedProject, job: GaussiansJob) -> ExportEstimate:
    """Numbers of files and bytes, from the headers of the clips. Raises ProjectError where a frame is not trained."""
    scene = _scene(opened, job)
    frames = take_frames(scene, job.frames, has_timing=job.has_timing)
    stretches = Counter((scene.clip_at(one.frame).clip_index, scene.effects(one.frame)) for one in frames)
    n_gaussians = 0
    for (clip_index, _), n_frames in stretches.items():  # as many as there are without edits
        n_static, n_moving = expected_rows(opened.header(clip_index))
        if job.part in ("static", "split"):
            n_gaussians += n_static
        if job.part != "static":
            n_gaussians += n_frames * (n_moving + (n_static if job.part == "all" else 0))
    n_files = (0 if job.part == "static" else len(frames)) + (len(stretches) if job.part in ("static", "split") else 0)
    text = f"Coordinates: {file_world(opened, job, is_rub=job.axes == 'rub').text}."
    return ExportEstimate(n_files + 1, round(n_gaussians * _kind(job).bytes_each), (text,))


def run(opened: TrainedProject, job: GaussiansJob, report: Report) -> ExportResult:
    """Write the files; memory does not grow with the number of frames.

    Args:
        report: Receives the progress; an exception from it ends the work, and then nothing is left.
    Raises:
        ProjectError: A frame is not trained, the folder is taken, or a value does not fit the format.
        DiskError: The disk refused.
    """
    started_s = time.monotonic()
    scene = _scene(opened, job)
    frames = take_frames(scene, job.frames, has_timing=job.has_timing)
    n_threads = use_threads(None)  # of this process: next to a training, a job has but one
    sequence = GaussianSequence(
        scene, frames, job.part, _kind(job), file_world(opened, job, is_rub=job.axes == "rub"), n_threads=n_threads
    )
    check_target(job.out, opened=opened, is_folder=True)
    report(ExportProgress(0, len(frames), message="Checking the clips"))
    scene.check(moment.frame for one in frames for moment in one.moments)
    check_target(job.out, n_bytes=estimate(opened, job).n_bytes, is_folder=True)
    with staged_folder(job.out, what="The export") as folder:
        sequence.write(folder, report)
        document = sequence.document() | {
            "settings": {"format": job.format, "part": job.part, "axes": job.axes, "up": job.up, "scale": job.scale}
            | ({"fields": job.fields} if job.fields != "usual" else {}),
            "seconds": round(time.monotonic() - started_s, 2),
        }
        (folder / f"{sequence.name}{SIDECAR}").write_text(json_text(document, indent=1) + "\n", encoding="utf-8")
    return written(job.out, psnr_db=sequence.psnr_db, lines=sequence.lines())


def _scene(opened: TrainedProject, job: GaussiansJob) -> SceneFrames:
    return SceneFrames(opened, edits=written_edits(opened.project.document, job))


def _kind(job: GaussiansJob) -> Format:
    if job.fields == "full" and job.format != "ply":
        raise ProjectError(f"'{job.format}' has no choice of fields.", hint="Only ply has fields; leave them out.")
    return FULL_PLY if job.fields == "full" else FORMATS[job.format]
