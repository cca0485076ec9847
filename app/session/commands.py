"""Commands: what a user can ask of a Session, as frozen dataclasses in the imperative. Plain data, no behaviour.

Orbiting, hovering and panel widths are not commands; they change the view or a widget directly.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.calibration.job import CalibrationRequest
from app.export.export_choices import ExportChoices
from app.project.opening.opening_answers import OpeningAnswers
from app.project.opening.project_choices import AS_USUAL, ProjectChoices
from app.session.clips.clip_commands import ClipCommand
from app.session.editing.edit_commands import EditCommand, GoToStep
from app.session.editing.selection_commands import SelectionCommand
from app.session.exclusions.exclusion_commands import ExclusionCommand
from app.session.files.file_commands import FileCommand
from app.session.mending.mend_commands import MendCommand
from app.session.paths.path_commands import PathCommand
from engine.capture.writers.capture_json import Corrections


@dataclass(frozen=True, slots=True)
class OpenCapture:
    """Open a capture folder; where it has projects, ask which, or whether to make a new one. A project folder is opened
    as such."""

    path: Path
    scale: float | None = None
    """Share of the original picture size to work at; None picks one that suits the size."""
    is_new_project: bool = False
    """Start another project, whatever there is."""
    follow_links: bool = False
    """Whether the user allows the capture's files to lie outside of its folder; noted in its project."""
    is_asking: bool = False
    """Report what it is, and ask what a project of it begins with, where there is none; or why it does not open."""
    answers: OpeningAnswers | None = None
    """What a new project begins with; None takes what suits."""
    choices: ProjectChoices = AS_USUAL
    """How its project is opened."""


@dataclass(frozen=True, slots=True)
class OpenProject:
    """Open a project folder and the capture it names."""

    path: Path
    choices: ProjectChoices = AS_USUAL


@dataclass(frozen=True, slots=True)
class CancelJob:
    """Give up a job of this name, such as building a first cloud."""

    name: str


@dataclass(frozen=True, slots=True)
class NewProject:
    """Ask what another project of the open capture begins with; the others stay as they are."""


@dataclass(frozen=True, slots=True)
class LeaveTraining:
    """Stop the training, keep its progress, and go to the project that was opened."""


@dataclass(frozen=True, slots=True)
class AskStartOver:
    """Ask with which settings training is to start over, and say what is discarded."""


@dataclass(frozen=True, slots=True)
class StartOver:
    """Discard everything that is trained in the open project, and take a preset."""

    preset: str


@dataclass(frozen=True, slots=True)
class SetProjectsFolder:
    """Where projects go that are made from now on; an empty text for the usual place."""

    folder: str


@dataclass(frozen=True, slots=True)
class TrainNextClip:
    """Train the first clip that is not finished; the reference clip comes first."""


@dataclass(frozen=True, slots=True)
class TrainClip:
    """Train one clip. One that is finished, or damaged, is trained again only once that is confirmed."""

    clip_index: int
    is_confirmed: bool = False
    settings: tuple[tuple[str, int | float | str | bool], ...] = ()
    """Names and values of settings that this clip alone is to have; see app.training.own_settings."""


@dataclass(frozen=True, slots=True)
class AskTrainSettings:
    """Ask with which settings of its own a clip is to be trained."""

    clip_index: int


@dataclass(frozen=True, slots=True)
class TrainClips:
    """Train those of these clips that are not finished, one after the other, and before them what they need."""

    clip_indices: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class TrainAll:
    """Train every clip that is not finished."""


@dataclass(frozen=True, slots=True)
class MoveInQueue:
    """Put a waiting clip at another position of the queue, counted from 0."""

    clip_index: int
    position: int


@dataclass(frozen=True, slots=True)
class RemoveFromQueue:
    """Do not train a waiting clip after all."""

    clip_index: int


@dataclass(frozen=True, slots=True)
class StopAfterClip:
    """Let the queue wait once the clip that trains has ended, or go on after all."""

    is_wanted: bool = True


@dataclass(frozen=True, slots=True)
class SetLiveView:
    """How often the clip that trains is shown anew: "off", "low" or "live". Trains on meanwhile."""

    mode: str


@dataclass(frozen=True, slots=True)
class RestoreVersion:
    """Bring back what a clip was before it was trained again; what it is now becomes a version."""

    clip_index: int
    version: int


