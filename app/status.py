"""What the window shows of training, clips, jobs and overlays: plain values, remade when something changes."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from engine.gate.regions import GateRegion

OVERLAY_NAMES = (
    "show_frusta",
    "show_inherited",
    "show_residual",
    "show_points",
    "show_cloud",
    "show_regions",
    "show_coverage",
    "show_trails",
    "show_paths",
)
COMPARE_MODES = ("off", "wipe", "side", "blink")
CAPTURED = "captured"
"""Of Overlays.compare_with: what the camera took."""
_VERSION = "version "
BLINK_HZ = (0.25, 3.0)
"""Slowest and fastest blinking. More than three flashes a second can cause seizures."""


def version_name(number: int) -> str:
    """An earlier version of a clip, for Overlays.compare_with."""
    return f"{_VERSION}{number}"


def version_number(other: str) -> int | None:
    """Inverse of `version_name`; None of anything else."""
    number = other.removeprefix(_VERSION)
    return int(number) if other.startswith(_VERSION) and number.isascii() and number.isdigit() else None


@dataclass(slots=True)
class Overlays:
    """Overlays of the scene and pictures next to it.

    Attributes:
        show_points: The point cloud where a clip is not trained.
        show_cloud: The point cloud in place of the picture of a trained clip.
        show_coverage: The space that inherited anchors cover, and how far residual anchors lie from it.
        show_trails: The ways that Gaussians took over the last frames.
        show_paths: The chosen camera path and its keys.
        compare: "off", "wipe", "side" or "blink": another picture over, beside or in turn with the rendered one.
        compare_with: The other picture: CAPTURED, the name of a mode (see view_modes), or that of an earlier version of
            the clip, see `version_name`.
        wipe_position: Share of the width that shows the other picture, 0..1.
        blink_hz: How often a second each of the two pictures is seen.
        mode, content: What colours mean and which part of a clip is drawn, by name; see app.playback.modes.view_modes.
        heat: Name of the residual heat map over the picture, see app.residuals.heat_map.HEAT_KINDS; empty for none.
            Where no camera is looked through, the residual of each anchor is shown in its place.
        heat_opacity: Of the heat map, 0..1.
        mark_size: Of anchor marks, 1 as designed.
        mark_opacity: Of anchor marks that nothing hides, 0..1.
    """

    show_frusta: bool = True
    show_inherited: bool = False
    show_residual: bool = False
    show_points: bool = True
    show_cloud: bool = False
    show_regions: bool = True
    show_coverage: bool = False
    show_trails: bool = False
    show_paths: bool = True
    compare: str = "off"
    compare_with: str = CAPTURED
    blink_hz: float = 1.0
    wipe_position: float = 0.5
    mode: str = "color"
    content: str = "all"
    heat: str = ""
    heat_opacity: float = 0.75
    mark_size: float = 1.0
    mark_opacity: float = 0.9


@dataclass(frozen=True, slots=True)
class WantedFrame:
    """The wanted picture, whatever is on screen now.

    Attributes:
        clip_index, frame_index: Under the playhead.
        revision: The state of the clip that is to be shown; empty where none can be: it is not trained.
        camera_index: The capture camera looked through; None for a free view.
        look: From where and through which lens; see OrbitView.look_key.
        shown_as: What colours mean and which part of the clip is drawn, in words; empty for the scene as it is.
        is_loaded: Whether the clip is in memory, so that only its frame has to be made.
        has_failed: Whether the frame or its picture could not be made, so that it is not on its way.
    """

    clip_index: int
    frame_index: int
    revision: str = ""
    camera_index: int | None = None
    look: Hashable = None
    shown_as: str = ""
    is_loaded: bool = False
    has_failed: bool = False


@dataclass(frozen=True, slots=True)
class ProjectStatus:
    """The open project.

    Attributes:
        name: As shown to the user.
        folder: Where it lies.
        n_trained, n_clips: Clips that are finished and up to date, and all of them.
        is_writable: Whether it can be trained into.
    """

    name: str
    folder: Path
    n_trained: int = 0
    n_clips: int = 0
    is_writable: bool = True

    @property
    def trained_text(self) -> str:
        """How far it is trained, in words."""
        return f"{self.n_trained} of {self.n_clips} clips trained"


@dataclass(frozen=True, slots=True)
class TrainingStatus:
    """The training as a whole, derived from queue, worker and last event.

    Attributes:
        state: idle, starting, preparing, running, paused, stopping or failed.
        clip_index: Clip of the worker, or of the last one that failed; None when idle. Of several that train, the one
            that began first: everything else here is about that one.
        n_running: How many clips train.
        step, n_steps: Optimiser steps of that clip.
        progress: Share of the current stage while preparing, of all steps later. 0..1
        stage: What is done at the moment, as shown to the user.
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


