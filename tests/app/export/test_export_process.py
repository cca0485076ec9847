"""Exports in real processes: they end as they should, and nothing is left of those that did not."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from app.export.export_jobs import ExportTask
from app.export.export_messages import Event, ExportDone, ExportFailed, ExportGoesOn, ExportStopped
from app.export.export_process import ExportProcess
from app.export.export_progress import ExportProgress
from app.export.export_worker import Wanted
from app.export.metrics_job import MetricsJob
from app.project.opening.project_access import open_project
from engine.storage.files import PARTIAL_PREFIX

DEADLINE_S = 120.0
Start = Callable[..., ExportProcess]


@pytest.fixture
def start(project: Path, tmp_path: Path) -> Iterator[Start]:
    """Starts a process that writes out/m.csv; any that is left is ended."""
    processes: list[ExportProcess] = []
    (tmp_path / "out").mkdir()

    def begin(**entries: Any) -> ExportProcess:
        settings = open_project(project, is_writable=False).settings
        out = entries.pop("out", tmp_path / "out" / "m.csv")
        task = ExportTask(MetricsJob(out), str(project), settings.capture, 1.0, None, False, 1)
        processes.append(ExportProcess(task, **entries))
        return processes[-1]

    yield begin
    for process in processes:
        process.end()


def until(process: ExportProcess, is_enough: Callable[[list[Event]], bool]) -> list[Event]:
    """Everything it says until that is enough."""
    said: list[Event] = []
    until_s = time.monotonic() + DEADLINE_S
    while not is_enough(said):
        assert time.monotonic() < until_s, said
        said += process.poll()
        time.sleep(0.01)
    return said


def is_over(said: list[Event]) -> bool:
    return bool(said) and not isinstance(said[-1], ExportGoesOn)


def test_it_writes_and_tells_how_far_it_is(start: Start, tmp_path: Path):
    said = until(start(), is_over)
    ending = said[-1]
    assert isinstance(ending, ExportDone)
    assert ending.result.path == tmp_path / "out" / "m.csv"
    assert ending.result.n_bytes == ending.result.path.stat().st_size
    steps = [event.progress for event in said[:-1] if isinstance(event, ExportGoesOn)]
    assert steps[0].message == "Opening the project"
    assert steps[-1] == ExportProgress(2, 2, "clips")


def test_a_killed_process_is_reported_and_what_it_began_disappears(start: Start, tmp_path: Path):
    process = start()
    until(process, bool)  # it is at work
    pid = process.process.pid
    assert pid is not None
    begun = tmp_path / "out" / f"{PARTIAL_PREFIX}{pid}-m"
    begun.mkdir()
    (begun / "half").write_text("half")
    stranger = tmp_path / "out" / f"{PARTIAL_PREFIX}{pid}1-m.csv"
    stranger.write_text("of another process")
    os.kill(pid, signal.SIGKILL)
    ending = until(process, is_over)[-1]
    if isinstance(ending, ExportDone):  # it was faster
        pytest.skip("it was done before it was killed")
    assert isinstance(ending, ExportFailed)
    assert "signal 9" in ending.message
    assert "memory" in ending.message
    assert not begun.exists()
    assert stranger.exists()


def test_a_cancelled_process_ends_and_leaves_nothing(start: Start, tmp_path: Path):
    process = start()
    process.cancel()
    assert isinstance(until(process, is_over)[-1], ExportStopped)
    assert list((tmp_path / "out").iterdir()) == []


def test_nothing_waits_for_a_process_that_does_not_start(start: Start, monkeypatch: pytest.MonkeyPatch):
    may_go_on = threading.Event()

    def refuse(process: object) -> None:
        assert may_go_on.wait(DEADLINE_S)
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("multiprocessing.context.SpawnProcess.start", refuse)
    process = start()
    assert process.poll() == []
    process.cancel()
    process.end(timeout_s=0.0)
    assert process.poll() == []
    may_go_on.set()
    ending = until(process, is_over)[-1]
    assert isinstance(ending, ExportFailed)
    assert "Resource temporarily unavailable" in ending.message


def test_ending_it_leaves_nothing(start: Start, tmp_path: Path):
    process = start()
    process.end()
    process.end()
    assert isinstance(until(process, is_over)[-1], ExportStopped)
    assert list((tmp_path / "out").iterdir()) == []


def test_what_cannot_be_written_is_told_in_words(start: Start, tmp_path: Path):
    (tmp_path / "file").write_text("x")
    ending = until(start(out=tmp_path / "file" / "m.csv"), is_over)[-1]
    assert isinstance(ending, ExportFailed)
    assert "is a file" in ending.message
    assert "Choose another place" in ending.hint


class FakePipe:
    """A pipe to nobody, or one through which a cancel came."""

    def __init__(self, *, has_command: bool = False, is_broken: bool = False) -> None:
        self.sent: list[bytes] = []
        self._has_command, self._is_broken = has_command, is_broken

    def poll(self, _: float) -> bool:
        return self._has_command

    def recv_bytes(self) -> bytes:
        return b"cancel"

    def send_bytes(self, data: bytes) -> None:
        if self._is_broken:
            raise BrokenPipeError
        self.sent.append(data)


@pytest.mark.parametrize(
    ("commands", "events"), [(FakePipe(has_command=True), FakePipe()), (FakePipe(), FakePipe(is_broken=True))]
)
def test_a_report_raises_once_nobody_wants_the_export(commands: Any, events: Any):
    from app.export.export_progress import ExportCancelled

    with pytest.raises(ExportCancelled):
        Wanted(commands, events).report(ExportProgress(0, 3))


def test_reports_are_not_told_more_often_than_anybody_reads():
    events: Any = FakePipe()
    wanted = Wanted(FakePipe(), events)  # type: ignore[arg-type]
    for n_done in range(1001):
        wanted.report(ExportProgress(n_done, 1000))
    assert 2 <= len(events.sent) < 50
