"""Progress in words, the same in the training panel, the timeline and the status bar. Percent are always of the steps;
a preparation, which has none yet, is counted in stages.
"""

from __future__ import annotations

from app.status import ClipStatus, JobStatus, TrainingStatus
from engine.text import duration_text

COUNTED_IN_STEPS = ("training", "paused", "stopped")


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


def band_words(status: ClipStatus, training: TrainingStatus, clip_index: int, state_words: str) -> str:
    """The state of a clip on the timeline. state_words: Of the state alone."""
    if status.state == "preparing" and training.clip_index == clip_index and training.n_stages:
        return f"{state_words}, {training.stage_number} of {training.n_stages}"
    if status.state in COUNTED_IN_STEPS and status.progress > 0:
        return f"{state_words} {status.progress * 100:.0f} %"
    return state_words
