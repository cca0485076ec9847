"""State of training for the window: the run at hand, clips, queue, plans and versions. Plain values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RunningClip:
    """One clip in training, here or elsewhere.

    Attributes:
        clip_index: The clip.
        state: starting, preparing, running, paused or stopping; unknown where another process has not said it yet.
        machine: Name of the computer that trains it; empty while not known.
        is_elsewhere: Whether another process trains it, which can only be asked to do something.
        who: That process as the subject of a sentence; empty for this one.
        stage: In words.
        step, n_steps: Optimiser steps; zeros while it is prepared.
        steps_per_s: 0 when unknown.
        eta_s: Seconds until it is finished; None when unknown.
        held_out_psnr: dB; None when not measured.
        since_s: For how long it trains already.
        worker: Which of the workers of this process, from 1; 0 of another one.
    """

    clip_index: int
    state: str
    machine: str = ""
    is_elsewhere: bool = False
    who: str = ""
    stage: str = ""
    step: int = 0
    n_steps: int = 0
    steps_per_s: float = 0.0
    eta_s: float | None = None
    held_out_psnr: float | None = None
    since_s: float = 0.0
    worker: int = 0


@dataclass(frozen=True, slots=True)
class MachineStatus:
    """A computer that trains clips of the project.

    Attributes:
        name: Of it.
        is_here: Whether it is this one.
        n_clips: Clips in training there.
        n_cores, load, free_mb: See MachineLoad; 0 and None where not known.
    """

    name: str
    is_here: bool = False
    n_clips: int = 0
    n_cores: int = 0
    load: float | None = None
    free_mb: float | None = None


@dataclass(frozen=True, slots=True)
class TrainingStatus:
    """The training as a whole, derived from queue, worker and last event.

    Attributes:
        state: idle, starting, preparing, running, paused, stopping or failed.
        clip_index: Clip of the worker, or of the last one that failed; None when idle. Of several that train here, the
            one at the playhead, else the one that began first: everything else here is about that one.
        n_running: How many clips this process trains.
        n_workers: How many it may train side by side.
        why_fewer: Why that is less than was asked for, one sentence; empty where it is not.
        trainings: All clips in training, here and elsewhere, in the order of their indices.
        machines: Computers that train them, this one first.
        step, n_steps: Optimiser steps of that clip.
        progress: Share of the current stage while preparing, of all steps later. 0..1
        stage: The present stage, as shown to the user.
        stage_number, n_stages: Which stage of the preparation that is, from 1; 0 where they are not counted.
        message: One line with counts and reasons.
        steps_per_s: Smoothed rate; 0 when unknown.
        eta_s: Seconds until the clip is finished; None when unknown.
        curve_clip_index: Clip of the histories: the one that trains, else the one at the playhead; None without one.
            While a clip is trained again they are those of its finished version until the first new figures come.
        gradient_norm: Largest norm over all gradients since the last report, before clipping; None when unknown.
        loss_history, psnr_history: (step, value) of that clip; PSNR is of held-out pictures, dB.
        can_train_next: Whether TrainNextClip would start something.
        next_clip_index: The clip that TrainNextClip would train; None when all are trained.
        resume_step: The step that it would continue from; None when it would start from the beginning.
        queue: Clips that wait.
    """

    state: str = "idle"
    clip_index: int | None = None
    n_running: int = 0
    n_workers: int = 1
    why_fewer: str = ""
    trainings: tuple[RunningClip, ...] = ()
    machines: tuple[MachineStatus, ...] = ()
    step: int = 0
    n_steps: int = 0
    progress: float = 0.0
    stage: str = ""
    stage_number: int = 0
    n_stages: int = 0
    message: str = ""
    steps_per_s: float = 0.0
    eta_s: float | None = None
    curve_clip_index: int | None = None
    gradient_norm: float | None = None
    loss_history: Sequence[tuple[int, float]] = ()
    psnr_history: Sequence[tuple[int, float]] = ()
    can_train_next: bool = False
    next_clip_index: int | None = None
    resume_step: int | None = None
    queue: tuple[int, ...] = ()

    @property
    def is_going(self) -> bool:
        """Whether something trains here."""
        return self.state not in ("idle", "failed")

    @property
    def is_paused(self) -> bool:
        """Whether all that trains here is paused."""
        return all(state == "paused" for state in self._states_here)

    @property
    def is_stopping(self) -> bool:
        """Whether all that trains here was told to end."""
        return all(state == "stopping" for state in self._states_here)

    @property
    def _states_here(self) -> list[str]:
        return [one.state for one in self.trainings if not one.is_elsewhere] or [self.state]

    @property
    def is_anywhere(self) -> bool:
        """Whether something trains, here or elsewhere."""
        return self.is_going or bool(self.trainings)

    def of_clip(self, clip_index: int) -> RunningClip | None:
        """The training of a clip; None where it does not train."""
        return next((one for one in self.trainings if one.clip_index == clip_index), None)


@dataclass(frozen=True, slots=True)
class ClipStatus:
    """One clip of the project.

    Attributes:
        state: untrained, queued, preparing, training, paused (its training holds and waits), stopped (its training
            has ended before the last step and resumes there), trained, failed, stale (its reference was trained
            again, or the clip that it continues from), or damaged (finished, but its file cannot be read).
        progress: Share of its steps, 0..1.
        held_out_psnr, held_out_whole: dB, and what it is over, see ClipRecord; None when not measured.
        n_inherited, n_own: All anchors of the clip, whatever frames they are alive in: those it inherits from the
            reference clip, and those it holds itself (all of the reference clip, residual ones of another). 0 where
            there are none yet.
        resume_step: The step that its training continues from; None when there is nothing to continue from. A clip that
            was being trained again when that was stopped is trained and has one.
        reason: Why it is stale or damaged; empty otherwise.
        exposure_change: How far the cameras' exposure is from the reference clip's on average, a share: 0.01 is 1
            percent; None where the clip is not finished.
    """

    state: str = "untrained"
    progress: float = 0.0
    held_out_psnr: float | None = None
    n_inherited: int = 0
    n_own: int = 0
    resume_step: int | None = None
    reason: str = ""
    exposure_change: float | None = None
    held_out_whole: bool = False


@dataclass(frozen=True, slots=True)
class SequenceForecast:
    """Cost of training several clips one after another, as far as it is known.

    Attributes:
        n_clips: How many are not finished.
        n_steps: Steps that are left.
        seconds: Until the last of them is finished; None where nobody can know.
        disk_mb: Their size on disk, 10^6 bytes; None where nobody can know.
    """

    n_clips: int
    n_steps: int = 0
    seconds: float | None = None
    disk_mb: float | None = None


@dataclass(frozen=True, slots=True)
class QueuedClip:
    """A clip that waits to be trained.

    Attributes:
        n_steps: Steps that are left of it.
        seconds: How long it is expected to take; None where nobody can know.
        has_own_settings: Whether it is trained with other settings than its project.
    """

    clip_index: int
    n_steps: int = 0
    seconds: float | None = None
    has_own_settings: bool = False


@dataclass(frozen=True, slots=True)
class QueueStatus:
    """Clips that wait, those that failed, and the cost of all.

    Attributes:
        waiting: In the order in which they are trained.
        failed: Clips whose training failed, each with the reason.
        is_held: Whether they wait until the user continues.
        is_ending_after: Whether they are held once the clip that trains has ended.
        queued: The clip that trains and those that wait; None without any.
        everything: All clips that are not finished, whether they wait or not; None where every clip is.
        stale: Clips that are out of date and do not wait: what training them again takes; None where there are none.
        progress: Share of the steps of the present sequence that is done, 0..1.
        n_done: Clips of that sequence that have ended.
        free_mb: Room on the disk of the project, 10^6 bytes; None where not known.
        live_view: How often the clip that trains is shown anew: "off", "low" or "live".
    """

    waiting: tuple[QueuedClip, ...] = ()
    failed: tuple[tuple[int, str], ...] = ()
    is_held: bool = False
    is_ending_after: bool = False
    queued: SequenceForecast | None = None
    everything: SequenceForecast | None = None
    stale: SequenceForecast | None = None
    progress: float = 0.0
    n_done: int = 0
    free_mb: float | None = None
    live_view: str = "live"


@dataclass(frozen=True, slots=True)
class UsageStatus:
    """Use of the machine by the program's processes; None where the system does not say.

    Attributes:
        window_mb, training_mb: Memory, 10^6 bytes.
        window_cores, training_cores: Processor time per time since the look before: 1 is one core all of the time.
        n_cores: Of the machine.
    """

    window_mb: float | None = None
    window_cores: float | None = None
    training_mb: float | None = None
    training_cores: float | None = None
    n_cores: int = 1


@dataclass(frozen=True, slots=True)
class VersionStatus:
    """An earlier result of a clip, kept when it was trained again.

    Attributes:
        number: Names it for RestoreVersion and RemoveVersion.
        trained: When it was trained, local time as text.
        step: Steps it was trained for.
        held_out_psnr, held_out_whole: dB, and what it is over, see ClipRecord; None where not measured.
        n_bytes: Size of its file.
        differences: Settings in which it differs from the finished clip: name, its value, that of the clip.
        why_not: Why it cannot be brought back now; empty where it can.
    """

    number: int
    trained: str = ""
    step: int = 0
    held_out_psnr: float | None = None
    n_bytes: int = 0
    differences: tuple[tuple[str, str, str], ...] = ()
    why_not: str = ""
    held_out_whole: bool = False


@dataclass(frozen=True, slots=True)
class DependencyStatus:
    """The clips that a clip depends on, and those that depend on it.

    Attributes:
        needs: Clips that it starts from.
        needed_by: Clips that start from it, whether they are trained or not.
        trained_on_it: Finished clips that were trained on it as it is now.
        outdated_seconds: Expected time of training these again; None where nobody can know.
    """

    needs: tuple[int, ...] = ()
    needed_by: tuple[int, ...] = ()
    trained_on_it: tuple[int, ...] = ()
    outdated_seconds: float | None = None


@dataclass(frozen=True, slots=True)
class SettingStatus:
    """A training setting that the user may change before the first clip is finished.

    Attributes:
        name: In TrainConfig.
        value: Its value, set or derived.
        is_set: Whether the user has set it; else it is derived or the default.
        help_text: Its effect and its valid values.
    """

    name: str
    label: str
    value: int
    is_set: bool = False
    help_text: str = ""


@dataclass(frozen=True, slots=True)
class PlanStatus:
    """Plan and cost of training the next clip, while nothing trains.

    Attributes:
        summary: Steps, time, memory and disk in one line; empty until they are known.
        lines: Name and value of everything that is known.
        presets: Names to choose from.
        preset: The one that the settings begin with.
        settings: The main ones.
        can_edit: Whether they may still change: no clip is finished.
        discards: The progress that a change discards, as "the progress of clip 0 (step 331 of 720)"; empty for nothing.
    """

    clip_index: int
    summary: str = ""
    lines: tuple[tuple[str, str], ...] = ()
    presets: tuple[str, ...] = ()
    preset: str = ""
    settings: tuple[SettingStatus, ...] = ()
    can_edit: bool = False
    discards: str = ""