@dataclass(frozen=True, slots=True)
class ClipStatus:
    """One clip of the project.

    Attributes:
        state: untrained, queued, preparing, training, paused (its training holds and waits), stopped (its training
            has ended before the last step and goes on there), trained, failed, stale (its reference was trained
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
    """What training several clips one after another takes, as far as it is known.

    Attributes:
        n_clips: How many are not finished.
        n_steps: Steps that are left.
        seconds: Until the last of them is finished; None where nobody can know.
        disk_mb: What they will take on disk, 10^6 bytes; None where nobody can know.
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
    """Clips that wait, those that failed, and what all of it takes.

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
    """What the program's processes use of the machine; None where the system does not say.

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
    """What a clip was before it was trained again.

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
    """What a clip depends on, and what depends on it.

    Attributes:
        needs: Clips that it starts from.
        needed_by: Clips that start from it, whether they are trained or not.
        trained_on_it: Finished clips that were trained on it as it is now.
        outdated_seconds: What training these again is expected to take; None where nobody can know.
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
        value: What it is, or is derived to be.
        is_set: Whether the user has set it; else it is derived or the default.
        help_text: What it does and what it may be.
    """

    name: str
    label: str
    value: int
    is_set: bool = False
    help_text: str = ""


@dataclass(frozen=True, slots=True)
class PlanStatus:
    """What training the next clip would do and take, while nothing trains.

    Attributes:
        summary: Steps, time, memory and disk in one line; empty until they are known.
        lines: Name and value of everything that is known.
        presets: Names to choose from.
        preset: The one that the settings begin with.
        settings: The main ones.
        can_edit: Whether they may still change: no clip is finished.
        discards: What a change throws away, as "the progress of clip 0 (step 331 of 720)"; empty for nothing.
    """

    clip_index: int
    summary: str = ""
    lines: tuple[tuple[str, str], ...] = ()
    presets: tuple[str, ...] = ()
    preset: str = ""
    settings: tuple[SettingStatus, ...] = ()
    can_edit: bool = False
    discards: str = ""


@dataclass(frozen=True, slots=True)
class RegionsStatus:
    """Where the user says what is static and what moves.

    Attributes:
        regions: As they are kept in the project; later ones overrule earlier ones.
        can_mark: Whether a region can be marked or removed now.
        why_not: The reason if it cannot, and what to do.
        effect: In which clips they take effect.
    """

    regions: tuple[GateRegion, ...] = ()
    can_mark: bool = False
    why_not: str = ""
    effect: str = ""


LEAST_TOLD = 0.05
"""Before this share of a job is done, the time left is not told: it would be a guess."""


@dataclass(frozen=True, slots=True)
class JobStatus:
    """A short job on a thread.

    Attributes:
        done: Share that is finished, 0..1; 0 when unknown.
        message: What it does at the moment.
        began_s: When it began, by `time.monotonic`; None where nobody noted it.
        can_cancel: Whether the user may give it up.
    """

    name: str
    done: float = 0.0
    message: str = ""
    began_s: float | None = None
    can_cancel: bool = False

    def elapsed_s(self, now_s: float) -> float | None:
        """Seconds since it began. now_s: By `time.monotonic`."""
        return None if self.began_s is None else max(now_s - self.began_s, 0.0)

    def eta_s(self, now_s: float) -> float | None:
        """Seconds that are left, if its share continues rising as it did; None before LEAST_TOLD."""
        spent_s = self.elapsed_s(now_s)
        if spent_s is None or not LEAST_TOLD <= self.done < 1.0:
            return None
        return spent_s * (1.0 - self.done) / self.done


@dataclass(frozen=True, slots=True)
class OpeningForecast:
    """What training all clips of a capture takes that has no project yet.

    Attributes:
        n_clips: How many there are.
        size: Width and height of the pictures.
        n_pictures: Of all cameras that are trained on, in all frames.
        reference_s: Training of the first clip, which the others inherit from; None where it is not known.
        total_s: Training of all; None likewise.
        memory_mb: Most that a training holds, 10^6 bytes.
        disk_mb: Of all finished clips, roughly, 10^6 bytes.
        free_mb: Room on the disk; None where it is not known.
    """

    n_clips: int
    size: tuple[int, int]
    n_pictures: int
    reference_s: float | None
    total_s: float | None
    memory_mb: float | None
    disk_mb: float
    free_mb: float | None


CELL_COLUMNS = ("psnr", "flip", "E")
"""Figures of single pictures: PSNR in dB, mean FLIP, and mean excess flicker against the frame before in 1/255."""
CELL_RANGES = {"psnr": (20.0, 40.0), "flip": (0.0, 0.3), "E": (0.0, 2.0)}
"""What the colours of cells span, one range for all projects. PSNR: below 20 dB a picture is plainly wrong, above 40 dB
nobody sees a difference. FLIP: trained clips lie around 0.1, and 0.3 is bad everywhere. E: trained clips lie around 0.3
levels of a display, mostly where something moves; two on average are plain flicker."""
LOW_IS_BAD = frozenset({"psnr"})
"""Columns in which higher figures are better."""
SEAM_RANGE = (0.0, 1.0)
"""What the colours of seam scores span, 1/255, one range for all projects. Where everything is inherited scores are
0.01 to 0.1; with heads of their own clips are 0.4 to 0.8 apart, and independent ones 1.4 and more."""
SEAM_FLAGGED = 0.3
"""Scores above it are pointed out."""
SEAM_RATIO_RANGE = (1.0, 3.0)
"""What the colours of seam ratios span: at 1 nothing shows; inheriting clips have 1.0 to 1.4, others 10 and more."""
SEAM_RATIO_FLAGGED = 2.0
"""Ratios above it are pointed out."""


@dataclass(frozen=True, slots=True)
class SeamStatus:
    """The boundary between two clips.

    Attributes:
        clip_index: The later clip.
        frame_index: Its first frame.
        score: Excess flicker of static pixels there, less what is normal inside the two clips, in 1/255, a mean over
            cameras: see engine.metrics.clips.seams. None where no camera was measured in both clips.
        ratio: Change of static pixels there / inside the two clips, over all cameras; 1 where nothing shows. None where
            nothing changes inside, or nothing was measured.
        n_cameras, n_all: Cameras of which the boundary and both clips are measured, and those of which they can be.
        worst_camera: The camera with the highest score; None without one.
    """

    clip_index: int
    frame_index: int
    score: float | None = None
    ratio: float | None = None
    n_cameras: int = 0
    n_all: int = 0
    worst_camera: int | None = None

    @property
    def is_provisional(self) -> bool:
        """Whether cameras are missing: with few of them a ratio is often twice what it comes to."""
        return self.n_cameras < self.n_all


@dataclass(frozen=True, slots=True, eq=False)
class ResidualStatus:
    """Measurements of every picture of the project.

    Attributes:
        seams: One per boundary between clips, in order.
        cells: By column of CELL_COLUMNS: figures by frame and camera, NaN where not measured. [F, C] float32, not to be
            changed
        is_held_out: Of each camera.
        measured: By column of CELL_COLUMNS: of how many pictures it is measured, and of how many it can be.
        n_done, n_all: Pictures of which every column is measured, and all of trained clips.
        is_measuring: Whether more are being measured now.
        is_held_back: Whether that continues slowly only, because a clip trains or the user looks around.
        rate: Pictures per second; 0 when unknown.
        eta_s: Seconds until all are measured; None while it is not known well.
        message: What went wrong, in sentences; empty when nothing did.
        revision: Grows with every change of the figures.
    """

    seams: tuple[SeamStatus, ...] = ()
    cells: Mapping[str, np.ndarray] = field(default_factory=dict)
    is_held_out: tuple[bool, ...] = ()
    measured: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    n_done: int = 0
    n_all: int = 0
    is_measuring: bool = False
    is_held_back: bool = False
    rate: float = 0.0
    eta_s: float | None = None
    message: str = ""
    revision: int = 0

    def worst(self, column: str, n_worst: int) -> list[tuple[float, int, int]]:
        """The worst figures of a column: (value, frame_index, camera_index), worst first; only what is measured.

        Raises:
            ValueError: There is no such column.
        """
        if column not in CELL_COLUMNS:
            raise ValueError(f"columns are {', '.join(CELL_COLUMNS)}, not {column!r}")
        values = self.cells.get(column)
        if values is None or n_worst <= 0:
            return []
        known = np.flatnonzero(np.isfinite(values))
        ranked = values.ravel()[known] * (1.0 if column in LOW_IS_BAD else -1.0)
        if len(known) > n_worst:
            known = known[np.argpartition(ranked, n_worst - 1)[:n_worst]]
            ranked = values.ravel()[known] * (1.0 if column in LOW_IS_BAD else -1.0)
        found = known[np.lexsort((known, ranked))]
        frames, cameras = np.divmod(found, values.shape[1])
        return [(float(values[f, c]), int(f), int(c)) for f, c in zip(frames, cameras, strict=True)]