@dataclass(frozen=True, slots=True)
class RemoveVersion:
    """Delete an earlier version of a clip for good."""

    clip_index: int
    version: int


@dataclass(frozen=True, slots=True)
class PauseTraining:
    """Hold the running training where it is."""


@dataclass(frozen=True, slots=True)
class ResumeTraining:
    """Go on after a pause, or with a queue that waits."""


@dataclass(frozen=True, slots=True)
class StopTraining:
    """End the running training, keep progress and empty the queue."""


@dataclass(frozen=True, slots=True)
class SetFrame:
    """Move the playhead; frames outside the capture are clamped."""

    frame_index: int


@dataclass(frozen=True, slots=True)
class TogglePlay:
    """Play or hold."""


@dataclass(frozen=True, slots=True)
class FollowTraining:
    """Go along with the training: the playhead stands in the clip with the newest state, until the user moves it."""

    is_on: bool = True


@dataclass(frozen=True, slots=True)
class LookThrough:
    """Look through a capture camera, or freely again with None."""

    camera_index: int | None


@dataclass(frozen=True, slots=True)
class SetCompare:
    """Compare with another picture: "off", "wipe", "side" or "blink"."""

    mode: str


@dataclass(frozen=True, slots=True)
class ToggleOverlay:
    """Switch one of the overlays: show_frusta, show_inherited, show_residual, show_points, show_cloud, show_regions."""

    name: str


@dataclass(frozen=True, slots=True)
class ShowHeat:
    """Show a residual heat map over the picture, by its name; an empty one takes it away."""

    kind: str


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


@dataclass(frozen=True, slots=True)
class MarkRegion:
    """Mark a sphere in which everything counts as static or dynamic, in clips whose training starts from now on."""

    treat: str
    """"static" or "dynamic"."""
    center: tuple[float, float, float]
    """Scene units."""
    radius: float
    """Scene units."""


@dataclass(frozen=True, slots=True)
class MarkBox:
    """Mark a box along the axes of the scene as MarkRegion marks a sphere."""

    treat: str
    low: tuple[float, float, float]
    """Scene units."""
    high: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class RemoveRegion:
    """Forget the marked region at this position of the list."""

    index: int


@dataclass(frozen=True, slots=True)
class Undo:
    """Take back the last change of the project's content since it was opened: of regions or of camera paths."""


@dataclass(frozen=True, slots=True)
class Redo:
    """Do again what Undo took back last; another change ends that."""


@dataclass(frozen=True, slots=True)
class HomeView:
    """Frame the point that the cameras look at."""


@dataclass(frozen=True, slots=True)
class SetFrameMemory:
    """Keep decoded frames up to so many megabytes; None for as many as is usual."""

    megabytes: int | None


@dataclass(frozen=True, slots=True)
class SetCompareWith:
    """What to compare with. other: See Overlays.compare_with."""

    other: str


@dataclass(frozen=True, slots=True)
class SetMode:
    """Let colours mean something else. mode: See app.playback.modes.view_modes.MODES."""

    mode: str


@dataclass(frozen=True, slots=True)
class SetContent:
    """Draw a part of the clips. content: See app.playback.modes.view_modes.CONTENTS."""

    content: str


@dataclass(frozen=True, slots=True)
class ShowViews:
    """Show one, two or four views side by side."""

    n: int


@dataclass(frozen=True, slots=True)
class ActivateView:
    """Let keys, menus and the toolbar act on another view."""

    index: int


@dataclass(frozen=True, slots=True)
class CloseQuestion:
    """Do nothing of what was asked."""


@dataclass(frozen=True, slots=True)
class ForgetRecent:
    """Take a project or capture out of the list of recent ones; its files stay."""

    folder: Path


@dataclass(frozen=True, slots=True)
class DismissNotice:
    """Remove the notice at this position."""

    index: int


@dataclass(frozen=True, slots=True)
class ExamineCapture:
    """Let the capture doctor look at the open capture."""


@dataclass(frozen=True, slots=True)
class StopExamining:
    """Let it stop."""


@dataclass(frozen=True, slots=True)
class CorrectCapture:
    """Write corrections into the capture's capture.json and open it as a new project.

    Attributes:
        corrections: What to change.
        words: The same for the question that is asked before, as "Exclude cam07".
        is_confirmed: It was asked and answered.
    """

    corrections: Corrections
    words: str
    is_confirmed: bool = False


