"""SequencePlan: what a whole sequence costs on several workers: wall time, memory, bytes moved and worker-hours.

Each worker is taken to be as fast as the plans of clips say: as this process with the cores that it may use, or as the
clips trained before were. The reference clip is trained first and alone; then the others in their order, each by the
next worker that is free.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from app.plan.makespan import ends_of
from app.project.project import Project
from app.training.train_queue import needed_clips
from engine.capture.capture import Capture
from engine.capture.frame_bytes import frame_bytes
from engine.text import duration_text, figure_text
from engine.training.plan.plan import TrainingPlan

_BACKGROUND_BYTES_PER_PIXEL = 3 + 1 / 8
"""Colour, and whether it is stable."""


@dataclass(frozen=True, slots=True)
class SequencePlan:
    """What it costs to train some clips. A value; figures are None where one of a clip is not known.

    Attributes:
        n_workers: How many train at once.
        n_clips, video_s: What is trained, and how long it plays.
        seconds: Wall time.
        alone_s: Of that, what the reference clip takes, while other workers wait.
        busy: Share of the workers' time in which they train.
        memory_mb: Most that one worker holds, 10^6 bytes.
        side_by_side_mb: The same of as many as train at once, if all are on one machine.
        moved_mb: By clip: its pictures and its finished file, 10^6 bytes. Of a result that is not known, none.
        shared_mb: What source clips read besides: the reference clip and the backgrounds; once on each machine.
        all_moved_mb: All of it, with the shared part once for every worker that trains a source clip.
        worker_hours: Of all workers, from the beginning to the end.
        price: Of these, in the unit of the price that was given.
    """

    n_workers: int
    n_clips: int
    video_s: float
    seconds: float | None
    alone_s: float | None
    busy: float | None
    memory_mb: float
    side_by_side_mb: float
    moved_mb: Mapping[int, float]
    shared_mb: float
    all_moved_mb: float
    worker_hours: float | None
    price: float | None

    def of_minute(self, value: float | None) -> float | None:
        """A figure of the whole for a minute of video."""
        return None if value is None else value * 60.0 / self.video_s

    def as_dict(self) -> dict[str, Any]:
        """JSON-able; `moved_mb` is the mean of a clip there."""
        values = asdict(self) | {
            "moved_mb": self.mean_moved_mb,
            "worker_hours_per_minute": self.of_minute(self.worker_hours),
            "price_per_minute": self.of_minute(self.price),
        }
        return {name: round(value, 4) if isinstance(value, float) else value for name, value in values.items()}

    @property
    def mean_moved_mb(self) -> float:
        """`moved_mb`, the mean over the clips."""
        return sum(self.moved_mb.values()) / len(self.moved_mb)


def plan_sequence(
    project: Project,
    capture: Capture,
    plans: Sequence[TrainingPlan],
    *,
    n_workers: int,
    price_per_hour: float | None = None,
) -> SequencePlan:
    """The plan of a sequence.

    Args:
        project, capture: As planned.
        plans: Of its clips, at least one, in the order of training.
        n_workers: How many train at once.
        price_per_hour: Of a worker, in a unit of the user's.
    Raises:
        CaptureError: A file of the capture is gone.
    """
    config = project.settings.config()
    needs = {plan.clip_index: needed_clips(project, plan.clip_index, config) for plan in plans}
    seconds = {plan.clip_index: plan.seconds for plan in plans}
    known = {index: value for index, value in seconds.items() if value is not None}
    wall_s = busy_s = alone_s = None
    if len(known) == len(seconds):
        wall_s, busy_s = max(ends_of(known, needs, n_workers).values()), sum(known.values())
        is_needed = any(project.settings.reference_clip in needed for needed in needs.values())
        alone_s = known.get(project.settings.reference_clip, 0.0) if is_needed else 0.0
    sources = [plan for plan in plans if needs[plan.clip_index]]
    n_reading = min(n_workers, len(sources))
    bytes_of_frame = sum(frame_bytes(capture))
    moved_mb = {plan.clip_index: plan.n_frames * bytes_of_frame / 1e6 + (plan.disk_mb or 0.0) for plan in plans}
    shared_mb = _shared_mb(project, capture, plans) if sources else 0.0
    hours = None if wall_s is None else n_workers * wall_s / 3600.0
    most_mb = max(plan.memory_mb for plan in plans)
    beside_mb = sorted((plan.memory_mb for plan in sources or plans), reverse=True)[:n_workers]
    return SequencePlan(
        n_workers=n_workers,
        n_clips=len(plans),
        video_s=sum(plan.n_frames for plan in plans) / capture.fps,
        seconds=wall_s,
        alone_s=alone_s,
        busy=None if not wall_s or busy_s is None else busy_s / (n_workers * wall_s),
        memory_mb=most_mb,
        side_by_side_mb=max(most_mb, sum(beside_mb)),
        moved_mb=moved_mb,
        shared_mb=shared_mb,
        all_moved_mb=sum(moved_mb.values()) + n_reading * shared_mb,
        worker_hours=hours,
        price=None if hours is None or price_per_hour is None else hours * price_per_hour,
    )


def _shared_mb(project: Project, capture: Capture, plans: Sequence[TrainingPlan]) -> float:
    """The reference clip as it is, or is expected, and the backgrounds that it keeps."""
    from engine.training.preparation.cloud_preparation import BACKGROUNDS_FILE  # with numba, for plans only

    found = project.headers.read(project.reference_path)
    planned = next((plan for plan in plans if plan.clip_index == project.settings.reference_clip), None)
    expected_mb = 0.0 if planned is None else planned.disk_mb or 0.0
    reference_mb = expected_mb if planned is not None or found is None else found.n_bytes / 1e6
    try:
        backgrounds_mb = (project.prep_dir / BACKGROUNDS_FILE).stat().st_size / 1e6
    except OSError:
        n_cameras = len(capture.training_cameras(capture.camera_indices(project.settings.holdout)))
        width, height = capture.picture_size
        is_kept = project.settings.config().needs_backgrounds
        backgrounds_mb = is_kept * n_cameras * width * height * _BACKGROUND_BYTES_PER_PIXEL / 1e6
    return reference_mb + backgrounds_mb


def sequence_text(plan: SequencePlan) -> list[str]:
    """Every line of it."""
    workers = f"{plan.n_workers:,} workers, each" if plan.n_workers > 1 else "One worker,"
    clips = f"{plan.n_clips:,} clips" if plan.n_clips > 1 else "1 clip"
    lines = [f"{workers} as fast as this computer: {clips}, {figure_text(plan.video_s)} s of video"]

    def add(name: str, *parts: str) -> None:
        lines.append(f"  {name:<21} {', '.join(part for part in parts if part)}")

    if plan.seconds is None:
        add("wall time", "not known yet")
    else:
        alone = f"of which {duration_text(plan.alone_s)} for the reference clip alone" if plan.alone_s else ""
        add("wall time", duration_text(plan.seconds), alone, f"workers busy {100 * (plan.busy or 0.0):.0f} % of it")
    beside = f"{figure_text(plan.side_by_side_mb / 1e3)} GB where all are on one machine" if plan.n_workers > 1 else ""
    add("memory", f"{figure_text(plan.memory_mb / 1e3)} GB a worker", beside)
    shared = f"{figure_text(plan.shared_mb)} MB once a machine" if plan.shared_mb else ""
    a_clip, in_all = (f"{figure_text(value)} MB" for value in (plan.mean_moved_mb, plan.all_moved_mb))
    add("bytes moved", f"{a_clip} a clip", shared, f"{in_all} in all")
    for name, value in (("worker-hours", plan.worker_hours), ("price", plan.price)):
        if value is not None:
            add(name, figure_text(value), f"{figure_text(plan.of_minute(value) or 0.0)} a minute of video")
    return lines
