"""Messages between the window's process and a worker: frozen structs of plain values.

Commands go in and are imperative; events come out and are past tense. Bulk crosses as files, never as messages.
"""

from __future__ import annotations

from msgspec import Struct, field

from app.project.claims.holder_record import MachineLoad
from engine.backends.table import chosen_name
from engine.capture.clip import Clip
from engine.capture.exclusions import NOTHING_EXCLUDED, Exclusions
from engine.clip_files.clip_header import SettingValue
from engine.gate.regions import GateRegion
from engine.portable import NATIVE, Processor

LIVE_VIEWS = ("off", "low", "live")
"""How often a worker writes snapshots: never, now and then, or as often as they are looked at."""

# ---------------------------------------------------------------- the job


class TrainJob(Struct, frozen=True):
    """Everything about the training of one clip that is not bulk; that comes from a store by its key. A copy: later
    changes of the project do not reach it.

    Attributes:
        key: Of the clip, in the store.
        clip: Its frames.
        reference: Key of the clip that it inherits from; None where it inherits nothing.
        previous: Key of the clip that it continues from; None where it continues from none.
        fingerprint: Of the capture.
        scale, seed, overrides: As in the project.
        holdout: Camera indices never trained on.
        frames: Of the capture, as in the project, or up to the clip's last one where nothing may look further.
        exclusions, regions: As in the project.
        backend: Name of the back end.
        cpu: Whether its numbers are to be the same on every kind of processor, see engine.portable.
        is_window_open: Leave a core, or at least right of way, to a window.
        live_view: How often snapshots are written, one of LIVE_VIEWS.
        n_beside: How many trainings share the cores, this one included.
        n_everywhere: How many processes train clips of the project, on all computers, as far as is known.
        claim: Token of the process that has claimed the clip; empty where none has.
        n_threads: Threads to compute with; None for a share of the cores.
    """

    key: str
    clip: Clip
    fingerprint: str
    scale: float = 1.0
    reference: str | None = None
    previous: str | None = None
    holdout: tuple[int, ...] = ()
    seed: int = 0
    overrides: dict[str, SettingValue] = field(default_factory=dict)
    frames: tuple[int, int] | None = None
    exclusions: Exclusions = NOTHING_EXCLUDED
    regions: tuple[GateRegion, ...] = ()
    is_window_open: bool = True
    live_view: str = "live"
    n_beside: int = 1
    n_everywhere: int = 1
    claim: str = ""
    n_threads: int | None = None
    cpu: Processor = NATIVE
    backend: str = field(default_factory=chosen_name)

    @property
    def clip_index(self) -> int:
        """Index of the clip."""
        return self.clip.clip_index


# ---------------------------------------------------------------- commands


class Pause(Struct, frozen=True, tag=True):
    """Hold after the current step."""


class Resume(Struct, frozen=True, tag=True):
    """Resume after Pause."""


class Stop(Struct, frozen=True, tag=True):
    """End after the current step.

    Attributes:
        keep: Write a checkpoint to continue from later; otherwise forget this training.
    """

    keep: bool = True


class SnapshotNow(Struct, frozen=True, tag=True):
    """Write a snapshot at the next chance."""


class SnapshotConsumed(Struct, frozen=True, tag=True):
    """The snapshot of this revision was read; the next one may be written."""

    revision: int


class SetSnapshots(Struct, frozen=True, tag=True):
    """Write snapshots this often from now on: one of LIVE_VIEWS."""

    mode: str


# ---------------------------------------------------------------- events


class WorkerReady(Struct, frozen=True, tag=True):
    """The worker runs and has read the job. machine: Name of the computer."""

    pid: int
    n_threads: int
    machine: str = ""


class LoadReported(Struct, frozen=True, tag=True):
    """How busy the computer of the worker is, where that is another one."""

    load: MachineLoad


class StageReported(Struct, frozen=True, tag=True):
    """How far a preparation stage is. done in 0..1"""

    stage: str
    done: float
    message: str = ""


class StepReported(Struct, frozen=True, tag=True):
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


class HeldOutMeasured(Struct, frozen=True, tag=True):
    """PSNR of a few held-out pictures, dB."""

    step: int
    psnr: float


class SnapshotWritten(Struct, frozen=True, tag=True):
    """A complete snapshot is in the store."""

    revision: int
    step: int


class WarningRaised(Struct, frozen=True, tag=True):
    """Something the user should know; training continues."""

    title: str
    detail: str = ""
    hint: str = ""


class TrainingPaused(Struct, frozen=True, tag=True):
    """The worker waits."""

    step: int


class TrainingResumed(Struct, frozen=True, tag=True):
    """The worker continues."""

    step: int


class ClipTrained(Struct, frozen=True, tag=True):
    """The clip is finished, was read back and is in the store, from which the owner of the project takes it in."""

    step: int
    held_out_psnr: float | None = None


class TrainingStopped(Struct, frozen=True, tag=True):
    """The worker ended before the last step. `is_kept`: whether there is a checkpoint."""

    is_kept: bool
    step: int


class TrainingFailed(Struct, frozen=True, tag=True):
    """The training cannot continue. `kind` names the error's class; `trace` is for the log."""

    kind: str
    message: str
    hint: str = ""
    trace: str = ""


class WorkerDied(Struct, frozen=True, tag=True):
    """The process ended without sending an ending. Made on the window's side, never sent.

    Attributes:
        reason: Without a full stop.
    """

    reason: str
    log_tail: str = ""


Command = Pause | Resume | Stop | SnapshotNow | SnapshotConsumed | SetSnapshots
Event = (
    WorkerReady
    | LoadReported
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
ENDINGS = (ClipTrained, TrainingStopped, TrainingFailed, WorkerDied)
"""After one of these a worker sends nothing more."""
