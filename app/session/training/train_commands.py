"""Commands about the order of training, the live view, and versions of clips."""

from __future__ import annotations

from dataclasses import dataclass


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
    """Ask which settings a clip is to be trained with, instead of the project's."""

    clip_index: int


@dataclass(frozen=True, slots=True)
class TrainClips:
    """Train those of these clips that are not finished, one after the other, preceded by the clips that they need."""

    clip_indices: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class TrainAll:
    """Train every clip that is not finished."""


@dataclass(frozen=True, slots=True)
class TrainStale:
    """Train every clip again that is out of date, one after the other."""


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
    """Let the queue wait once the clip that trains has ended, or continue after all."""

    is_wanted: bool = True


@dataclass(frozen=True, slots=True)
class PauseTraining:
    """Hold what trains where it is: one clip, or all of them when None."""

    clip_index: int | None = None


@dataclass(frozen=True, slots=True)
class ResumeTraining:
    """Resume a clip after a pause; when None all of them, or continue with a queue that waits."""

    clip_index: int | None = None


@dataclass(frozen=True, slots=True)
class StopTraining:
    """End the training of a clip, keeping progress; when None of all that train here, which also empties the queue."""

    clip_index: int | None = None


@dataclass(frozen=True, slots=True)
class SetWorkers:
    """Train this many clips side by side, as far as the computer allows it; those that train continue."""

    n: int


@dataclass(frozen=True, slots=True)
class SetLiveView:
    """How often the clip that trains is shown anew: "off", "low" or "live". Training continues meanwhile."""

    mode: str


@dataclass(frozen=True, slots=True)
class RestoreVersion:
    """Bring back an earlier version of a clip; the present one becomes a version."""

    clip_index: int
    version: int


@dataclass(frozen=True, slots=True)
class RemoveVersion:
    """Delete an earlier version of a clip for good."""

    clip_index: int
    version: int


@dataclass(frozen=True, slots=True)
class JoinCluster:
    """Train clips of the open project on a cluster from now on. address: As of `train --cluster`."""

    address: str


@dataclass(frozen=True, slots=True)
class LeaveCluster:
    """Train clips on this computer again."""


VersionCommand = RestoreVersion | RemoveVersion
"""Commands on versions of a clip."""

HoldCommand = PauseTraining | ResumeTraining | StopTraining | SetWorkers
"""Commands on the clips that train."""

ClusterCommand = JoinCluster | LeaveCluster
"""Commands on the cluster that clips train on."""

TrainCommand = (
    TrainNextClip
    | TrainClip
    | TrainClips
    | TrainAll
    | TrainStale
    | AskTrainSettings
    | MoveInQueue
    | RemoveFromQueue
    | StopAfterClip
    | SetLiveView
    | VersionCommand
)
"""Commands on training: order, live view and versions."""
