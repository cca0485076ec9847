"""Words about commands: titles of notices where one was refused, and names of settings in the history."""

from __future__ import annotations

from typing import get_args

from app.session import commands
from app.session.clips.clip_commands import ClipCommand
from app.session.exclusions.exclusion_commands import ExclusionCommand
from app.session.mending.mend_commands import MendCommand

SETTING_NAMES: dict[type, str] = {
    commands.SetHoldout: "choose held-out cameras",
    commands.SetClipLength: "change the clip length",
    commands.SetTrainSetting: "change a setting",
    commands.SetPreset: "choose a preset",
}
"""Steps of the history."""
TITLES: dict[type, str] = {
    commands.TrainClip: "The clip cannot be trained",
    commands.TrainNextClip: "The clip cannot be trained",
    commands.TrainClips: "The clips cannot be trained",
    commands.TrainAll: "The clips cannot be trained",
    commands.AskTrainSettings: "The clip cannot be trained",
    **dict.fromkeys(get_args(ExclusionCommand), "The exclusion cannot be changed"),
    **dict.fromkeys(get_args(MendCommand), "Mending cannot start"),
    **dict.fromkeys(get_args(ClipCommand), "The clips cannot be changed"),
    commands.RestoreVersion: "The version cannot be restored",
    commands.RemoveVersion: "The version cannot be removed",
    commands.SetHoldout: "These cameras cannot be held out",
    commands.SetClipLength: "The clip length cannot be changed",
    commands.SetTrainSetting: "The setting cannot be changed",
    commands.SetPreset: "The preset cannot be chosen",
    commands.SynchroniseCameras: "The cameras cannot be synchronised",
    **dict.fromkeys(get_args(commands.SelectionCommand), "The selection cannot be made"),
    commands.MarkRegion: "The region cannot be marked",
    commands.MarkBox: "The region cannot be marked",
    commands.RemoveRegion: "The region cannot be removed",
    commands.Undo: "The last step cannot be undone",
    commands.Redo: "The step cannot be redone",
    commands.GoToStep: "That step of the history cannot be reached",
    **dict.fromkeys(get_args(commands.EditCommand), "The edit cannot be made"),
    **dict.fromkeys(get_args(commands.PathCommand), "The camera path cannot be changed"),
    commands.AskStartOver: "Training cannot start over",
    commands.StartOver: "Training cannot start over",
    commands.CorrectCapture: "The capture cannot be corrected",
    **dict.fromkeys(get_args(commands.FileCommand), "The project cannot be changed"),
}
"""Titles of notices, where a command was refused."""
