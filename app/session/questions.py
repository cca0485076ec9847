"""Questions that the user is asked before something is done: plain values with all that the answer depends on."""

from __future__ import annotations

from dataclasses import dataclass

from app.project.clip_catalog import ClipCatalog
from app.project.recents import RecentProject


@dataclass(frozen=True, slots=True)
class RetrainQuestion:
    """Is a clip to be trained again, although it is finished?

    Attributes:
        clip_index: The clip.
        is_damaged: Its file cannot be read, and is replaced for good.
        reason: What is wrong with it; empty for a good one.
        held_out_psnr: Of the finished clip, dB; None where not measured or damaged.
        outdated: Clips that are good now and will be out of date with another result of this one.
        seconds: What training it again is expected to take: as long as the last time, or as clips took on average;
            None where nothing was recorded.
        is_average: Whether that is an average.
        outdated_seconds: Likewise for training all of `outdated` again.
        resume_step: The step of an earlier try that it goes on from; None when it starts from the beginning.
    """

    clip_index: int
    is_damaged: bool
    reason: str
    held_out_psnr: float | None
    outdated: tuple[int, ...]
    seconds: float | None
    is_average: bool
    outdated_seconds: float | None
    resume_step: int | None


@dataclass(frozen=True, slots=True)
class ProjectQuestion:
    """Which of several projects of a capture is to be opened?

    Attributes:
        capture: Folder of the capture.
        choices: The projects there are, latest first.
        follow_links: Whether the user allows the capture's files to lie outside of its folder.
    """

    capture: str
    choices: tuple[RecentProject, ...]
    follow_links: bool = False


Question = RetrainQuestion | ProjectQuestion


def retrain_question(catalog: ClipCatalog, clip_index: int) -> RetrainQuestion:
    """What somebody has to know who trains a finished or damaged clip again."""
    record, outdated = catalog[clip_index], catalog.outdated_by(clip_index)
    known = [seconds for index in range(len(catalog)) if (seconds := catalog[index].seconds) is not None]
    average = sum(known) / len(known) if known else None
    times = [average if (seconds := catalog[index].seconds) is None else seconds for index in outdated]
    seconds = average if record.seconds is None else record.seconds
    if seconds is not None and record.resume_step is not None and record.resume_n_steps:
        seconds *= 1.0 - record.resume_step / record.resume_n_steps
    return RetrainQuestion(
        clip_index=clip_index,
        is_damaged=record.state == "damaged",
        reason=record.reason,
        held_out_psnr=record.held_out_psnr,
        outdated=tuple(outdated),
        seconds=seconds,
        is_average=record.seconds is None,
        outdated_seconds=None if average is None else sum(time for time in times if time is not None),
        resume_step=record.resume_step,
    )
