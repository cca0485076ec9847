"""The plan of a job in a project: moments, views and names, with everything that can be said before the work."""

from __future__ import annotations

import math
from dataclasses import dataclass

from app.document.camera_paths import camera_path_named
from app.evaluation.headless import TrainedProject
from app.export.jobs.video import MAX_PICTURES, MAX_PIXELS, MAX_SIDE_PX, VideoJob
from app.export.scene_frames import SceneFrames
from app.export.staging import check_target
from app.export.take import taken_outputs, timing_of
from app.export.video.formats import FORMATS, check_codecs
from app.export.video.moments import Moment, moments_of, timed_moments
from app.export.video.timed_sound import TimedSound
from app.export.video.views import ViewOf, camera_view, path_view, turntable_view
from app.export.video.writers.film import SOUND_RATE
from app.export.video.writers.sequence import depth_unit
from app.playback.modes.view_modes import rig_distance
from engine.camera.camera_path import CameraPath
from engine.capture.capture import Capture
from engine.capture.files.frame_runs import runs_of
from engine.capture.files.sound import SoundReader, sound_source
from engine.errors import ProjectError
from engine.text import shown
from engine.timing.timing import TakeTiming

_DEPTH_REACH = 4.0
"""The reach of 16 bits of depth, in usual distances from a camera to what all of them look at."""


@dataclass(frozen=True, slots=True, eq=False)
class VideoPlan:
    """The pictures to draw and write.

    Attributes:
        moments: Of all pictures.
        step: Frames of the capture from one picture to the next.
        fps: Pictures per second.
        view_of: From where each picture is taken.
        picture_size: Width and height of the written pictures, pixels.
        sound: The sound, to be opened; None for silence.
        depth_unit: Scene units per level of a 16-bit picture of depths; None where none is written.
        notes: Differences from what was asked for, in sentences.
        timing: Of the take whose pictures these are; None where they are as captured.
    """

    moments: list[Moment]
    step: float
    fps: float
    view_of: ViewOf
    picture_size: tuple[int, int]
    sound: SoundReader | TimedSound | None = None
    depth_unit: float | None = None
    notes: tuple[str, ...] = ()
    timing: TakeTiming | None = None

    @property
    def is_frame_by_frame(self) -> bool:
        """Whether every picture shows another frame of the capture, in order, so that it can be named after it."""
        scenes = [moment.scene for moment in self.moments]
        return all(moment.is_whole for moment in self.moments) and scenes == sorted(set(scenes))

    def name(self, number: int, suffix: str) -> str:
        """File name of a picture of a sequence: by its frame of the capture, where it has one of its own."""
        if self.is_frame_by_frame:
            return f"frame_{round(self.moments[number].scene):06d}{suffix}"
        return f"picture_{number:06d}{suffix}"


def _path_named(scene: SceneFrames, name: str) -> CameraPath:
    project = scene.opened.project
    return camera_path_named(project.document.camera_paths, name, project.folder)


def plan_video(job: VideoJob, scene: SceneFrames) -> VideoPlan:
    """Check that a job can be done, and how. Writes nothing.

    Raises:
        MissingCodecError: This machine cannot encode the format.
        ProjectError: The job is not valid in this project, a clip is not trained or damaged, or there is no place
            for the result.
        CaptureError: The camera has no sound.
    """
    job.check()
    capture = scene.opened.capture
    fps = capture.fps if job.fps is None else job.fps
    step = job.speed * capture.fps / fps
    path = None if job.path is None else _path_named(scene, job.path)
    timing = timing_of(scene, has_timing=job.has_timing and job.hold is None)
    runs = _runs(job, scene, path) if timing is None else runs_of(taken_outputs(scene, timing, job.frames))
    if not runs:
        raise ProjectError("There are no frames to render.", path=scene.opened.project.folder)
    n_pictures = sum((len(run) - 1) / step + 1 for run in runs)
    if n_pictures > MAX_PICTURES:
        raise ProjectError(
            f"That makes {n_pictures:,.0f} pictures; at most {MAX_PICTURES:,} are written at once.",
            hint="Choose fewer frames, or a higher speed.",
        )
    moments = moments_of(runs, step, job.hold) if timing is None else timed_moments(timing, runs, step)
    if job.shows == "compare" and not all(moment.is_whole for moment in moments):
        raise ProjectError(
            "Side by side with the truth is possible at captured frames only, not between them.",
            hint="Leave speed and rate out, and the timing of the take.",
        )
    size = capture.picture_size if job.size is None else job.size
    _check_size(size, job.supersampling)
    view_of = _view_of(job, scene.opened, path, size, len(moments))
    sound, notes = _sound(job, capture, runs, timing)
    check_codecs(job.format, needs_sound=sound is not None)
    width, height = (3 * size[0], size[1]) if job.shows == "compare" else size
    kind = FORMATS[job.format]
    if kind.encoding is not None and kind.encoding.needs_even_sizes and (width % 2 or height % 2):
        even = width + width % 2, height + height % 2
        notes += (
            f"{kind.label.split(' in ')[0]} needs even sizes: {width} x {height} is written as {even[0]} x {even[1]}, "
            "with the last row or column repeated.",
        )
        width, height = even
    least_width, least_height = kind.min_size
    if width < least_width or height < least_height:
        raise ProjectError(
            f"{kind.label} holds pictures of at least {least_width} x {least_height}, not of {width} x {height}.",
            hint="Choose a larger size, or another format.",
        )
    n_bytes = round(kind.bytes_per_pixel * width * height * len(moments))
    check_target(job.out, opened=scene.opened, n_bytes=n_bytes, is_folder=kind.is_sequence)
    scene.check([part.frame for moment in moments for part in moment.sources])  # last, as it reads every clip
    unit = (
        depth_unit(_DEPTH_REACH * rig_distance(capture.rig)) if job.shows == "depth" and job.format == "png" else None
    )
    return VideoPlan(moments, step, fps, view_of, (width, height), sound, unit, notes, timing)


