"""Notices to the user about a background training, made of its events."""

from __future__ import annotations

from collections.abc import Sequence

from app.psnr_words import psnr_words
from app.session.notices import Notices
from app.training.messages import ClipTrained, Event, TrainingFailed, TrainingStopped, WarningRaised, WorkerDied

MAX_LISTED = 12
"""Clips named in a notice."""


def tell(event: Event, notices: Notices, clip_index: int | None = None) -> None:
    """Add a notice if the user should know of this; most events show in the status alone."""
    of_clip = "" if clip_index is None else f"Clip {clip_index}: "
    match event:
        case ClipTrained(held_out_psnr=psnr):
            figure = "" if psnr is None else f"{psnr_words(psnr, is_whole=False).capitalize()}."
            notices.add("info", "A clip is trained" if clip_index is None else f"Clip {clip_index} is trained", figure)
        case TrainingStopped(is_kept=is_kept, step=step):
            detail = f"Progress of {step} steps is kept." if is_kept else "No progress yet."
            notices.add("info", "Training stopped", of_clip + detail)
        case WarningRaised(title=title, detail=detail, hint=hint):
            notices.add("warn", title, detail, hint)
        case TrainingFailed(message=message, hint=hint):
            notices.add("error", "Training failed", of_clip + message, hint)
        case WorkerDied(reason=reason, log_tail=log_tail):
            last = log_tail.splitlines()[-1] if log_tail else "Its log is empty."
            notices.add(
                "error",
                "The training process ended unexpectedly",
                f"{of_clip}{reason}. {last}",
                "Train the clip again; it resumes from its saved progress.",
            )
        case _:
            pass


def tell_dropped(dropped: Sequence[int], notices: Notices) -> None:
    """Add a notice that clips left the queue, because clips that they need cannot come."""
    if dropped:
        them, needs = ("Clip", "it needs") if len(dropped) == 1 else ("Clips", "they need")
        notices.add("warn", f"{them} {listed(dropped)} left the queue: {needs} a clip that is not trained")


def listed(clip_indices: Sequence[int]) -> str:
    """Clips as a notice names them: the first of many, and how many more."""
    more = f" and {len(clip_indices) - MAX_LISTED} more" if len(clip_indices) > MAX_LISTED else ""
    return ", ".join(str(index) for index in clip_indices[:MAX_LISTED]) + more
