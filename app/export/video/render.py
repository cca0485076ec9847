"""render_video: draw what a job asks for and write it, complete or not at all. Prints nothing."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import av.error

from app.background.jobs import JobCancelled
from app.evaluation.headless import TrainedProject
from app.export.jobs.video import VideoJob
from app.export.scene_frames import SceneFrames
from app.export.staging import staged_file, staged_folder
from app.export.video.formats import FORMATS
from app.export.video.passes import Painter, PassPicture
from app.export.video.plan import VideoPlan, plan_video
from app.export.video.writers.film import FilmWriter
from app.export.video.writers.sequence import write_depth_png, write_exr_picture, write_png
from app.training.rate import SmoothedRate
from engine.editing.effects import EditStack
from engine.errors import DiskError
from engine.progress import Progress, ReportProgress
from engine.text import duration_text

STAGE = "Rendering"


@dataclass(frozen=True, slots=True)
class WrittenVideo:
    """The written video or sequence of pictures.

    Attributes:
        out: The file, or the folder of a sequence.
        n_pictures: Number of pictures.
        size: Their width and height, pixels.
        fps: Pictures per second.
        n_bytes: Size of the file, or of all of them.
        depth_unit: Scene units per level of 16-bit depths; None where none were written.
        notes: Differences from what was asked for, in sentences.
    """

    out: Path
    n_pictures: int
    size: tuple[int, int]
    fps: float
    n_bytes: int
    depth_unit: float | None = None
    notes: tuple[str, ...] = ()


def render_video(
    job: VideoJob,
    opened: TrainedProject,
    report: ReportProgress = lambda progress: None,
    is_cancelled: Callable[[], bool] = lambda: False,
    *,
    n_threads: int | None = None,
) -> WrittenVideo:
    """Draw and write.

    Args:
        job: The video to render.
        opened: The project.
        report: Receives the progress after every picture, with rate and time left.
        is_cancelled: Asked before every picture.
        n_threads: Threads to draw with; None for all.
    Raises:
        MissingCodecError, ProjectError, CaptureError: The job cannot be done; said before anything is written, unless
            files vanish meanwhile.
        DiskError: The disk refused; nothing is left behind.
        JobCancelled: `is_cancelled` said so; nothing is left behind.
    """
    edits = None if job.has_edits else EditStack()
    scene = SceneFrames(opened, n_threads=n_threads, features=job.features, edits=edits)
    plan = plan_video(job, scene)
    painter = Painter(scene, job, plan.moments, plan.view_of, plan.step, is_take=plan.timing is not None)
    n, rate = len(plan.moments), SmoothedRate()
    rate.update(0, time.monotonic())
    with _writer(job, plan) as write:
        for number in range(n):
            if is_cancelled():
                raise JobCancelled
            write(number, painter.picture(number))
            rate.update(number + 1, time.monotonic())
            left = duration_text(rate.eta_s(n - number - 1))
            report(Progress(STAGE, (number + 1) / n, f"{number + 1}/{n}, {rate.per_s:.1f}/s, {left} left"))
    out = job.out
    files = list(out.iterdir()) if out.is_dir() else [out]
    n_bytes = sum(file.stat().st_size for file in files)
    return WrittenVideo(out, n, plan.picture_size, plan.fps, n_bytes, plan.depth_unit, plan.notes)


@contextmanager
def _writer(job: VideoJob, plan: VideoPlan) -> Iterator[Callable[[int, PassPicture], None]]:
    """Takes the number of a picture and the picture. What is written appears at the end of the block."""
    out, kind = job.out, FORMATS[job.format]
    if kind.is_sequence:
        with staged_folder(out, what="The folder of pictures") as folder:
            yield lambda number, picture: _write_file(folder, job, plan, number, picture)
        return
    with staged_file(out, what="The video") as partial, ExitStack() as stack:
        sound = None if plan.sound is None else stack.enter_context(plan.sound)
        film = FilmWriter(
            partial,
            job.format,
            fps=plan.fps,
            background=job.background,
            is_transparent=job.is_transparent,
            sound=sound,
        )
        try:
            with film:
                yield lambda number, picture: film.write(picture)
        except av.error.FFmpegError as error:
            if isinstance(error, OSError):
                raise
            raise DiskError(
                f"The video could not be written ({error.strerror}).", hint="Choose another format or size.", path=out
            ) from error


def _write_file(folder: Path, job: VideoJob, plan: VideoPlan, number: int, picture: PassPicture) -> None:
    path = folder / plan.name(number, f".{job.format}")
    if job.format == "exr":
        write_exr_picture(path, picture, job.shows)
    elif plan.depth_unit is not None:
        write_depth_png(path, picture, unit=plan.depth_unit)
    else:
        write_png(path, picture, background=job.background, is_transparent=job.is_transparent)
