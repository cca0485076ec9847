"""Measuring in several processes at once, here or elsewhere: each takes cameras of its own, for all clips.

So a video is decoded, and a background found, in one process only, and no clip is too few. Figures come back as
messages to the process that keeps them, which is the only one to write. Each camera is measured with one thread, so
they are the same for any number of processes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from msgspec import Struct, field

from app.background.kernels import warm_cache
from app.background.logs import start_logging
from app.evaluation.evaluation import ClipMeasuring, EvaluationScope, Frames, Measuring
from app.evaluation.headless import TrainedProject, open_trained
from app.project.opening.project_access import open_project
from engine.backends.table import choose_backend, chosen_name
from engine.children.kind import ChildFailed, ChildKind
from engine.children.process import MAX_EVENTS_PER_POLL, Child, ChildProcess
from engine.errors import EngineError
from engine.kernels.cache import use_kernel_cache
from engine.metrics.clips.seams import PairRow
from engine.metrics.clips.summary import EvalRow
from engine.parallel import n_cores

if TYPE_CHECKING:
    from engine.children.child import Parent

POLL_S = 0.1


class EvaluationTask(Struct, frozen=True):
    """What a process measures; clip by clip, it is sent the figures that are missing.

    Attributes:
        project: Folder.
        capture, scale, frames, follow_links: The way its capture is opened; the project may still name another place.
        clips, cameras, metrics, precision: See EvaluationScope.
        n_threads: Cameras at a time; as many as cores when None.
        backend: Name of the back end.
    """

    project: str
    capture: str
    scale: float
    frames: tuple[int, int] | None
    follow_links: bool
    clips: tuple[int, ...]
    cameras: tuple[int, ...]
    metrics: Literal["quick", "all"]
    precision: Literal["float", "8bit"]
    n_threads: int | None = None
    backend: str = field(default_factory=chosen_name)

    @property
    def scope(self) -> EvaluationScope:
        """The scope of the evaluation that this is a part of."""
        return EvaluationScope(self.clips, self.cameras, self.metrics, self.precision)


class MeasureClip(Struct, frozen=True, tag=True):
    """Measure these figures of a clip."""

    clip_index: int
    unknown: Frames


class FigureMeasured(Struct, frozen=True, tag=True):
    """A picture, or two neighbouring frames."""

    row: EvalRow | None = None
    pair: PairRow | None = None


class ClipMeasured(Struct, frozen=True, tag=True):
    """Every figure asked for was sent."""

    clip_index: int


FigureEvent = FigureMeasured | ClipMeasured
EVALUATING: ChildKind[EvaluationTask, FigureEvent, None] = ChildKind(
    place="app.evaluation.measuring_children:EVALUATING",
    work="app.evaluation.measuring_children:main",
    what="A process that measures",
    job=EvaluationTask,
    event=FigureEvent,
    command=MeasureClip,
)
StartEvaluating = Callable[
    [ChildKind[EvaluationTask, FigureEvent, None], EvaluationTask], Child[EvaluationTask, FigureEvent, None]
]


class MeasuringLost(EngineError):
    """A process is gone, which may not happen again."""


def main(task: EvaluationTask, parent: Parent[FigureEvent]) -> None:
    """Runs in the child for as long as it is wanted."""
    from engine.capture.capture import open_capture

    start_logging()
    use_kernel_cache()  # before kernels are imported
    choose_backend(task.backend)
    warm_cache()  # or several processes would compile the same
    project = open_project(Path(task.project), is_writable=False)
    capture = open_capture(
        task.capture,
        scale=task.scale,
        frames=task.frames,
        follow_links=task.follow_links,
        is_growing=project.settings.is_growing,
    )
    opened, measuring = open_trained(project, capture).measured, ClipMeasuring(task.n_threads)
    while True:
        wanted = parent.receive(POLL_S)
        if not isinstance(wanted, MeasureClip):
            continue
        for item in measuring(opened, task.scope, wanted.clip_index, wanted.unknown):
            parent.report(FigureMeasured(row=item) if isinstance(item, EvalRow) else FigureMeasured(pair=item))
        parent.report(ClipMeasured(wanted.clip_index))


class MeasuringChildren:
    """A `Measuring` of several processes, which end with the block that it is entered for.

    Args:
        n_workers: How many.
        n_threads: Of each; see EvaluationTask.
        start: Starts one, as ChildProcess does.
    """

    def __init__(self, n_workers: int, *, n_threads: int | None = None, start: StartEvaluating = ChildProcess) -> None:
        self._n_workers, self._n_threads, self._start = n_workers, n_threads, start
        self._children: list[Child[EvaluationTask, FigureEvent, None]] = []
        self._task: EvaluationTask | None = None

    def __enter__(self) -> MeasuringChildren:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def __call__(
        self, opened: TrainedProject, scope: EvaluationScope, clip_index: int, unknown: Frames
    ) -> Iterator[EvalRow | PairRow]:
        """Missing rows and pairs, cameras mixed.

        Raises:
            MeasuringLost: A process is gone.
            EngineError: A process failed.
        """
        self._begin(opened, scope)
        busy = []
        for number, child in enumerate(self._children):
            share = {
                camera: unknown[camera] for camera in scope.cameras[number :: self._n_workers] if camera in unknown
            }
            if share:
                child.send(MeasureClip(clip_index, share))
                busy.append(child)
        while busy:
            for child in list(busy):
                is_over = child.is_over
                events = child.poll()
                for event in events:
                    if isinstance(event, ClipMeasured):
                        busy.remove(child)
                        continue
                    found = event.pair if event.row is None else event.row
                    assert found is not None
                    yield found
                if is_over and child in busy and len(events) < MAX_EVENTS_PER_POLL:
                    raise _failure(child)
            if busy:
                busy[0].wait(POLL_S)

    def _begin(self, opened: TrainedProject, scope: EvaluationScope) -> None:
        """Have processes for this project and scope."""
        capture = opened.capture
        task = EvaluationTask(
            project=str(opened.project.folder.absolute()),
            capture=str(capture.path.absolute()),
            scale=capture.scale,
            frames=capture.frames,
            follow_links=capture.follow_links,
            clips=tuple(scope.clips),
            cameras=tuple(scope.cameras),
            metrics=scope.metrics,
            precision=scope.precision,
            n_threads=self._n_threads,
        )
        if task != self._task:
            self.end()
            self._task = task
            self._children = [self._start(EVALUATING, task) for _ in range(min(self._n_workers, len(scope.cameras)))]

    def end(self) -> None:
        """End all processes; the next call starts them anew."""
        for child in self._children:
            child.end()
        self._children, self._task = [], None


@contextmanager
def measuring_here(n_workers: int) -> Iterator[Measuring | None]:
    """What measures with so many processes on this machine, one per core at most; None where one process will do."""
    n_workers = min(n_workers, n_cores())
    if n_workers < 2:
        yield None
        return
    with MeasuringChildren(n_workers, n_threads=n_cores() // n_workers) as measuring:
        yield measuring


def _failure(child: Child[EvaluationTask, FigureEvent, None]) -> EngineError:
    reason, kind = f"{EVALUATING.what} ended early", EngineError
    try:
        child.result()
    except EngineError as error:
        return error
    except ChildFailed as error:
        reason, kind = str(error), EngineError if error.is_final else MeasuringLost
    return kind(f"{reason}.", hint="Figures measured so far are kept; the same command resumes from there.")
