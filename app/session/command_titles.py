"""Words about commands: titles of notices where one was refused, and names of settings in the history."""

from __future__ import annotations

from typing import get_args

from app.document.changes.timing_changes import TIME_EDITS, ChangeSegment
from app.session.captures.capture_commands import CorrectCapture, FollowRecording, SynchroniseCameras
from app.session.clips.clip_commands import ClipCommand
from app.session.editing.edit_commands import EditCommand, FillBehind, GoToStep, Redo, Undo
from app.session.editing.mark_commands import MarkBox, MarkRegion, RemoveRegion
from app.session.editing.selection_commands import SelectionCommand
from app.session.exclusions.exclusion_commands import ExclusionCommand
from app.session.files.file_commands import FileCommand
from app.session.mending.mend_commands import MendCommand
from app.session.objects.follow_commands import FollowObject
from app.session.objects.object_commands import ObjectCommand
from app.session.paths.path_commands import PathCommand
from app.session.projects.project_commands import AskStartOver, StartOver
from app.session.projects.setting_commands import SetClipLength, SetHoldout, SetPreset, SetTrainSetting
from app.session.showing.look_commands import CompareProject
from app.session.training.train_commands import (
    AskTrainSettings,
    JoinCluster,
    LeaveCluster,
    RemoveVersion,
    RestoreVersion,
    TrainAll,
    TrainClip,
    TrainClips,
    TrainNextClip,
    TrainStale,
)

SETTING_NAMES: dict[type, str] = {
    SetHoldout: "choose held-out cameras",
    SetClipLength: "change the clip length",
    SetTrainSetting: "change a setting",
    SetPreset: "choose a preset",
}
"""Steps of the history."""
TITLES: dict[type, str] = {
    TrainClip: "The clip cannot be trained",
    TrainNextClip: "The clip cannot be trained",
    TrainClips: "The clips cannot be trained",
    TrainStale: "The clips cannot be trained",
    TrainAll: "The clips cannot be trained",
    JoinCluster: "The cluster cannot be joined",
    LeaveCluster: "The cluster cannot be left now",
    AskTrainSettings: "The clip cannot be trained",
    **dict.fromkeys(get_args(ExclusionCommand), "The exclusion cannot be changed"),
    **dict.fromkeys(get_args(MendCommand), "Mending cannot start"),
    **dict.fromkeys(get_args(ClipCommand), "The clips cannot be changed"),
    RestoreVersion: "The version cannot be restored",
    RemoveVersion: "The version cannot be removed",
    SetHoldout: "These cameras cannot be held out",
    SetClipLength: "The clip length cannot be changed",
    SetTrainSetting: "The setting cannot be changed",
    SetPreset: "The preset cannot be chosen",
    FollowRecording: "The recording cannot be followed",
    SynchroniseCameras: "The cameras cannot be synchronised",
    **dict.fromkeys(get_args(SelectionCommand), "The selection cannot be made"),
    MarkRegion: "The region cannot be marked",
    MarkBox: "The region cannot be marked",
    RemoveRegion: "The region cannot be removed",
    Undo: "The last step cannot be undone",
    Redo: "The step cannot be redone",
    GoToStep: "That step of the history cannot be reached",
    **dict.fromkeys(get_args(EditCommand), "The edit cannot be made"),
    FollowObject: "The volume cannot follow the object",
    **dict.fromkeys(get_args(ObjectCommand), "The object cannot be changed"),
    **dict.fromkeys((*TIME_EDITS.values(), ChangeSegment), "The take cannot be changed"),
    FillBehind: "Nothing can be filled",
    **dict.fromkeys(get_args(PathCommand), "The camera path cannot be changed"),
    CompareProject: "The project cannot be compared",
    AskStartOver: "Training cannot start over",
    StartOver: "Training cannot start over",
    CorrectCapture: "The capture cannot be corrected",
    **dict.fromkeys(get_args(FileCommand), "The project cannot be changed"),
}
"""Titles of notices, where a command was refused."""
