"""Settings that one clip of a project may have for itself: how long and how fast it learns, and what it adds.

Shared settings stay the project's: sizes of features and decoder, cameras, colours, the gate, and how clips inherit.
A clip trained with its own settings is a clip like any other; those that depend on it know it by its fingerprint.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from app.document.project_settings import ProjectSettings
from app.project.project import Project
from engine.clip_files.clip_header import SettingValue
from engine.errors import ProjectError
from engine.training.config import LENGTH, LOSS, RATES, SETTINGS, TrainConfig, config_of
from engine.training.windows import Windows

_ADDED = ("max_static_points", "max_moving_points", "residual")
"""Settings of the anchors that a clip adds."""
ALLOWED = tuple(name for name, setting in SETTINGS.items() if setting.group in (LENGTH, RATES, LOSS) or name in _ADDED)
_OF_REFERENCE = ("static_steps", "joint_steps", "max_static_points", "max_moving_points")
_OF_SOURCE = ("source_steps", "max_moving_points", "residual")
_OF_BOTH = ("ssim_weight", "volume_weight")


def is_source(settings: ProjectSettings, config: TrainConfig, clip_index: int) -> bool:
    """Whether a clip starts from another trained clip. config: That of the settings."""
    if clip_index == settings.reference_clip:
        return False
    return not config.independent or config.start == "previous"


def offered(project: Project, clip_index: int) -> tuple[str, ...]:
    """The main ones of a clip: those that a dialog shows."""
    config = project.settings.config()
    if not is_source(project.settings, config, clip_index):
        has_static_phase = config.cloud != "frames"
        return (*(name for name in _OF_REFERENCE if has_static_phase or name != "static_steps"), *_OF_BOTH)
    shared = ("residual",) if config.independent else ()
    return tuple(name for name in (*_OF_SOURCE, *_OF_BOTH) if name not in shared)


def with_own(project: Project, own: Mapping[str, Any]) -> dict[str, SettingValue]:
    """The project's settings with those of one clip over them, as far as they differ from the defaults.

    Raises:
        ProjectError: One of them cannot differ between clips, does not exist, or may not have its value.
    """
    refused = sorted(own.keys() - set(ALLOWED))
    if refused:
        raise ProjectError(
            f"All clips of a project share {', '.join(refused)}.",
            hint=f"For one clip, these can differ: {', '.join(ALLOWED)}.",
        )
    return config_of({**project.settings.overrides, **own}).difference()


def derived_steps(config: TrainConfig, n_cameras: int, n_frames: int, picture_size: tuple[int, int]) -> dict[str, int]:
    """The values of settings that follow from a clip's pictures where they are 0, by name.

    Args:
        n_cameras: To train on.
        picture_size: Width and height, pixels.
    """
    n_pictures, n_windows = n_cameras * n_frames, len(Windows(*picture_size))
    return {
        "static_steps": config.n_static_steps(n_cameras, n_windows),
        "joint_steps": config.n_joint_steps(n_pictures, n_windows),
        "source_steps": config.n_source_steps(n_pictures, n_windows),
    }
