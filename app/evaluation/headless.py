"""Jobs without a window: train clips, open trained projects. Prints nothing."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from app.project.clips.clip_versions import read_finished, recovery_hint
from app.project.opening.opening import open_capture_of
from app.project.project import Project
from app.status import TrainingStatus
from app.training.clip_run import ClipRun
from app.training.messages import ENDINGS, ClipTrained, Event, TrainingFailed, WorkerDied
from app.training.service import ClipEvent, TrainingService
from app.training.train_queue import OwnSettings, needed_clips
from app.training.training_status import training_status
from engine.backends.table import process_backend
from engine.camera.corrections import corrected
from engine.camera.rig import CameraRig
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.clip_files.clip_header import ClipHeader
from engine.clip_files.clip_state import ClipState, DamagedClip, look_at_clip
from engine.errors import DiskError, ProjectError

if TYPE_CHECKING:
    from engine.backends.backend import Backend
    from engine.editing.clip_rows import NamedSet
    from engine.editing.edited_clip import EditedClip
    from engine.metrics.clips.trained_clip import TrainedClip

TRAIN_SCHEMA = 1
BAD_INPUT_KINDS = ("CaptureError", "ProjectError")
"""Worker failures caused by the input, not by the program."""
POLL_EVERY_S, POLL_AT_LEAST_EVERY_S = 0.05, 1.0
_FEW = 16
"""Clips in training up to which workers are looked at that often; the more there are, the less often."""
STOP_TIMEOUT_S = 60.0
"""A step that changes the phase can take some seconds, and so can writing; neither is cut short."""


@dataclass(frozen=True, slots=True)
class ClipOutcome:
    """How the training of one clip ended.

    Attributes:
        state: trained, skipped (it was trained before), stopped, failed, damaged (its file cannot be read, or that
            of a clip which it needs; it is left as it is), or left_out (another one failed before it began).
        step: Steps done.
        held_out_psnr, held_out_whole: dB, and its scope, see ClipRecord; None when not measured.
        seconds: Wall time of this run, preparation included.
        message, hint, kind: Of a failure or a damage.
        left_out_by: The clip whose failure kept this one from being trained; None for none.
    """

    clip_index: int
    state: str
    step: int = 0
    held_out_psnr: float | None = None
    seconds: float = 0.0
    message: str = ""
    hint: str = ""
    kind: str = ""
    held_out_whole: bool = False
    left_out_by: int | None = None


def train_clips(
    service: TrainingService,
    clip_indices: Sequence[int],
    *,
    on_status: Callable[[TrainingStatus], None],
    on_event: Callable[[ClipEvent], None],
    on_outcome: Callable[[ClipOutcome], object],
    on_begin: Callable[[int], None] = lambda clip_index: None,
    is_again: bool = False,
    own: OwnSettings | None = None,
    more: Callable[[], Sequence[int] | None] = lambda: None,
    sleep: Callable[[float], None] = time.sleep,
) -> list[ClipOutcome]:
    """Train clips, as many in parallel as the service allows. Where one fails, those that do not need it are trained
    all the same, unless it was the disk that failed. KeyboardInterrupt stops all trainings, keeps progress and is
    raised again.

    Args:
        service: Queue and workers of the project.
        clip_indices: In order.
        on_status, on_event, on_outcome: Receive progress.
        on_begin: Receives the index of each clip before it is trained; not of those left as they are.
        is_again: Train also clips that are trained or damaged; their former state becomes a version.
        own: Settings for these clips alone; their trainings then begin afresh.
        more: Asked all the time for further clips, which may have come up meanwhile; None once there will be no more.
        sleep: Waits some seconds between looks.
    Raises:
        ProjectError: A clip cannot be trained, for instance because its reference is not.
        KeyboardInterrupt: After the workers have ended and their checkpoints are written.
    """
    outcomes: list[ClipOutcome] = []
    waiting, begun, may_come = deque(clip_indices), dict[int, float](), True
    lost: dict[int, int] = {}  # clips that cannot come now, and the one whose failure is behind it

    def end(outcome: ClipOutcome) -> None:
        nonlocal may_come
        outcomes.append(outcome)
        on_outcome(outcome)
        if outcome.state in ("failed", "stopped", "left_out"):
            failed = outcome.clip_index if outcome.left_out_by is None else outcome.left_out_by
            lost[outcome.clip_index] = failed
            if outcome.kind == DiskError.__name__:  # the others would train for hours and fail likewise
                lost.update(dict.fromkeys(waiting, failed))
            is_end = outcome.kind == DiskError.__name__ or outcome.clip_index == service.catalog.order[0]
            may_come = may_come and not is_end

    try:
        while True:
            further = more() if may_come else None
            may_come = further is not None
            waiting += further or ()
            if not (waiting or begun or may_come):
                return outcomes
            while waiting and _has_room(service, waiting[0], begun):
                clip_index = waiting.popleft()
                left = _left_as_it_is(service, clip_index, is_again=is_again) or _left_out(service, clip_index, lost)
                if left is not None:
                    end(left)
                    continue
                on_begin(clip_index)
                service.add(clip_index, own)
                begun[clip_index] = time.monotonic()
            service.go_on()
            runs = dict(service.runs)
            for clip_index, event in service.poll():
                on_event((clip_index, event))
                if isinstance(event, ENDINGS) and clip_index in begun:
                    seconds = time.monotonic() - begun.pop(clip_index)
                    end(_outcome(service, clip_index, runs.get(clip_index), event, seconds))
            on_status(training_status(service))
            sleep(min(POLL_EVERY_S * max(len(runs) / _FEW, 1.0), POLL_AT_LEAST_EVERY_S))
    except KeyboardInterrupt:
        service.close(timeout_s=STOP_TIMEOUT_S)
        raise


def _has_room(service: TrainingService, clip_index: int, begun: Collection[int]) -> bool:
    n_here = sum(index not in service.elsewhere for index in begun)  # the others wait for other processes
    return n_here < service.n_workers and not any(index in begun for index in needed_clips(service.project, clip_index))


def _outcome(
    service: TrainingService, clip_index: int, run: ClipRun | None, ending: Event, seconds: float
) -> ClipOutcome:
    """run: None of a clip that another process has trained."""
    step = 0 if run is None else run.step
    match ending:
        case ClipTrained():
            return ClipOutcome(clip_index, "trained", ending.step, ending.held_out_psnr, seconds)
        case TrainingFailed():
            return ClipOutcome(
                clip_index,
                "failed",
                step,
                seconds=seconds,
                message=ending.message,
                hint=ending.hint,
                kind=ending.kind,
            )
        case WorkerDied():
            hint = f"Train again to resume. Its log is {service.project.log_path(clip_index)}."
            return ClipOutcome(clip_index, "failed", step, seconds=seconds, message=f"{ending.reason}.", hint=hint)
        case _:
            return ClipOutcome(clip_index, "stopped", step, seconds=seconds)


def _left_as_it_is(service: TrainingService, clip_index: int, *, is_again: bool) -> ClipOutcome | None:
    """The outcome of a clip that is not trained now; None for one that is."""
    known = service.catalog[clip_index]
    if known.state == "trained" and not is_again:
        return ClipOutcome(clip_index, "skipped", known.step, known.held_out_psnr, held_out_whole=known.held_out_whole)
    if (known.state == "damaged" and not is_again) or known.blocked_by is not None:
        return _left_alone(service, clip_index)
    return None


def _left_out(service: TrainingService, clip_index: int, lost: Mapping[int, int]) -> ClipOutcome | None:
    """The outcome of a clip that cannot be trained, as another one failed; None for one that can."""
    for other in (clip_index, *needed_clips(service.project, clip_index)):
        if other in lost:
            return ClipOutcome(clip_index, "left_out", left_out_by=lost[other])
    return None


def _left_alone(service: TrainingService, clip_index: int) -> ClipOutcome:
    """A damaged clip is only trained again on request: its file may be recoverable."""
    record = service.catalog[clip_index]
    damaged = clip_index if record.state == "damaged" else record.blocked_by
    assert damaged is not None
    message = f"Clip {clip_index} was skipped: "
    message += (
        service.catalog[damaged].reason if damaged == clip_index else f"it needs clip {damaged}, which is damaged."
    )
    path = service.project.clip_path(damaged)
    hint = f"Restore the file from a backup, or remove it to train clip {damaged} again - {path}"
    return ClipOutcome(clip_index, "damaged", message=message, hint=hint, kind="ProjectError")


# ---------------------------------------------------------------- trained clips


@dataclass(frozen=True, slots=True)
class TrainedProject:
    """A project opened for reading, with its capture.

    Attributes:
        reference: The clip that others inherit from; None where clips are independent and it is not trained.
    """

    project: Project
    capture: Capture
    clips: list[Clip]
    reference: ClipState | None

    @property
    def backend(self) -> Backend:
        """The back end of this process, which decodes and draws clips."""
        return process_backend()

    @property
    def measured(self) -> TrainedProject:
        """The same with the capture as it is measured: without the document's exclusions."""
        return replace(self, capture=self.capture.without(self.project.document.exclusions))

    @property
    def rig(self) -> CameraRig:
        """The cameras of the capture as the reference clip refined them; see engine.camera.corrections."""
        if self.reference is None:
            return self.capture.rig
        return corrected(self.capture.rig, self.reference.header.camera_names, self.reference.corrections)

    @property
    def up(self) -> np.ndarray:
        """The scene's up direction: the user's, else the one that the cameras agree on. [3]"""
        said = self.project.document.world.up
        return self.capture.rig.up_direction() if said is None else np.array(said)

    @property
    def trained(self) -> list[int]:
        """Indices of the finished clips."""
        return [clip.clip_index for clip in self.clips if self.project.is_trained(clip.clip_index)]

    @property
    def last_trained(self) -> int:
        """Index of the finished clip that comes last in the order of training."""
        return next(i for i in reversed(self.project.training_order(len(self.clips))) if i in self.trained)

    def header(self, clip_index: int) -> ClipHeader:
        """Header of a finished clip.

        Raises:
            ProjectError: It is not trained or damaged.
        """
        header = look_at_clip(self.project.clip_path(clip_index))
        if header is None:
            raise ProjectError(f"Clip {clip_index} is not trained.", hint="Train it first.", path=self.project.folder)
        if isinstance(header, DamagedClip):
            error = header.error()
            raise ProjectError(error.message, hint=recovery_hint(self.project, clip_index), path=error.path)
        return header

    def load(self, clip_index: int) -> TrainedClip:
        """Load a finished clip.

        Raises:
            ProjectError: It is not trained, damaged, or was trained on another reference.
        """
        from engine.metrics.clips.trained_clip import TrainedClip
        from engine.model.reading import load_clip_model, read_field

        if clip_index not in self.trained:
            raise ProjectError(
                f"Clip {clip_index} is not trained; trained are {self.trained or 'none'}.",
                hint="Train it first.",
                path=self.project.folder,
            )
        state = read_finished(self.project, clip_index)
        base = state if state.is_reference or self.reference is None else self.reference
        model = load_clip_model(state, self.reference, backend=self.backend)
        if self.project.settings.config().field == "continue":  # one field for all clips: as the last one left it
            last = read_finished(self.project, self.last_trained)
            if last.header.field and model.field is not None:
                model.attach_field(read_field(last).requires_grad_(requires_grad=False))
        return TrainedClip(self.clips[clip_index], model, base, state.drift)

    def named_sets(self, trained: TrainedClip) -> dict[str, NamedSet]:
        """The sets of Gaussians of a loaded clip, by what edits and objects call them. Raises as `header` does."""
        from engine.editing.clip_rows import named_sets

        reference_index = 0 if self.reference is None else self.reference.header.clip_index
        return named_sets(trained.model, self.header(trained.clip.clip_index), reference_index)

    def edited(self, trained: TrainedClip) -> EditedClip:
        """A loaded clip as edits find it. Raises as `header` does."""
        from engine.editing.edited_clip import EditedClip

        return EditedClip(trained.model, trained.clip, self.named_sets(trained))


