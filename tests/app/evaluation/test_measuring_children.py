"""Measuring in several processes: the figures of one, whichever process measures what; a process that dies is said."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from app.cli.cli import main
from app.evaluation.evaluation import ClipMeasuring, evaluate_project
from app.evaluation.headless import open_trained
from app.evaluation.kept_figures import EVALUATIONS
from app.evaluation.measuring_children import (
    EVALUATING,
    ClipMeasured,
    EvaluationTask,
    FigureMeasured,
    MeasureClip,
    MeasuringChildren,
)
from app.evaluation.measuring_children import main as measure
from app.project.opening.project_access import open_project
from engine.children.kind import ChildFailed
from engine.children.messages import decoded, encoded
from engine.children.process import ChildProcess
from engine.errors import CaptureError, EngineError
from engine.metrics.clips.summary import EvalRow
from tests.app.evaluation.test_kept_figures import make_project


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_project(tmp_path_factory.mktemp("children"), n_cameras=5)


@pytest.fixture(autouse=True)
def _nothing_kept(project: Path) -> Iterator[None]:
    yield
    for path in (project / EVALUATIONS).glob("*"):
        path.unlink()


def test_a_capture_that_was_followed_is_read_as_one_that_grows(tmp_path: Path, monkeypatch) -> None:
    """As a whole it may lack frames of some cameras."""
    seen: list[dict[str, Any]] = []

    def opened(path: str, **known: Any) -> None:
        seen.append(known)
        raise CaptureError("enough seen")

    for name in ("start_logging", "use_kernel_cache", "choose_backend", "warm_cache"):
        monkeypatch.setattr(f"app.evaluation.measuring_children.{name}", lambda *_: None)
    settings = SimpleNamespace(settings=SimpleNamespace(is_growing=True))
    monkeypatch.setattr("app.evaluation.measuring_children.open_project", lambda *_, **__: settings)
    monkeypatch.setattr("engine.capture.capture.open_capture", opened)
    task = EvaluationTask(str(tmp_path), "c", 0.5, (0, 9), False, (0,), (0,), "quick", "float", backend="cpu")
    with pytest.raises(CaptureError):
        measure(task, cast(Any, None))
    assert seen == [{"scale": 0.5, "frames": (0, 9), "follow_links": False, "is_growing": True}]


class InlineChild:
    """A child without a process: what crosses is packed and read as messages are.

    Args:
        n_left: Answers that it gives before it dies.
    """

    def __init__(self, kind: Any, task: Any, n_left: int = 10_000) -> None:
        self._kind, self._n_left = kind, n_left
        self.task = decoded(encoded(task), kind.job)
        self.asked: list[MeasureClip] = []
        self._events: list[Any] = []
        self._opened = open_trained(open_project(Path(task.project), is_writable=False)).measured
        self._measuring = ClipMeasuring(1)
        self.is_ended = False

    @property
    def is_over(self) -> bool:
        return not self._n_left

    def send(self, command: MeasureClip) -> None:
        wanted = decoded(encoded(command), self._kind.command)
        self.asked.append(wanted)
        for item in self._measuring(self._opened, self.task.scope, wanted.clip_index, wanted.unknown):
            self._say(FigureMeasured(row=item) if isinstance(item, EvalRow) else FigureMeasured(pair=item))
        self._say(ClipMeasured(wanted.clip_index))

    def _say(self, event: Any) -> None:
        if self._n_left:
            self._n_left -= 1
            self._events.append(decoded(encoded(event), self._kind.event))

    def poll(self) -> list[Any]:
        events, self._events = self._events[:7], self._events[7:]
        return events if not self.is_over else [*events, *self._events]

    def wait(self, timeout_s: float) -> None:
        pass

    def result(self) -> None:
        raise ChildFailed("A process that measures was ended by signal 9", is_final=False)

    def end(self, grace_s: float = 0.0) -> None:
        self.is_ended = True


def measured(project: Path, measuring: Any = None, clips: tuple[int, ...] = (0, 1)) -> dict[str, Any]:
    opened = open_trained(open_project(project, is_writable=False))
    return evaluate_project(
        opened, clip_indices=clips, metrics="quick", on_progress=lambda *_: None, measuring=measuring
    )


@pytest.mark.parametrize("n_workers", [2, 7])
def test_figures_and_seams_are_those_of_one_process(project: Path, n_workers: int) -> None:
    alone = measured(project)
    _forget(project)
    children: list[InlineChild] = []

    def start(kind: Any, task: Any) -> Any:
        children.append(InlineChild(kind, task))
        return children[-1]

    with MeasuringChildren(n_workers, start=start) as measuring:
        assert measured(project, measuring) == alone
    assert len(children) == min(n_workers, 5), "a process without a camera is not started"
    cameras = [{camera for asked in child.asked for camera in asked.unknown} for child in children]
    assert sum(map(len, cameras)) == len(set().union(*cameras)) == 5, "a camera belongs to one process"
    assert all(child.is_ended for child in children)
    with MeasuringChildren(2, start=start) as measuring:
        assert measured(project, measuring) == alone
    assert len(children) == min(n_workers, 5), "nothing was missing, so nothing was started"


def test_a_process_that_dies_ends_all_and_what_it_measured_is_kept(project: Path) -> None:
    children: list[InlineChild] = []

    def start(kind: Any, task: Any) -> Any:
        children.append(InlineChild(kind, task, n_left=4 if not children else 10_000))
        return children[-1]

    with (
        pytest.raises(EngineError, match=r"ended by signal 9\. Figures measured so far are kept"),
        MeasuringChildren(2, start=start) as measuring,
    ):
        measured(project, measuring, (0,))
    assert all(child.is_ended for child in children)
    rest = MeasuringChildren(2, start=lambda kind, task: InlineChild(kind, task))  # pyright: ignore
    counts = []
    opened = open_trained(open_project(project, is_writable=False))
    evaluate_project(
        opened,
        clip_indices=(0,),
        metrics="quick",
        on_progress=lambda n_done, n_all, row: counts.append((n_done, row)),
        measuring=rest,
    )
    assert counts[0][0] >= 2, "these were known"
    assert counts[0][1] is None


@pytest.mark.slow
def test_real_processes_and_one_that_is_killed(project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    alone = measured(project)
    _forget(project)
    monkeypatch.setattr("app.evaluation.measuring_children.n_cores", lambda: 2)
    out = tmp_path / "out.json"
    options = ["eval", str(project), "--metrics", "quick", "--json", str(out), "--quiet", "--workers"]
    assert main([*options, "2"]) == 0
    _forget(project)

    def start(kind: Any, task: Any) -> Any:
        child = ChildProcess(kind, task)
        assert child.pid is not None
        os.kill(child.pid, signal.SIGKILL)
        return child

    with pytest.raises(EngineError, match="signal 9"), MeasuringChildren(2, start=start) as measuring:
        measured(project, measuring)
    with MeasuringChildren(2, n_threads=1) as measuring:
        assert measured(project, measuring) == alone
    assert EVALUATING.grace_s == 0, "a process that is no longer wanted ends at once"


@pytest.mark.parametrize("text", ["0", "-1", "two", ""])
def test_a_number_of_processes_that_is_none_is_bad_input(project: Path, text: str, capsys) -> None:
    assert main(["eval", str(project), "--json", "-", f"--workers={text}"]) == 2
    assert "is not a number of processes, 1 or more" in capsys.readouterr().err


def _forget(project: Path) -> None:
    for path in (project / EVALUATIONS).glob("*"):
        path.unlink()
