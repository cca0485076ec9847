"""Settings that all clips share, changed by a command. A pure function: neither reads nor writes the project."""

from __future__ import annotations

from dataclasses import replace

from app.document.project_settings import ProjectSettings
from app.session.projects.setting_commands import SetClipLength, SetHoldout, SetPreset, SettingCommand, SetTrainSetting
from engine.camera.rig import CameraRig
from engine.training.presets import preset


def changed_settings(settings: ProjectSettings, command: SettingCommand, rig: CameraRig) -> ProjectSettings:
    """The settings as the command wants them; training settings are kept only where they differ from the defaults.

    Args:
        rig: Cameras of the capture; indices of others are ignored.
    Raises:
        TrainingError: There is no such setting, value or preset.
    """
    match command:
        case SetHoldout(camera_indices=indices):
            return replace(settings, holdout=tuple(rig.names[i] for i in sorted(set(indices)) if 0 <= i < len(rig)))
        case SetClipLength(n_frames=n_frames):
            return replace(settings, clip_length=int(n_frames), clip_bounds=None)
        case SetTrainSetting(name=name, value=value):
            overrides = {**settings.overrides, name: value}
        case SetPreset(name=name):
            overrides = preset(name)
    return replace(settings, overrides=replace(settings, overrides=overrides).config().difference())
