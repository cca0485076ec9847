"""The queue of exports, with made-up processes and a clock of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.export.export_progress import ExportProgress, ExportResult
from app.export.metrics_job import MetricsJob
from app.export.queue.export_jobs import ExportTask
from app.export.queue.export_messages import Event, ExportDone, ExportFailed, ExportGoesOn, ExportStopped
from app.export.queue.export_queue import MAX_ENDED, ExportQueue


class FakeExporter:
    """Says what a test lets it say."""

    def __init__(self, task: ExportTask) -> None:
        self.task = task
        self.events: list[Event] = []
        self.is_cancelled = self.is_ended = False

    def poll(self) -> list[Event]:
        events, self.events = self.events, []
        return events

    def cancel(self) -> None:
        self.is_cancelled = True

    def end(self) -> None:
        self.is_ended = True


class Bench:
    """A queue whose exporters are made up."""

    def __init__(self) -> None:
        self.started: list[FakeExporter] = []
        self.now_s = 0.0
        self.queue = ExportQueue(launch=self._launch, clock=lambda: self.now_s)

    def _launch(self, task: ExportTask) -> FakeExporter:
        self.started.append(FakeExporter(task))
        return self.started[-1]

    def add(self, name: str) -> int:
        task = ExportTask(MetricsJob(Path("/out") / name), "/p", "/c", 1.0, None, False)
        return self.queue.add(task, name)

    def say(self, *events: Event) -> list[str]:
        """The running export says something; titles of those that ended by it."""
        self.started[-1].events += events
        return [status.title for status in self.queue.poll()]

    @property
    def listed(self) -> list[tuple[str, str]]:
        return [(status.title, status.state) for status in self.queue.statuses]


DONE = ExportDone(ExportResult(Path("/out/a"), 1, 10, 41.5))


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_one_at_a_time_in_the_order_of_the_list(bench: Bench):
    a, _, c = bench.add("a"), bench.add("b"), bench.add("c")
    assert bench.listed == [("a", "waiting"), ("b", "waiting"), ("c", "waiting")]
    bench.queue.poll(n_threads=1)
    bench.queue.poll()
    assert [exporter.task.job.out.name for exporter in bench.started] == ["a"]
    assert bench.started[0].task.n_threads == 1
    bench.queue.move(c, 0)
    bench.queue.move(a, 5)  # it runs; nothing to move
    assert bench.listed == [("a", "running"), ("c", "waiting"), ("b", "waiting")]
    assert bench.say(DONE) == ["a"]
    assert bench.listed == [("c", "running"), ("b", "waiting"), ("a", "done")]
    assert bench.started[1].task.n_threads is None
    assert bench.queue.is_busy
    bench.say(DONE)
    bench.say(DONE)
    assert bench.listed == [("b", "done"), ("c", "done"), ("a", "done")]
    assert not bench.queue.is_busy


def test_progress_rate_and_time_left(bench: Bench):
    bench.add("a")
    bench.queue.poll()
    assert bench.queue.statuses[0].done == 0.0
    for n_done in range(5):
        bench.say(ExportGoesOn(ExportProgress(n_done, 10)))
        bench.now_s += 2.0
    status = bench.queue.statuses[0]
    assert status.progress == ExportProgress(4, 10)
    assert status.done == 0.4
    assert status.per_s == pytest.approx(0.5)
    assert status.eta_s == pytest.approx(12.0)
    assert bench.say(DONE) == ["a"]
    status = bench.queue.statuses[0]
    assert (status.seconds, status.eta_s, status.done) == (10.0, None, 1.0)
    assert status.result is not None
    assert status.result.psnr_db == 41.5


def test_cancelled_and_failed_ones_can_be_tried_again(bench: Bench):
    a, b = bench.add("a"), bench.add("b")
    bench.queue.poll()
    bench.queue.retry(a)  # it runs
    bench.queue.cancel(a)
    assert bench.started[0].is_cancelled
    assert bench.listed == [("a", "stopping"), ("b", "waiting")]
    bench.queue.remove(a)  # it still runs
    bench.say(ExportStopped())
    assert bench.listed == [("b", "running"), ("a", "cancelled")]
    bench.say(ExportFailed("The disk is full.", "Free some space."))
    failed = bench.queue.statuses[0]
    assert (failed.title, failed.state, failed.message, failed.hint) == (
        "b",
        "failed",
        "The disk is full.",
        "Free some space.",
    )
    bench.queue.retry(b)
    bench.queue.retry(a)
    bench.queue.poll()
    assert bench.listed == [("b", "running"), ("a", "waiting")]
    assert bench.queue.statuses[0].message == ""
    assert bench.started[-1].task.job.out.name == "b"


def test_one_that_waits_never_begins_once_it_is_cancelled(bench: Bench):
    a = bench.add("a")
    bench.queue.cancel(a)
    bench.queue.poll()
    assert bench.started == []
    assert bench.listed == [("a", "cancelled")]
    bench.queue.cancel(a)
    bench.queue.cancel(99)
    bench.queue.remove(a)
    assert bench.listed == []


def test_what_ended_long_ago_is_forgotten(bench: Bench):
    for number in range(MAX_ENDED + 3):
        bench.add(str(number))
    bench.queue.poll()
    for _ in range(MAX_ENDED + 3):
        bench.say(DONE)
    assert [title for title, _ in bench.listed] == [str(number) for number in reversed(range(3, MAX_ENDED + 3))]


def test_closing_ends_what_runs_and_begins_nothing(bench: Bench):
    bench.add("a")
    bench.add("b")
    bench.queue.poll()
    bench.queue.close()
    bench.queue.poll()
    assert bench.started[0].is_ended
    assert len(bench.started) == 1