def _runs(job: VideoJob, scene: SceneFrames, path: CameraPath | None) -> list[range]:
    """Frames that pictures begin at."""
    n_frames = scene.opened.capture.n_frames
    if job.hold is not None:
        scene.clip_at(job.hold)  # inside of the capture
    if job.frames is None:
        if path is not None and len(path.keys) > 1:
            return [_frames_of(path, None if job.hold is not None else n_frames)]
        return runs_of(range(n_frames) if job.hold is not None else scene.trained_frames)
    (chosen,) = job.frames.runs
    first, stop = chosen.start, chosen.stop
    if not 0 <= first < stop <= n_frames:
        raise ProjectError(
            f"Frames {first}:{stop} were asked for, not all of which are in the capture.",
            hint=f"It has frames 0 to {n_frames - 1}.",
        )
    return [chosen]


def _frames_of(path: CameraPath, n_frames: int | None) -> range:
    """Frames during which a path moves; of a capture of so many, or wherever they are where that is None."""
    first, last = path.frame_range
    start, stop = math.ceil(first), math.floor(last) + 1
    if path.is_closed:  # back at its beginning, it has been there
        stop = math.ceil(last)
    if n_frames is not None:
        start, stop = max(start, 0), min(stop, n_frames)
    if start >= stop:
        raise ProjectError(
            f"The camera path {shown(path.name)} goes from {first:g} to {last:g}, outside the frames of the capture.",
            hint="Move its keys, or choose frames.",
        )
    return range(start, stop)


def _check_size(size: tuple[int, int], supersampling: int) -> None:
    """Check that pictures of this size can be drawn."""
    width, height = (side * supersampling for side in size)
    if max(width, height) > MAX_SIDE_PX or width * height > MAX_PIXELS:
        raise ProjectError(
            f"Pictures of {size[0]} x {size[1]} with supersampling {supersampling} would be drawn with {width} x "
            f"{height} pixels; at most {MAX_SIDE_PX} along a side and {MAX_PIXELS // 1_000_000} million in all can be.",
            hint="Choose a smaller size, or less supersampling.",
        )


def _view_of(
    job: VideoJob, opened: TrainedProject, path: CameraPath | None, size: tuple[int, int], n_pictures: int
) -> ViewOf:
    if path is not None:
        return path_view(path, size)
    if job.camera is not None:
        return camera_view(opened.rig, _camera(opened.capture, job.camera), job.size)
    assert job.turntable is not None
    return turntable_view(opened.rig, opened.up, job.turntable, n_pictures, size)


def _camera(capture: Capture, name: str) -> int:
    """Row of a camera. Raises CaptureError where there is none of this name."""
    return capture.camera_indices([name])[0]


def _sound(
    job: VideoJob, capture: Capture, runs: list[range], timing: TakeTiming | None
) -> tuple[SoundReader | TimedSound | None, tuple[str, ...]]:
    """The sound, and a note where it is left out."""
    if job.sound is None:
        return None, ()
    path, start_s = sound_source(capture, _camera(capture, job.sound), runs[0].start if timing is None else 0)
    if job.speed != 1.0:
        return None, (f"The sound is left out, because the scene plays at {job.speed:g} times its speed.",)
    if job.hold is not None:
        return None, ("The sound is left out, because time stands still.",)
    if len(runs) > 1:
        return None, ("The sound is left out, because frames are missing in between.",)
    if timing is None:
        return SoundReader(path, start_s, rate=SOUND_RATE), ()
    return TimedSound(path, start_s, timing, capture.fps, runs[0].start, rate=SOUND_RATE), ()