DoctorCommand = ExamineCapture | StopExamining | CorrectCapture
"""Commands of the capture doctor."""


@dataclass(frozen=True, slots=True)
class LookAtVideos:
    """Show which cameras are in a folder of plain videos, to calibrate them."""

    folder: Path


@dataclass(frozen=True, slots=True)
class CalibrateVideos:
    """Find the cameras of the folder that is shown, and write capture.json."""

    request: CalibrationRequest


@dataclass(frozen=True, slots=True)
class KeepCalibration:
    """Write a calibration that has failed all the same, with doubtful cameras in use."""


@dataclass(frozen=True, slots=True)
class StopCalibration:
    """End the calibration that runs; nothing is written."""


MarkCommand = MarkRegion | MarkBox | RemoveRegion
"""Commands that change the marked regions and can be undone."""

SettingCommand = SetHoldout | SetClipLength | SetTrainSetting | SetPreset
"""Commands that change settings shared by all clips."""

QueueCommand = (
    TrainClip
    | TrainClips
    | TrainAll
    | AskTrainSettings
    | MoveInQueue
    | RemoveFromQueue
    | StopAfterClip
    | SetLiveView
    | RestoreVersion
    | RemoveVersion
)
"""Commands on training: order, live view and versions."""


@dataclass(frozen=True, slots=True)
class SynchroniseCameras:
    """Measure how far the cameras of the open capture are ahead of each other."""


@dataclass(frozen=True, slots=True)
class ApplyOffsets:
    """Write a capture with the offsets that were measured."""

    target: Path
    """The capture's own folder, or another one."""


SynchronisationCommand = SynchroniseCameras | ApplyOffsets
"""Cameras that are ahead of others."""

CalibrationCommand = LookAtVideos | CalibrateVideos | KeepCalibration | StopCalibration
"""From plain videos to a capture."""


@dataclass(frozen=True, slots=True)
class AskExport:
    """Ask what of the open project is to be exported, and where."""


@dataclass(frozen=True, slots=True)
class StartExport:
    """Put an export into the queue."""

    choices: ExportChoices


@dataclass(frozen=True, slots=True)
class CancelExport:
    """End an export; what it began to write disappears."""

    export_id: int


@dataclass(frozen=True, slots=True)
class RetryExport:
    """Begin an export anew that failed or was cancelled."""

    export_id: int


@dataclass(frozen=True, slots=True)
class MoveExport:
    """Bring an export that waits to a place among those that wait."""

    export_id: int
    place: int


@dataclass(frozen=True, slots=True)
class RemoveExport:
    """Take an export that does not run out of the list; what it has written stays."""

    export_id: int


@dataclass(frozen=True, slots=True)
class ClearExports:
    """Take all exports that have ended out of the list; what they have written stays."""


@dataclass(frozen=True, slots=True)
class ShowExport:
    """Show what an export has written in the system's file manager."""

    export_id: int


ExportCommand = (
    AskExport | StartExport | CancelExport | RetryExport | MoveExport | RemoveExport | ClearExports | ShowExport
)
"""Commands that export from the project."""

ProjectCommand = NewProject | LeaveTraining | AskStartOver | StartOver | SetProjectsFolder
"""Which project is trained, and where projects lie."""

Command = (
    OpenCapture
    | OpenProject
    | ProjectCommand
    | CancelJob
    | FileCommand
    | TrainNextClip
    | QueueCommand
    | ClipCommand
    | ExclusionCommand
    | MendCommand
    | PauseTraining
    | ResumeTraining
    | StopTraining
    | SetFrame
    | TogglePlay
    | FollowTraining
    | LookThrough
    | SetCompare
    | ToggleOverlay
    | ShowHeat
    | SettingCommand
    | MarkCommand
    | PathCommand
    | EditCommand
    | SelectionCommand
    | Undo
    | Redo
    | GoToStep
    | CalibrationCommand
    | SynchronisationCommand
    | HomeView
    | SetFrameMemory
    | SetCompareWith
    | SetMode
    | SetContent
    | ShowViews
    | ActivateView
    | CloseQuestion
    | ForgetRecent
    | DismissNotice
    | DoctorCommand
    | ExportCommand
)
