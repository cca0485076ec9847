"""Commands: what a user can ask of a Session, as frozen dataclasses in the imperative. Plain data, no behaviour. They
are next to the part of the session that carries them out.

Orbiting, hovering and panel widths are not commands; they change the view or a widget directly.
"""

from __future__ import annotations

from dataclasses import dataclass

from app.document.changes.timing_changes import TimeEdit
from app.session.captures.capture_commands import (
    CalibrationCommand,
    DoctorCommand,
    FollowRecording,
    SynchronisationCommand,
)
from app.session.clips.clip_commands import ClipCommand
from app.session.editing.edit_commands import EditCommand, FillBehind, HistoryCommand
from app.session.editing.mark_commands import MarkCommand
from app.session.editing.selection_commands import SelectionCommand
from app.session.exclusions.exclusion_commands import ExclusionCommand
from app.session.export_commands import ExportCommand
from app.session.files.file_commands import FileCommand
from app.session.mending.mend_commands import MendCommand
from app.session.objects.follow_commands import FollowCommand
from app.session.objects.object_commands import ObjectCommand
from app.session.paths.path_commands import PathCommand
from app.session.projects.project_commands import ProjectCommand
from app.session.projects.setting_commands import SettingCommand
from app.session.showing.look_commands import CompareProject, LookCommand
from app.session.training.train_commands import ClusterCommand, HoldCommand, TrainCommand


@dataclass(frozen=True, slots=True)
class CancelJob:
    """Give up a job of this name, such as building a first cloud."""

    name: str


@dataclass(frozen=True, slots=True)
class CloseQuestion:
    """Withdraw the question; nothing is done."""


@dataclass(frozen=True, slots=True)
class DismissNotice:
    """Remove the notice at this position."""

    index: int


Command = (
    ProjectCommand
    | FileCommand
    | SettingCommand
    | TrainCommand
    | HoldCommand
    | ClusterCommand
    | ClipCommand
    | ExclusionCommand
    | MendCommand
    | LookCommand
    | CompareProject
    | SelectionCommand
    | EditCommand
    | ObjectCommand
    | FollowCommand
    | TimeEdit
    | FillBehind
    | MarkCommand
    | PathCommand
    | HistoryCommand
    | ExportCommand
    | DoctorCommand
    | CalibrationCommand
    | FollowRecording
    | SynchronisationCommand
    | CancelJob
    | CloseQuestion
    | DismissNotice
)
