"""Videos as a kind of export: what one will write, and its work with progress in pictures."""

from __future__ import annotations

from collections.abc import Iterable

from app.evaluation.headless import TrainedProject
from app.export.export_progress import ExportEstimate, ExportProgress, ExportResult, Report, written
from app.export.jobs.video import VideoJob
from app.export.scene_frames import SceneFrames
from app.export.video.formats import FORMATS
from app.export.video.plan import VideoPlan, plan_video
from app.export.video.render import render_video
from engine.progress import Progress
from engine.text import rate_text


def estimate(opened: TrainedProject, job: VideoJob) -> ExportEstimate:
    """See `JobModule`. Raises as `plan_video` does."""
    plan = _plan(opened, job)
    kind, (width, height) = FORMATS[job.format], plan.picture_size
    n_pictures = len(plan.moments)
    n_bytes = round(kind.bytes_per_pixel * width * height * n_pictures)
    length = f"{rate_text(plan.fps)} per second: {n_pictures / plan.fps:.1f} s."
    said = f"{n_pictures:,} pictures of {width} x {height}, {length}"
    return ExportEstimate(n_pictures if kind.is_sequence else 1, n_bytes, (said, *plan.notes))


def run(opened: TrainedProject, job: VideoJob, report: Report) -> ExportResult:
    """See `JobModule`. Raises as `render_video` does."""
    n_pictures = len(_plan(opened, job).moments)
    report(ExportProgress(0, n_pictures, "pictures"))

    def tell(progress: Progress) -> None:
        report(ExportProgress(round(progress.done * n_pictures), n_pictures, "pictures"))

    done = render_video(job, opened, tell)
    lines = list(done.notes)
    if done.depth_unit is not None:
        lines.append(f"A level of the pictures is {done.depth_unit:g} scene units of depth.")
    return written(job.out, lines=tuple(lines))


class _HeadersOnly(SceneFrames):
    """Frames that are looked at before the work, again and again: no clip is read for it."""

    def check(self, frames: Iterable[float]) -> None:
        self.check_trained(frames)


def _plan(opened: TrainedProject, job: VideoJob) -> VideoPlan:
    return plan_video(job, _HeadersOnly(opened, features=job.features))
