"""Exports in real processes: they end as they should, and nothing is left of those that did not."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from app.export.export_progress import ExportProgress
from app.export.jobs.cameras import CamerasJob
from app.export.jobs.gaussians import GaussiansJob
from app.export.jobs.job import ExportJob
from app.export.jobs.metrics import MetricsJob
from app.export.jobs.player import PlayerJob
from app.export.jobs.sequence import SequenceJob
from app.export.jobs.table import KINDS
from app.export.jobs.video import Turntable, VideoJob
from app.export.picked_frames import PickedFrames
from app.export.queue.export_jobs import ExportTask
from app.export.queue.export_messages import Event, ExportDone, ExportFailed, ExportGoesOn, ExportStopped
from app.export.queue.export_process import ExportProcess
from app.export.queue.export_worker import reporting
from app.project.opening.project_access import open_project
from engine.children.kind import Unwanted
from engine.children.messages import decoded, encoded
from engine.storage.files import PARTIAL_PREFIX

DEADLINE_S = 600.0
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
        processes.append(ExportProcess(task))
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


@pytest.mark.slow
def test_it_writes_and_tells_how_far_it_is(start: Start, tmp_path: Path):
    said = until(start(), is_over)
    ending = said[-1]
    assert isinstance(ending, ExportDone)
    assert ending.result.path == tmp_path / "out" / "m.csv"
    assert ending.result.n_bytes == ending.result.path.stat().st_size
    steps = [event.progress for event in said[:-1] if isinstance(event, ExportGoesOn)]
    assert steps[0].message == "Opening the project"
    assert steps[-1] == ExportProgress(2, 2, "clips")


@pytest.mark.slow
def test_a_killed_process_is_reported_and_what_it_began_disappears(start: Start, tmp_path: Path):
    process = start()
    until(process, bool)  # it is at work
    pid = process.child.pid
    begun = tmp_path / "out" / f"{PARTIAL_PREFIX}{pid}-m"
    begun.mkdir()
    (begun / "half").write_text("half")
    stranger = tmp_path / "out" / f"{PARTIAL_PREFIX}{pid}1-m.csv"
    stranger.write_text("of another process")
    process.child.kill()
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


@pytest.mark.slow
def test_what_cannot_be_written_is_told_in_words(start: Start, tmp_path: Path):
    (tmp_path / "file").write_text("x")
    ending = until(start(out=tmp_path / "file" / "m.csv"), is_over)[-1]
    assert isinstance(ending, ExportFailed)
    assert "is a file" in ending.message
    assert "Choose another place" in ending.hint


class FakeParent:
    """Hears what is reported, for as long as it is wanted."""

    def __init__(self, *, is_wanted: bool = True) -> None:
        self.heard: list[ExportProgress] = []
        self._is_wanted = is_wanted

    def receive(self, _: float) -> None:
        if not self._is_wanted:
            raise Unwanted

    def report(self, progress: ExportProgress) -> None:
        self.heard.append(progress)


def test_a_report_raises_once_nobody_wants_the_export():
    parent: Any = FakeParent(is_wanted=False)
    with pytest.raises(Unwanted):
        reporting(parent)(ExportProgress(0, 3))


def test_no_more_is_reported_than_anybody_reads():
    parent: Any = FakeParent()
    report = reporting(parent)
    for n_done in range(1001):
        report(ExportProgress(n_done, 1000))
    assert 2 <= len(parent.heard) < 50


EVERY_KIND = [
    GaussiansJob(Path("/out"), frames=PickedFrames((range(0, 4, 2), range(10, 20, 2)), 2), scale=2.0, up="-y"),
    VideoJob(
        Path("/a.mp4"), "mp4", turntable=Turntable(), hold=3.0, frames=PickedFrames.of(range(2, 5)), size=(64, 48)
    ),
    VideoJob(Path("/a"), "png", camera="cam", background=(1, 2, 3)),
    PlayerJob(Path("/a.html"), has_folder=False),
    MetricsJob(Path("/m.json"), "json", PickedFrames.of(range(20))),
    CamerasJob(Path("/cameras")),
    SequenceJob(Path("/s.4dgs"), "4dgs", PickedFrames.of(range(3)), up="+y", sound="cam"),
]


@pytest.mark.parametrize("job", EVERY_KIND, ids=lambda job: job.kind)
def test_every_kind_of_export_crosses_to_its_process(job: ExportJob):
    task = ExportTask(job, "/p", "/c", 0.5, (0, 7), True, n_threads=2, backend="cpu")
    assert decoded(encoded(task), ExportTask) == task
    assert {type(one) for one in EVERY_KIND} == {*KINDS.values()}
