"""Trainings on the command line: their status as progress lines, their events and outcomes as plain lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from app.cli.terminal.progress import ProgressLine, ProgressRow
from app.evaluation.headless import ClipOutcome
from app.plan.makespan import Seldom, time_left
from app.plan.planning import begin_text, compared_text, plan_clip
from app.plan.side_by_side import PlannedClips
from app.project.clips.clip_catalog import ClipCatalog
from app.project.project import Project
from app.psnr_words import psnr_words
from app.spans import spans_text
from app.status import RunningClip, TrainingStatus
from app.training.messages import StageReported, WarningRaised
from app.training.service import ClipEvent
from app.training.train_queue import needed_clips
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.errors import EngineError
from engine.text import duration_text
from engine.training.plan.forecast import median_of
from engine.training.plan.plan import StepTime, TrainingPlan

MAX_FAILURES = 10
"""Failed clips whose reasons are repeated in the end."""


def show_status(line: ProgressLine, status: TrainingStatus) -> None:
    """Show where a training is."""
    if status.state == "running":
        parts = _step_parts(status)
        if status.loss_history:
            parts.append(f"loss {status.loss_history[-1][1]:.4f}")
        if status.gradient_norm is not None:
            parts.append(f"gradient {status.gradient_norm:.2g}")
        if status.psnr_history:
            parts.append(psnr_words(status.psnr_history[-1][1], is_whole=False))
        line.update(f"Clip {status.clip_index}: training", status.progress, ", ".join(parts))
    elif status.state in ("starting", "preparing"):
        stage = status.stage.lower() if status.stage else "starting"
        line.update(f"Clip {status.clip_index}: {stage}", status.progress, "")


def _step_parts(training: TrainingStatus | RunningClip) -> list[str]:
    parts = [f"step {training.step}/{training.n_steps}"]
    if training.steps_per_s:
        parts += [f"{training.steps_per_s:.1f} steps/s", f"{duration_text(training.eta_s)} left"]
    return parts


def show_event(line: ProgressLine, event: ClipEvent, *, has_others: bool = False) -> None:
    """Print a training's reports other than its progress. has_others: Whether clips train next to it."""
    clip_index, reported = event
    name = f"Clip {clip_index}: " if has_others else ""
    match reported:
        case StageReported(message=message) if message:
            line.say(f"  {name}{message}")
        case WarningRaised(title=title, detail=detail, hint=hint):
            line.say(name + ". ".join(part for part in (title, detail, hint) if part))
        case _:
            pass


def show_outcome(line: ProgressLine, outcome: ClipOutcome, *, has_others: bool = False) -> None:
    """Say how a clip ended. has_others: Whether others may go on after a failure, which is said now, then."""
    psnr = outcome.held_out_psnr
    figure = "" if psnr is None else f", {psnr_words(psnr, is_whole=outcome.held_out_whole)}"
    if outcome.state == "skipped":
        line.say(f"Clip {outcome.clip_index} is already trained: {outcome.step:,} steps{figure}")
    elif outcome.state == "trained":
        took = duration_text(outcome.seconds)
        line.say(f"Clip {outcome.clip_index} is trained: {outcome.step:,} steps in {took}{figure}")
    elif outcome.state == "failed" and has_others:
        line.say(f"Clip {outcome.clip_index} failed: {outcome.message}")


def failure_text(outcomes: Sequence[ClipOutcome]) -> str:
    """What failed or was stopped of a training that has ended, and the clips that were not begun because of it."""
    lost = [outcome for outcome in outcomes if outcome.state in ("failed", "damaged")]
    lines = []
    for outcome in lost[:MAX_FAILURES]:
        name = f"Clip {outcome.clip_index}: " if len(lost) > 1 and outcome.state == "failed" else ""
        lines.append(name + " ".join(part for part in (outcome.message, outcome.hint) if part))
    if len(lost) > MAX_FAILURES:
        more = sorted(outcome.clip_index for outcome in lost[MAX_FAILURES:])
        lines.append(f"Not trained, either, for reasons given above or in their logs: clip {spans_text(more)}.")
    for cause in dict.fromkeys(outcome.left_out_by for outcome in outcomes if outcome.left_out_by is not None):
        left = sorted(outcome.clip_index for outcome in outcomes if outcome.left_out_by == cause)
        lines.append(f"Not begun, because clip {cause} is not finished: clip {spans_text(left)}.")
    stopped = sorted(outcome.clip_index for outcome in outcomes if outcome.state == "stopped")
    if stopped:
        lines.append(f"Stopped from elsewhere, with progress kept: clip {spans_text(stopped)}.")
    return "\n".join(lines)


