"""ProjectSettings: what every clip of a project has in common."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from msgspec import Meta

from engine.capture.clip import Clip, split_clips
from engine.clip_files.clip_header import SettingValue
from engine.training.config import TrainConfig, config_of


@dataclass(frozen=True, slots=True)
class ProjectSettings:
    """What every clip of a project has in common. A value, part of the document.

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

    def clips(self, n_frames: int) -> list[Clip]:
        """The clips of a capture of that many frames."""
        return split_clips(n_frames, n_frames if self.config().field == "joint" else self.clip_length)

    def config(self) -> TrainConfig:
        """The training settings. Raises ProjectError for an unknown one or a value that it may not have."""
        return config_of(self.overrides)
