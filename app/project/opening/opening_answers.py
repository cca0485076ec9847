"""OpeningAnswers: what a user decides about a capture before a project is made of it, and what is offered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import msgspec
from msgspec import Meta

from app.project.opening.project_access import DEFAULT_CLIP_LENGTH
from engine.capture.capture import Capture, working_sizes
from engine.capture.holdout_choice import suggested_holdout
from engine.capture.pixels.frame_fit import FrameFit
from engine.errors import CaptureError

WINDOW_WIDTH_PX = 960
"""Wider captures are worked on at a smaller scale unless one is asked for; training on a CPU goes with the pixels."""


class LastAnswers(msgspec.Struct, frozen=True):
    """The user's last answers, as far as they say something about the next capture.

    Attributes:
        width_px: Working width; None where it was that of the capture.
        clip_length: Frames per clip.
        is_holding_out: Whether any camera was held out.
    """

    width_px: Annotated[int, Meta(ge=16, le=100_000)] | None = WINDOW_WIDTH_PX
    clip_length: Annotated[int, Meta(ge=1, lt=2**31)] = DEFAULT_CLIP_LENGTH
    is_holding_out: bool = True


@dataclass(frozen=True, slots=True)
class OpeningAnswers:
    """The first settings of a capture's project.

    Attributes:
        frames: First frame that is worked on, and the one after the last; None for all.
        scale: Working size divided by stored size, in (0, 1].
        clip_length: Frames per clip.
        holdout: Names of cameras kept out of training, to measure with.
        fit: The treatment of frames of another shape than their calibration; None where not asked or not said.
    """

    frames: tuple[int, int] | None
    scale: float
    clip_length: int
    holdout: tuple[str, ...]
    fit: FrameFit | None = None


def window_scale(capture: Capture, width_px: int | None = WINDOW_WIDTH_PX) -> float:
    """The scale at which the widest camera of a capture has at most this width; 1 where it has."""
    widest = int(capture.native_rig.image_sizes[:, 0].max())
    return 1.0 if width_px is None or widest <= width_px else width_px / widest


def default_answers(capture: Capture, last: LastAnswers | None = None) -> OpeningAnswers:
    """Good answers for a capture: its own hold-out or one that suits the rig, the size and clip length used last."""
    last = last or LastAnswers()
    return OpeningAnswers(
        frames=None,
        scale=window_scale(capture, last.width_px),
        clip_length=min(last.clip_length, capture.n_frames),
        holdout=good_holdout(capture) if last.is_holding_out else (),
    )


def good_holdout(capture: Capture) -> tuple[str, ...]:
    """The cameras that the capture sets aside itself; otherwise those that suit its rig."""
    return capture.default_holdout or suggested_holdout(capture.native_rig)


def answers_to_keep(answers: OpeningAnswers, capture: Capture) -> LastAnswers:
    """The answers that the next capture can be offered."""
    width_px = None if answers.scale == 1.0 else int(working_size(capture, answers.scale)[0])
    return LastAnswers(width_px, answers.clip_length, bool(answers.holdout))


def working_size(capture: Capture, scale: float) -> tuple[int, int]:
    """Width and height of the pictures at a scale.

    Raises:
        CaptureError: No pixels are left.
    """
    if not 0.0 < scale <= 1.0:
        raise CaptureError(f"The scale is {scale:g}.", hint="Give a number above 0 and up to 1.", path=capture.path)
    native_sizes = capture.native_rig.image_sizes
    longest = native_sizes.max(axis=1)
    sizes = working_sizes(native_sizes, scale * longest.min() / longest, capture.path)
    return int(sizes[:, 0].max()), int(sizes[:, 1].max())
