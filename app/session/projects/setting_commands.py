"""Commands that change settings that all clips share."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SetHoldout:
    """Camera indices that training never sees. Only before the first clip is finished."""

    camera_indices: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class SetClipLength:
    """Frames per clip. Only before the first clip is finished."""

    n_frames: int


@dataclass(frozen=True, slots=True)
class SetTrainSetting:
    """One setting of engine.training.config by its name. Only before the first clip is finished."""

    name: str
    value: int | float | str | bool


@dataclass(frozen=True, slots=True)
class SetPreset:
    """Training settings of a preset in place of all that were set. Only before the first clip is finished."""

    name: str


SettingCommand = SetHoldout | SetClipLength | SetTrainSetting | SetPreset
"""Commands that change settings shared by all clips."""
