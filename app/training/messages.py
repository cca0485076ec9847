"""Messages between the window's process and a worker: frozen dataclasses of plain values, sent as JSON bytes.

Commands go in and are imperative; events come out and are past tense. Bulk crosses as files, never as messages.
JSON and an explicit table of classes, so that receiving a message can never run code.
"""

from __future__ import annotations

import json
import typing
from dataclasses import asdict, dataclass, field, fields

from engine.backends.table import chosen_name
from engine.clip_files.clip_header import SettingValue
from engine.storage.typed_json import to_type

LIVE_VIEWS = ("off", "low", "live")
"""How often a worker writes snapshots: never, now and then, or as often as they are looked at."""

# ---------------------------------------------------------------- the job


@dataclass(frozen=True, slots=True)
class TrainJob:
    """Everything a worker needs to train one clip. A copy: later changes of the project do not reach it.

    Attributes:
        project: Project folder.
        capture: Capture folder.
        scale, clip_length, seed, overrides: As in the project.
        clip_index: The clip to train.
        holdout: Camera indices never trained on.
        follow_links: Whether files of the capture may lie outside of its folder.
        frames: Of the capture, as in the project.
        backend: Name of what is computed with.
        is_window_open: Leave a core, or at least right of way, to a window.
        live_view: How often snapshots are written, one of LIVE_VIEWS.
    """

    project: str
    capture: str
    scale: float
    clip_length: int
    clip_index: int
    holdout: tuple[int, ...] = ()
    seed: int = 0
    overrides: dict[str, SettingValue] = field(default_factory=dict)
    is_window_open: bool = True
    follow_links: bool = False
    live_view: str = "live"
    frames: tuple[int, int] | None = None
    backend: str = field(default_factory=chosen_name)


# ---------------------------------------------------------------- commands


@dataclass(frozen=True, slots=True)
class Pause:
    """Hold after the current step."""


@dataclass(frozen=True, slots=True)
class Resume:
    """Go on after Pause."""


@dataclass(frozen=True, slots=True)
class Stop:
    """End after the current step.

    Attributes:
        keep: Write a checkpoint to go on from later; otherwise forget this training.
    """

    keep: bool = True


@dataclass(frozen=True, slots=True)
class SnapshotNow:
    """Write a snapshot at the next chance."""


@dataclass(frozen=True, slots=True)
class SnapshotConsumed:
    """The snapshot of this revision was read; the next one may be written."""

    revision: int


@dataclass(frozen=True, slots=True)
class SetSnapshots:
    """Write snapshots this often from now on: one of LIVE_VIEWS."""

    mode: str


# ---------------------------------------------------------------- events


@dataclass(frozen=True, slots=True)
class WorkerReady:
    """The worker runs and has read the job."""

    pid: int
    n_threads: int


@dataclass(frozen=True, slots=True)
class StageReported:
    """How far a preparation stage is. done in 0..1"""

    stage: str
    done: float
    message: str = ""


@dataclass(frozen=True, slots=True)
class StepReported:
    """Where the training is; sent a few times per second.

    Since the last report, loss is the mean and gradient_norm the largest.
    """

    step: int
    n_steps: int
    loss: float
    train_psnr: float
    n_gaussians: int
    stage: str
    steps_per_s: float
    gradient_norm: float


@dataclass(frozen=True, slots=True)
class HeldOutMeasured:
    """PSNR of a few held-out pictures, dB."""

    step: int
    psnr: float


@dataclass(frozen=True, slots=True)
class SnapshotWritten:
    """A complete snapshot lies at `path`."""

    revision: int
    step: int
    path: str


@dataclass(frozen=True, slots=True)
class WarningRaised:
    """Something the user should know; training goes on."""

    title: str
    detail: str = ""
    hint: str = ""


@dataclass(frozen=True, slots=True)
class TrainingPaused:
    """The worker waits."""

    step: int


@dataclass(frozen=True, slots=True)
class TrainingResumed:
    """The worker goes on."""

    step: int


@dataclass(frozen=True, slots=True)
class ClipTrained:
    """The clip is finished, was read back and lies at `path`."""

    path: str
    step: int
    held_out_psnr: float | None = None


@dataclass(frozen=True, slots=True)
class TrainingStopped:
    """The worker ended before the last step. `path` is the checkpoint, empty when there is none."""

    path: str
    step: int


@dataclass(frozen=True, slots=True)
class TrainingFailed:
    """The training cannot go on. `kind` names the error's class; `trace` is for the log."""

    kind: str
    message: str
    hint: str = ""
    trace: str = ""


@dataclass(frozen=True, slots=True)
class WorkerDied:
    """The process ended without a word. Made by the service, never sent."""

    exit_code: int | None
    log_tail: str = ""


Command = Pause | Resume | Stop | SnapshotNow | SnapshotConsumed | SetSnapshots
Event = (
    WorkerReady
    | StageReported
    | StepReported
    | HeldOutMeasured
    | SnapshotWritten
    | WarningRaised
    | TrainingPaused
    | TrainingResumed
    | ClipTrained
    | TrainingStopped
    | TrainingFailed
    | WorkerDied
)
Message = TrainJob | Command | Event

MESSAGE_TYPES: dict[str, type] = {
    kind.__name__: kind for kind in (TrainJob, *typing.get_args(Command), *typing.get_args(Event))
}
ENDINGS = (ClipTrained, TrainingStopped, TrainingFailed, WorkerDied)
"""After one of these a worker says nothing more."""


def encode(message: Message) -> bytes:
    """One message as UTF-8 JSON. Non-finite numbers travel as NaN and Infinity, which Python's JSON reads back."""
    return json.dumps([type(message).__name__, asdict(message)]).encode()


def decode(data: bytes) -> Message:
    """Inverse of `encode`.

    Raises:
        ValueError: The bytes are not a message of this version.
    """
    try:
        name, values = json.loads(data)
        kind = MESSAGE_TYPES[name]
        unknown = values.keys() - {item.name for item in fields(kind)}
        if unknown:
            raise ValueError(f"unknown entries: {unknown}")
        return to_type(values, kind)
    except (KeyError, TypeError, AttributeError, ValueError, UnicodeDecodeError) as error:
        raise ValueError(f"not a message: {data[:80]!r}") from error
