"""Frames of a trained project as one file over time, read back and measured."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from app.evaluation.headless import TrainedProject
from app.export.edits.written_edits import written_edits
from app.export.expected_rows import expected_rows
from app.export.export_progress import ExportEstimate, ExportProgress, ExportResult, Report, written
from app.export.gaussians.file_place import file_meters_per_unit, file_world
from app.export.gaussians.read_back import ReadBack
from app.export.jobs.sequence import SequenceJob
from app.export.scene_frames import SceneFrames
from app.export.sequences.scene_stretches import SceneStretches
from app.export.sequences.take_sound import RATE, SAMPLE_BYTES, take_sound
from app.export.staging import check_target, staged_file
from app.export.take import TakeFrame, take_frames, timing_of
from engine.errors import ProjectError
from engine.export.sequences.sequence import SequenceTiming
from engine.export.sequences.table import SEQUENCES, SequenceFormat

N_CHECKED = 5
"""Frames that are read back, spread over the file, from several cameras each."""


def estimate(opened: TrainedProject, job: SequenceJob) -> ExportEstimate:
    """The bytes, from the headers of the clips, and what the format cannot hold.

    Raises:
        ProjectError: The target cannot be written, a frame is not trained, or the format needs what is not there.
    """
    job.check()
    kind = SEQUENCES[job.format]
    kind.check()
    if job.out.suffix.lower() != kind.suffix:
        raise ProjectError(f"The name of this file has to end in {kind.suffix}.", path=job.out)
    check_target(job.out, opened=opened)
    scene = _scene(opened, job)
    frames = take_frames(scene, job.frames, has_timing=job.has_timing)
    fps = _fps(opened, job)
    n_bytes = RATE * SAMPLE_BYTES * len(frames) / fps if _has_sound(job, frames) else 0.0
    most_still, n_each = 0, Counter(scene.clip_at(one.frame).clip_index for one in frames)
    for clip_index, n_frames in n_each.items():
        n_still, n_moving = expected_rows(opened.header(clip_index))
        most_still = max(most_still, n_still)
        n_bytes += kind.moving_bytes * n_moving * n_frames
    n_bytes += kind.still_bytes * most_still * (1.0 + kind.still_again * (len(n_each) - 1))
    check_target(job.out, n_bytes=round(n_bytes))
    lines = (
        f"About {n_bytes / 1e6:.1f} MB for {len(frames)} frames at {fps:g} frames per second.",
        f"Coordinates: {file_world(opened, job, usual_up=kind.up).text}.",
        *kind.limits,
        *_sound_lines(job, frames),
    )
    return ExportEstimate(1, round(n_bytes), lines)


def run(opened: TrainedProject, job: SequenceJob, report: Report) -> ExportResult:
    """Write the file; memory does not grow with the number of frames, but of .tsog.

    Args:
        report: Receives the progress; an exception from it ends the work, and then nothing is left.
    Raises:
        ProjectError: As `estimate`; or the file that was written is not valid, and is not kept.
        CaptureError: The camera has no sound.
        DiskError: The disk refused.
    """
    estimate(opened, job)
    kind, scene = SEQUENCES[job.format], _scene(opened, job)
    world = file_world(opened, job, usual_up=kind.up)
    frames = take_frames(scene, job.frames, has_timing=job.has_timing)
    report(ExportProgress(0, len(frames), message="Checking the clips"))
    scene.check(moment.frame for one in frames for moment in one.moments)
    fps, sound = _fps(opened, job), None
    if job.sound is not None and _has_sound(job, frames):
        taken = timing_of(scene, has_timing=job.has_timing)
        sound = take_sound(opened.capture, job.sound, frames[0].number, taken, len(frames) / fps)
    stretches = SceneStretches(scene, frames, world, lambda n_done: report(ExportProgress(n_done, len(frames))))
    timing = SequenceTiming(len(frames), fps, sound, file_meters_per_unit(opened, world))
    with staged_file(job.out) as path:
        notes = kind.write(stretches, timing, path)
        report(ExportProgress(len(frames), len(frames), message="Reading the file back"))
        check = ReadBack(scene, world)
        figures = _checked(kind, path, scene, frames, check)
    lines = [f"Coordinates: {world.text}.", _measured(figures, kind), *notes, *_sound_lines(job, frames)]
    if stretches.n_dropped:
        lines.append(f"{stretches.n_dropped:,} Gaussians that cannot be drawn were left out.")
    return written(job.out, psnr_db=min(figures.values()), lines=tuple(lines))


def _checked(
    kind: SequenceFormat, path: Path, scene: SceneFrames, frames: Sequence[TakeFrame], check: ReadBack
) -> dict[int, float]:
    """PSNR of some frames of the file, from the worst of their cameras. Raises ProjectError where it is not valid."""
    if problems := kind.problems(path):
        raise ProjectError(f"The file that was written is not valid: {problems[0]}.", hint="Report this, please.")
    reader = kind.open(path)
    try:
        if reader.timing.n_frames != len(frames):
            raise ProjectError(f"The file has {reader.timing.n_frames} frames, {len(frames)} were written.")
        figures = {}
        for number in np.unique(np.linspace(0, len(frames) - 1, N_CHECKED).round().astype(int)).tolist():
            one = frames[number]
            live = scene.at_moments(one.moments)
            figures[number] = min(check.psnr_db(reader.splats(number), one.frame, live).values())
    finally:
        reader.close()
    return figures


def _measured(figures: dict[int, float], kind: SequenceFormat) -> str:
    worst = min(figures, key=figures.__getitem__)
    said = f"frame {worst} is the worst with {figures[worst]:.1f} dB against the live picture"
    if figures[worst] < kind.min_psnr_db:
        return (
            f"Warning: of {len(figures)} frames that were read back, {said}. At least {kind.min_psnr_db:.0f} dB were "
            f"expected of {kind.suffix}; check the file before use."
        )
    return f"{len(figures)} frame{'s were' if len(figures) > 1 else ' was'} read back and compared; {said}."


def _scene(opened: TrainedProject, job: SequenceJob) -> SceneFrames:
    return SceneFrames(opened, edits=written_edits(opened.project.document, job))


def _fps(opened: TrainedProject, job: SequenceJob) -> float:
    return opened.capture.fps / (1 if job.frames is None else job.frames.step)


def _has_sound(job: SequenceJob, frames: Sequence[TakeFrame]) -> bool:
    """Whether sound is asked for, and frames follow one another as it does."""
    step = 1 if job.frames is None else job.frames.step
    return job.sound is not None and bool((np.diff([one.number for one in frames]) == step).all())


def _sound_lines(job: SequenceJob, frames: Sequence[TakeFrame]) -> tuple[str, ...]:
    if job.sound is None or _has_sound(job, frames):
        return ()
    return ("The sound is left out, because frames are missing in between.",)
