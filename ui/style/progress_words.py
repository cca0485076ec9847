"""Progress in words, the same in the training panel, the timeline and the status bar. Percent are always of the steps;
a preparation, which has none yet, is counted in stages.
"""

from __future__ import annotations

from app.status import ClipStatus, JobStatus, QueueStatus, RunningClip, TrainingStatus
from engine.text import duration_text
from ui.style.numbers import format_count

COUNTED_IN_STEPS = ("training", "paused", "stopped")
UNUSUAL_STATES = {"starting": "starting", "paused": "paused", "stopping": "stopping", "unknown": "not heard of yet"}
"""States of a training that neither its rate nor its stage shows, in words."""


def job_words(job: JobStatus | None, now_s: float) -> str:
    """A job's work, how far it is, since when, and how long it will take, as far as these are known:
    "Key points, 40 %, 0:32, about 0:48 left".

    Args:
        job: None for one that has not said anything yet.
        now_s: By time.monotonic.
    """
    if job is None:
        return "Starting"
    spent_s, left_s = job.elapsed_s(now_s), job.eta_s(now_s)
    parts = [job.message or ("" if job.done > 0 else "Starting"), f"{100 * job.done:.0f} %" if job.done > 0 else ""]
    parts += ["" if spent_s is None else duration_text(spent_s)]
    parts += ["" if left_s is None else f"about {duration_text(left_s)} left"]
    return ", ".join(filter(None, parts))


def stage_words(training: TrainingStatus) -> str:
    """The present stage: "stage 2 of 3, Looking for what stands still"."""
    if not training.n_stages:
        return training.stage
    return f"stage {training.stage_number} of {training.n_stages}, {training.stage}"


def running_words(one: RunningClip, *, is_short: bool = False) -> str:
    """Where a clip trains, how far it is and how fast: "lab-2, worker 1: 31.0 steps/s, 0:23 left".

    Args:
        is_short: Without the steps and the time spent.
    """
    parts = [UNUSUAL_STATES[one.state]] if one.state in UNUSUAL_STATES else []
    if one.state == "preparing":
        parts.append(one.stage or one.state)
    if one.n_steps and not is_short:
        parts.append(f"step {format_count(one.step)} of {format_count(one.n_steps)}")
    parts += [f"{one.steps_per_s:.1f} steps/s"] if one.steps_per_s else []
    parts += [f"{duration_text(one.eta_s)} left"] if one.eta_s is not None else []
    parts += [f"for {duration_text(one.since_s)} so far"] if one.since_s and not is_short else []
    place = machine_text(one)
    return f"{place}: {', '.join(parts)}" if place and parts else place or ", ".join(parts)


def machine_text(one: RunningClip) -> str:
    """The computer and the worker that train a clip, as far as they are known."""
    worker = f"worker {one.worker}" if one.worker else ""
    return ", ".join(filter(None, (one.machine, worker)))


def whole_words(n_clips: int, training: TrainingStatus, queue: QueueStatus) -> str:
    """How far all of it is: "12 of 40 clips trained, 3 in training on 2 computers, about 1 h 20 min left"."""
    left = 0 if queue.everything is None else queue.everything.n_clips
    machines = {one.machine for one in training.trainings if one.machine}
    where = f" on {len(machines)} computers" if len(machines) > 1 else ""
    parts = [f"{format_count(n_clips - left)} of {format_count(n_clips)} clips trained"]
    parts += [f"{len(training.trainings)} in training{where}"] if training.trainings else []
    seconds = None if queue.queued is None else queue.queued.seconds
    parts += [] if seconds is None else [f"about {duration_text(seconds)} left"]
    return ", ".join(parts)


def band_words(status: ClipStatus, training: TrainingStatus, clip_index: int, state_words: str) -> str:
    """The state of a clip on the timeline. state_words: Of the state alone."""
    if status.state == "preparing" and training.clip_index == clip_index and training.n_stages:
        return f"{state_words}, {training.stage_number} of {training.n_stages}"
    one = training.of_clip(clip_index) if status.state in ("training", "paused", "preparing") else None
    where = f", {one.machine}" if one is not None and one.is_elsewhere else ""
    if status.state in COUNTED_IN_STEPS and status.progress > 0:
        return f"{state_words} {status.progress * 100:.0f} %{where}"
    return f"{state_words}{where}"