def open_trained(project: Project, capture: Capture | None = None) -> TrainedProject:
    """Open a trained project with its capture.

    Args:
        capture: Its capture where that is open already.
    Raises:
        CaptureError: The capture is gone or damaged.
        ProjectError: It is another one, or nothing is trained yet.
    """
    settings = project.settings
    capture = open_capture_of(settings, project.folder) if capture is None else capture
    clips = project.clips(capture.n_frames)
    has_reference = project.is_trained(settings.reference_clip)
    can_do_without = settings.config().independent and any(project.is_trained(clip.clip_index) for clip in clips)
    if not has_reference and not can_do_without:
        raise ProjectError(
            "Nothing is trained in this project yet.", hint="Run `clipgstream train` first.", path=project.folder
        )
    reference = read_finished(project, settings.reference_clip) if has_reference else None
    return TrainedProject(project, capture, clips, reference)


def train_document(project: Project, capture: Capture, outcomes: Sequence[ClipOutcome]) -> dict[str, Any]:
    """The document of `train --json`: schema, project, capture, holdout, and per clip its index, state, steps, held-out
    PSNR (dB or null), whether that is over every frame of the held-out cameras, and seconds."""
    return {
        "schema": TRAIN_SCHEMA,
        "project": str(project.folder),
        "capture": str(Path(capture.path)),
        "holdout": list(project.settings.holdout),
        "clips": [
            {
                "clip_index": outcome.clip_index,
                "state": outcome.state,
                "steps": outcome.step,
                "held_out_psnr": outcome.held_out_psnr,
                "held_out_whole": outcome.held_out_whole,
                "seconds": round(outcome.seconds, 2),
            }
            for outcome in outcomes
        ],
    }
