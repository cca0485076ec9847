"""Intake: the frames of a capture that is being recorded become clips of its project, as soon as all cameras have them.

Changes of the document are for its owner to make: nothing here writes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from app.document.changes.exclusion_changes import with_frames_excluded
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from engine.capture.capture import Capture
from engine.capture.files.frame_runs import runs_of
from engine.capture.growing.growth import Growth
from engine.capture.growing.watch import PATIENCE_S, GrowthWatch
from engine.errors import ProjectError
from engine.training.config import config_of

LOOK_EVERY_S = 0.25
LOOK_SHARE = 0.2
"""Share of the time that looking may take: it asks for many files, and the folder may lie on a slow network."""
UNTIL_IDLE_S = 120.0
"""A recording has ended once no camera has had a new frame for so long."""


@dataclass(frozen=True, slots=True)
class FollowLimits:
    """How long is waited, and how far.

    Attributes:
        patience_s: For a frame that other cameras have; see GrowthWatch.
        until_idle_s: For any new frame, before the recording counts as ended; infinity for ever.
        n_frames: The recording ends after so many; None where that is not known.
    """

    patience_s: float = PATIENCE_S
    until_idle_s: float = UNTIL_IDLE_S
    n_frames: int | None = None


@dataclass(frozen=True, slots=True)
class TakenIn:
    """Frames that are taken in.

    Attributes:
        stop: One past the last.
        lost: Camera and frame of what was given up among the new ones.
    """

    stop: int
    lost: tuple[tuple[str, int], ...] = ()

    def grown(self, settings: ProjectSettings) -> ProjectSettings:
        """Settings of a project that has these frames."""
        first = 0 if settings.frames is None else settings.frames[0]
        return replace(settings, frames=(first, first + self.stop))

    def without_lost(self, document: ProjectDocument, capture: Capture) -> ProjectDocument:
        """A document in which the frames that were given up are excluded."""
        names = capture.rig.names
        for camera, frames in self.lost_runs():
            document = with_frames_excluded(
                document, frames.start, frames.stop, camera=camera, camera_names=names, n_frames=self.stop
            )
        return document

    def lost_runs(self) -> list[tuple[str, range]]:
        """What was given up, camera by camera."""
        cameras = dict.fromkeys(camera for camera, _ in self.lost)
        return [
            (camera, run)
            for camera in cameras
            for run in runs_of(sorted(frame for other, frame in self.lost if other == camera))
        ]

    def words(self, patience_s: float) -> list[str]:
        """What was given up, as sentences."""
        return [
            f"Camera {camera} has not delivered {_frames_text(run)} within {patience_s:g} s, so that training leaves "
            f"{'it' if len(run) == 1 else 'them'} out."
            for camera, run in self.lost_runs()
        ]


class Intake:
    """For one thread.

    Args:
        capture: Opened as growing.
        n_taken: Frames that are taken in already; see `n_taken_of`.
        clip_length: Frames per clip.
        base: Where clips of that length begin: behind those that were cut otherwise.
        is_wanted: See GrowthWatch.
        limits: How long is waited.
        clock: Seconds; tests bring their own.

    Attributes:
        growth: The last look; None before the first.
        n_taken: Frames that are taken in.
        has_ended: Whether no more frames will come.
    """

    def __init__(
        self,
        capture: Capture,
        n_taken: int,
        clip_length: int,
        *,
        base: int = 0,
        is_wanted: Callable[[int, int], bool] = lambda camera_index, frame_index: True,
        limits: FollowLimits | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.limits, self.n_taken, self._length, self._base = limits or FollowLimits(), n_taken, clip_length, base
        self._names, self._clock = capture.rig.names, clock
        patience_s = self.limits.patience_s
        self._watch = GrowthWatch(capture, first=n_taken, patience_s=patience_s, is_wanted=is_wanted, clock=clock)
        self.growth: Growth | None = None
        self.has_ended = False
        self._next_s = clock()

    def ready(self) -> int:
        """Frames that can be taken in: those of whole clips, and all once the recording has ended. Looks now and then.

        Raises:
            CaptureError: See GrowthWatch.
        """
        now_s = self._clock()
        if not self.has_ended and now_s >= self._next_s:
            self.growth = self._watch.look()
            self._next_s = now_s + max(LOOK_EVERY_S, (self._clock() - now_s) / LOOK_SHARE)
            self.has_ended = self._is_over(self.growth)
        n_complete = 0 if self.growth is None else self._within(self.growth.n_complete)
        n_whole = n_complete - (n_complete - self._base) % self._length
        return max(n_complete if self.has_ended else n_whole, self.n_taken)

    def take(self) -> TakenIn | None:
        """Take in what is ready; None where that is nothing new. Raises CaptureError."""
        stop = self.ready()
        if stop <= self.n_taken:
            return None
        self.n_taken = stop
        return TakenIn(stop, tuple((self._names[row], frame) for row, frame in self._watch.take_lost(stop)))

    @property
    def words(self) -> str:
        """What is waited for."""
        first = self.n_taken
        return "" if self.growth is None else self.growth.words(first, self._within(first + self._length))

    def _within(self, n_frames: int) -> int:
        return n_frames if self.limits.n_frames is None else min(n_frames, self.limits.n_frames)

    def _is_over(self, growth: Growth) -> bool:
        limits = self.limits
        is_all_there = growth.n_complete >= growth.n_reached or growth.idle_s >= limits.patience_s
        return (
            (growth.has_ended and is_all_there)
            or growth.idle_s >= limits.until_idle_s
            or (limits.n_frames is not None and growth.n_complete >= limits.n_frames)
        )


def base_of(settings: ProjectSettings) -> int:
    """The frame from which on a project's clips have their usual length."""
    return 0 if settings.clip_bounds is None else settings.clip_bounds[-1]


def n_taken_of(settings: ProjectSettings) -> int:
    """Frames of whole clips that a project has taken in; a shorter last clip is as if it had not been."""
    if settings.frames is None or not settings.is_growing:
        return 0
    n_frames, base = settings.frames[1] - settings.frames[0], base_of(settings)
    return n_frames - (n_frames - base) % settings.clip_length if n_frames > base else n_frames


def check_can_follow(settings: ProjectSettings) -> None:
    """Check that clips can be trained before later frames exist.

    Raises:
        ProjectError: They cannot; says why.
    """
    config = config_of(settings.overrides)
    if config.backgrounds != "clip" or config.field == "joint":
        name, value = ("field", "joint") if config.field == "joint" else ("backgrounds", config.backgrounds)
        raise ProjectError(
            f"With {name}={value}, training looks at frames that do not exist yet.",
            hint="Follow the recording with other settings, or train once it is complete.",
        )


def _frames_text(frames: range) -> str:
    return f"frame {frames.start}" if len(frames) == 1 else f"frames {frames.start} to {frames.stop - 1}"
