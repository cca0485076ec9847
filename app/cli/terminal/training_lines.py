"""A training on the command line: its status as a progress line, its events and outcomes as plain lines."""

from __future__ import annotations

from app.cli.terminal.progress import ProgressLine
from app.evaluation.headless import ClipOutcome
from app.plan.planning import begin_text, compared_text, plan_clip
from app.project.clips.clip_catalog import ClipCatalog
from app.project.project import Project
from app.psnr_words import psnr_words
from app.status import TrainingStatus
from app.training.messages import Event, StageReported, WarningRaised
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.errors import EngineError
from engine.text import duration_text
from engine.training.plan.plan import StepTime, TrainingPlan


def show_status(line: ProgressLine, status: TrainingStatus) -> None:
    """Show where a training is."""
    if status.state == "running":
        parts = [f"step {status.step}/{status.n_steps}"]
        if status.steps_per_s:
            parts += [f"{status.steps_per_s:.1f} steps/s", f"{duration_text(status.eta_s)} left"]
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


def show_event(line: ProgressLine, event: Event) -> None:
    """Print a training's reports other than its progress."""
    match event:
        case StageReported(message=message) if message:
            line.say(f"  {message}")
        case WarningRaised(title=title, detail=detail, hint=hint):
            line.say(". ".join(part for part in (title, detail, hint) if part))
        case _:
            pass


def show_outcome(line: ProgressLine, outcome: ClipOutcome) -> None:
    """Say how a clip ended."""
    psnr = outcome.held_out_psnr
    figure = "" if psnr is None else f", {psnr_words(psnr, is_whole=outcome.held_out_whole)}"
    if outcome.state == "skipped":
        line.say(f"Clip {outcome.clip_index} is already trained: {outcome.step:,} steps{figure}")
    elif outcome.state == "trained":
        took = duration_text(outcome.seconds)
        line.say(f"Clip {outcome.clip_index} is trained: {outcome.step:,} steps in {took}{figure}")


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
        self._plan: TrainingPlan | None = None

    def begin(self, clip: Clip) -> None:
        """A clip is about to be trained. A plan that cannot be made is left out: training says why."""
        self._plan = None
        if self._is_quiet:
            return
        try:
            self._plan = plan_clip(
                self._project,
                self.capture,
                clip,
                step_time=self._step_time,
                catalog=self._catalog,
            )
        except EngineError:
            return
        for text in begin_text(self._plan):
            self._line.say(text)

    def end(self, outcome: ClipOutcome) -> None:
        """Its training has ended."""
        if outcome.state == "trained" and self._plan is not None:
            text = compared_text(self._plan, self._project)
            if text:
                self._line.say(text)
