"""ProjectSettings: settings shared by all clips of a project."""

from __future__ import annotations

import itertools
from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Annotated

from msgspec import Meta

from engine.capture.clip import Clip, cut_clips, split_clips
from engine.clip_files.clip_header import SettingValue
from engine.errors import ProjectError
from engine.training.config import TrainConfig, config_of


@dataclass(frozen=True, slots=True)
class ProjectSettings:
    """Settings shared by all clips of a project. A value, part of the document.

    Attributes:
        capture: Folder of the capture.
        fingerprint: Of the capture, to notice another one in its place.
        scale: Share of the original picture size, in (0, 1].
        clip_length: M, frames per clip.
        holdout: Names of the cameras that training never sees.
        seed: Fixes initial values and the order of pictures.
        overrides: Training settings that differ from the defaults.
        reference_clip: Index of the clip that the others inherit from.
        follow_links: Whether the user allowed the capture's files to lie outside of its folder.
        frames: First frame of the capture that is worked on, and the one after the last; None for all.
        clip_bounds: Where clips were split or merged: the first frame of every clip, and at the end the number of
            frames. None where every clip has clip_length frames, the last one the rest.
        is_growing: Whether the capture may still be recorded; see `open_capture`. `frames` are those taken in so far.
    """

    capture: Annotated[str, Meta(pattern=r"\A[^\0]*\Z")]
    fingerprint: str
    scale: Annotated[float, Meta(gt=0, le=1)] = 1.0
    clip_length: Annotated[int, Meta(ge=1, lt=2**31)] = 10
    holdout: tuple[str, ...] = ()
    seed: Annotated[int, Meta(ge=0, lt=2**32)] = 0
    overrides: dict[str, SettingValue] = field(default_factory=dict)
    reference_clip: Annotated[int, Meta(ge=0, lt=2**31)] = 0
    follow_links: bool = False
    frames: tuple[Annotated[int, Meta(ge=0, lt=2**31)], Annotated[int, Meta(ge=1, lt=2**31)]] | None = None

    clip_bounds: tuple[Annotated[int, Meta(ge=0, lt=2**31)], ...] | None = None
    is_growing: bool = False

    def clips(self, n_frames: int) -> list[Clip]:
        """The clips of a capture of that many frames.

        Raises:
            ProjectError: The clips were cut from a capture of another length.
        """
        if self.config().field == "joint":
            return split_clips(n_frames, n_frames)
        if self.clip_bounds is None:
            return split_clips(n_frames, self.clip_length)
        if self.is_growing and n_frames > self.clip_bounds[-1]:
            later = range(self.clip_bounds[-1] + self.clip_length, n_frames, self.clip_length)
            return cut_clips((*self.clip_bounds, *later, n_frames), self.clip_length)
        if self.clip_bounds[-1] != n_frames:
            raise ProjectError(
                f"The clips of the project end at frame {self.clip_bounds[-1]}, the capture at frame {n_frames}.",
                hint="Put the original capture back, or make a new project.",
            )
        return cut_clips(self.clip_bounds, self.clip_length)

    def placed_as(self, now: ProjectSettings) -> ProjectSettings:
        """These settings with what nobody chooses as it is now: where the capture lies, and how far it has grown."""
        frames = now.frames if self.is_growing and now.is_growing else self.frames
        return replace(self, capture=now.capture, follow_links=now.follow_links, frames=frames)

    def is_placed_as(self, other: ProjectSettings) -> bool:
        """Whether nothing differs except what nobody chooses; a capture that grows does not lose frames."""
        known, now = self.frames or (0, 0), other.frames or (0, 0)
        is_longer = known[0] == now[0] and known[1] <= now[1]
        return (is_longer or not self.is_growing) and self.placed_as(other) == other

    def config(self) -> TrainConfig:
        """The training settings. Raises ProjectError for an unknown one or a value that it may not have."""
        return _config_of(tuple((name, type(value), value) for name, value in self.overrides.items()))


@lru_cache(maxsize=64)
def _config_of(overrides: tuple[tuple[str, type, Hashable], ...]) -> TrainConfig:
    """Checked once, as it is asked for all the time. With types, since 1 and True are not the same setting."""
    return config_of({name: value for name, _, value in overrides})


def check_bounds(clip_bounds: tuple[int, ...] | None) -> None:
    """Check that clips can be cut so.

    Raises:
        ProjectError: They do not rise from 0.
    """
    if clip_bounds is None:
        return
    rises = all(start < stop for start, stop in itertools.pairwise(clip_bounds))
    if len(clip_bounds) < 2 or clip_bounds[0] != 0 or not rises:
        raise ProjectError("The bounds of the clips have to rise from 0 to the number of frames.")
