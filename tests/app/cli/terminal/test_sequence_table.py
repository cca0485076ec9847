"""Clips that train side by side, as a terminal shows them."""

from __future__ import annotations

import io

from app.cli.terminal.progress import ProgressLine
from app.cli.terminal.training_lines import MAX_FAILURES, SequenceTable, failure_text
from app.evaluation.headless import ClipOutcome
from app.plan.side_by_side import PlannedClips, SideBySide
from app.status import RunningClip, TrainingStatus
from tests.app.training.test_train_queue import six

__all__ = ["six"]


def shown(table: SequenceTable, stream: io.StringIO, *rows: RunningClip) -> list[str]:
    stream.seek(0)
    stream.truncate()
    table.show(TrainingStatus(trainings=rows, n_workers=2))
    return stream.getvalue().splitlines()


def running(clip_index: int, step: int, eta_s: float | None, **known) -> RunningClip:
    return RunningClip(clip_index, "running", step=step, n_steps=100, steps_per_s=2.0, eta_s=eta_s, **known)


def test_it_shows_each_clip_and_when_all_are_finished(six) -> None:
    stream, seconds = io.StringIO(), iter(range(0, 10**6, 60))
    line = ProgressLine(stream, clock=lambda: float(next(seconds)))
    table = SequenceTable(line, six.project, six.clips, PlannedClips(SideBySide(2), {}))
    preparing = RunningClip(0, "preparing", stage="Finding what moves")
    assert shown(table, stream, preparing) == ["Clip 0   0 %  finding what moves", "All      0 %  0/6 clips"]
    table.end(ClipOutcome(0, "trained", 100, seconds=500.0))
    rows = running(1, 40, 30.0, since_s=20.0, held_out_psnr=31.25), running(2, 10, 40.0, since_s=20.0)
    assert shown(table, stream, *rows) == [
        "Clip 1  40 %  step 40/100, 2.0 steps/s, 0:30 left, held-out PSNR ~31.25 dB, few pictures",
        "Clip 2  10 %  step 10/100, 2.0 steps/s, 0:40 left",
        "All     25 %  1/6 clips, 2:20 left",  # 55 s each: 3 from 30 s on, 4 from 40, 5 from 85, to 140 s
    ]
    table.end(ClipOutcome(1, "trained", 100, seconds=100.0))
    table.end(ClipOutcome(2, "failed"))
    rows = running(3, 50, 20.0, machine="tall"), running(4, 50, 40.0, machine="wide", is_elsewhere=True)
    assert shown(table, stream, *rows)[-1].endswith("3/6 clips, 1:40 left"), "a worker here is free for clip 5"
    assert [row.partition("  ")[0] for row in shown(table, stream, *rows)[:2]] == ["Clip 3 on tall", "Clip 4 on wide"]


def test_what_failed_is_named_however_much_it_is() -> None:
    failed = [ClipOutcome(index, "failed", message="The loss became nan.") for index in range(1, MAX_FAILURES + 3)]
    left = [ClipOutcome(index, "left_out", left_out_by=1) for index in (30, 31, 40)]
    lines = failure_text([ClipOutcome(0, "trained"), *failed, *left]).splitlines()
    assert lines[0] == "Clip 1: The loss became nan."
    assert len(lines) == MAX_FAILURES + 2
    assert lines[-2:] == [
        "Not trained, either, for reasons given above or in their logs: clip 11, 12.",
        "Not begun, because clip 1 is not finished: clip 30, 31, 40.",
    ]
    assert failure_text([ClipOutcome(3, "failed", message="No.", hint="Yes.")]) == "No. Yes."