class PlanLines:
    """Says the plan of each clip before it is trained, and how right its forecast was.

    Args:
        line: Where to say it.
        project, capture: Those being trained.
        catalog: Says which trainings were stopped and continue.
        step_time: Asked where no clip of the same kind says how long training takes.
        is_quiet: Plan nothing.
    """

    def __init__(
        self,
        line: ProgressLine,
        project: Project,
        capture: Capture,
        *,
        catalog: ClipCatalog,
        step_time: StepTime,
        is_quiet: bool,
    ) -> None:
        self._line, self._project, self.capture, self._is_quiet = line, project, capture, is_quiet
        self._catalog, self._step_time = catalog, step_time
        self._plans: dict[int, TrainingPlan] = {}

    def begin(self, clip: Clip) -> None:
        """A clip is about to be trained. A plan that cannot be made is left out: training says why."""
        if self._is_quiet:
            return
        try:
            plan = self._plans[clip.clip_index] = plan_clip(
                self._project,
                self.capture,
                clip,
                step_time=self._step_time,
                catalog=self._catalog,
            )
        except EngineError:
            return
        for text in begin_text(plan):
            self._line.say(text)

    def end(self, outcome: ClipOutcome) -> None:
        """Its training has ended."""
        plan = self._plans.pop(outcome.clip_index, None)
        if outcome.state == "trained" and plan is not None:
            text = compared_text(plan, self._project)
            if text:
                self._line.say(text)


class SequenceTable:
    """Shows clips that train side by side, one line each, and the sequence as a whole in the last one.

    Args:
        line: Where to show them.
        project: Of the clips.
        clips: All of the sequence, in the order of training.
        plan: What is known of them before.
    """

    def __init__(self, line: ProgressLine, project: Project, clips: Sequence[Clip], plan: PlannedClips) -> None:
        self._line, self._project, self._plan = line, project, plan
        self._left = {clip.clip_index: clip for clip in clips}
        self._n_clips, config = len(clips), project.settings.config()
        self._needs = {index: needed_clips(project, index, config) for index in self._left}
        self._took_s: list[float] = []
        self._left_s = Seldom()

    def end(self, outcome: ClipOutcome) -> None:
        """A clip has ended, in any way."""
        self._left.pop(outcome.clip_index, None)
        if outcome.state == "trained" and self._is_source(outcome.clip_index):
            self._took_s.append(outcome.seconds)

    def show(self, status: TrainingStatus) -> None:
        """Show where all of them are."""
        running = {row.clip_index: row for row in status.trainings if row.clip_index in self._left}
        has_machines = len({row.machine for row in running.values() if row.machine}) > 1
        rows = [
            ProgressRow(
                f"Clip {row.clip_index}" + (f" on {row.machine}" if has_machines and row.machine else ""),
                row.step / row.n_steps if row.n_steps else 0.0,
                _figures(row),
            )
            for row in running.values()
        ]
        n_done = self._n_clips - len(self._left)
        n_workers = status.n_workers + sum(row.is_elsewhere for row in running.values())
        eta_s = self._left_s.value((*running, n_done, n_workers), lambda: self._time_left(running, n_workers))
        share = (n_done + sum(row.done or 0.0 for row in rows)) / max(self._n_clips, 1)
        left = "" if eta_s is None else f", {duration_text(eta_s)} left"
        self._line.show([*rows, ProgressRow("All", share, f"{n_done}/{self._n_clips} clips{left}")])

    def _time_left(self, running: Mapping[int, RunningClip], n_workers: int) -> float | None:
        etas = {index: row.eta_s for index, row in running.items() if row.eta_s is not None}
        like_s = [running[index].since_s + eta_s for index, eta_s in etas.items() if self._is_source(index)]
        typical_s = median_of(self._took_s) or median_of(like_s)
        going = {index: etas.get(index, self._expected_s(index, typical_s)) for index in running}
        waiting = {index: self._expected_s(index, typical_s) for index in self._left if index not in running}
        return time_left(going, waiting, self._needs, n_workers)

    def _expected_s(self, clip_index: int, typical_s: float | None) -> float | None:
        """How long a clip takes: as other source clips, else as planned."""
        is_like = typical_s is not None and self._is_source(clip_index)
        return typical_s if is_like else self._plan.expected_s(self._project, self._left[clip_index])

    def _is_source(self, clip_index: int) -> bool:
        return self._project.inherited_index(clip_index) is not None


def _figures(row: RunningClip) -> str:
    if row.state != "running":
        return row.stage.lower() if row.state == "preparing" and row.stage else row.state
    parts = _step_parts(row)
    if row.held_out_psnr is not None:
        parts.append(psnr_words(row.held_out_psnr, is_whole=False))
    return ", ".join(parts)
