"""The loop around one training: commands, snapshots with backpressure, checkpoints, ends. No process, own clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.project.clips.metrics_file import read_metrics
from app.project.opening.project_access import create_project, default_settings
from app.training import messages as m
from app.training.jobs import train_job
from app.training.rate import SmoothedRate
from app.training.worker.cadence import Cadence
from app.training.worker.folder_store import FolderStore
from app.training.worker.keeper import CHECKPOINT_EVERY_S
from app.training.worker.run import TrainingRun
from engine.capture.capture import open_capture
from engine.children.kind import Unwanted
from engine.clip_files.clip_state import ClipState, read_clip_state
from engine.clip_files.compact import compact_clip
from engine.errors import NonFiniteLoss, ProjectError
from engine.progress import Progress
from tests.app.fakes import make_fake
from tests.clip_headers import make_header


class Bench:
    """A run with a clock that the test turns and commands that the test queues."""

    def __init__(self, folder, capture_folder, *, n_steps=100, change=None, starting_s=0.0) -> None:
        capture = open_capture(capture_folder)
        self.project = create_project(folder, default_settings(capture))
        self.job = train_job(self.project, self.project.clips(capture.n_frames)[0])
        self.commands, self.events, self.now_s = [], [], 0.0
        self.is_alone = False
        self.training = None
        self._n_steps, self._change, self._starting_s = n_steps, change, starting_s
        self.start()

    def start(self) -> None:
        """Begin, or go on after an end, as a new worker would."""
        self.run = TrainingRun(
            self.job,
            lambda: FolderStore(self.project.folder),
            receive=self._receive,
            send=self.events.append,
            make_training=self._make,
            can_wait=False,
            starting_s=self._starting_s,
            clock=lambda: self.now_s,
        )

    def _make(self, job, store, report):
        self.training = make_fake(job, store, report)
        self.training.n_steps = self._n_steps
        if self._change is not None:
            self._change(self)
        return self.training

    def _receive(self, wait_s):
        if self.is_alone:
            raise Unwanted
        return self.commands.pop(0) if self.commands else None

    def steps(self, n, *, each_s=1.0) -> bool:
        """Advance n times or until the end. Whether it goes on."""
        for _ in range(n):
            self.now_s += each_s
            if not self.run.advance():
                return False
        return True

    def of(self, kind):
        return [event for event in self.events if isinstance(event, kind)]

    @property
    def handed_over(self):
        return self.project.files(0).handed_over

    @property
    def checkpoint(self):
        return self.project.checkpoint_path(0)


@pytest.fixture
def bench(tmp_path, capture_folder):
    def make(**options) -> Bench:
        return Bench(tmp_path / "p", capture_folder, **options)

    return make


def test_the_next_snapshot_waits_until_the_last_one_was_read(bench):
    it = bench()
    it.steps(20)
    assert [event.revision for event in it.of(m.SnapshotWritten)] == [1]
    it.commands.append(m.SnapshotConsumed(1))
    it.steps(2)
    assert [event.revision for event in it.of(m.SnapshotWritten)] == [1, 2]
    it.commands.append(m.SnapshotConsumed(2))
    it.steps(1, each_s=0.1)
    assert sorted(path.name for path in it.project.live_dir.iterdir()) == ["clip-0000-r0002.safetensors"]
    state = read_clip_state(it.project.files(0).snapshot(2))
    assert state.header.step == it.of(m.SnapshotWritten)[1].step


def test_a_snapshot_on_demand_does_not_wait_for_its_time(bench):
    it = bench()
    it.steps(1)
    it.commands += [m.SnapshotConsumed(1), m.SnapshotNow()]
    it.steps(1, each_s=0.01)
    assert [event.revision for event in it.of(m.SnapshotWritten)] == [1, 2]


def test_what_was_learned_is_kept_about_every_half_minute(bench):
    it = bench(n_steps=1000)
    it.steps(int(CHECKPOINT_EVERY_S) - 1)
    assert not it.checkpoint.exists()
    it.steps(5)
    assert read_clip_state(it.checkpoint).header.step >= CHECKPOINT_EVERY_S - 2


def test_stopping_while_preparing_ends_at_the_next_report(bench):
    def stop_in_between(it):
        def prepare():
            it.training.report(Progress("Building", 0.2))
            it.commands.append(m.Stop(keep=True))
            it.training.report(Progress("Building", 0.4))
            raise AssertionError("not reached")

        it.training.prepare = prepare

    it = bench(change=stop_in_between)
    assert it.steps(1) is False
    assert it.events[-1] == m.TrainingStopped(False, 0)


def test_stopping_in_a_change_of_phase_keeps_the_state_before_it(bench):
    def add_phase(it):
        ordinary = it.training.step

        def step(n=1):
            if it.training.steps_done == 5:
                it.training.report(Progress("Carving", 0.0))
                it.training.value = 1e9  # half changed: must not be kept
                it.commands.append(m.Stop(keep=True))
                it.training.report(Progress("Carving", 0.5))
                raise AssertionError("not reached")
            return ordinary(n)

        it.training.step = step

    it = bench(change=add_phase)
    assert it.steps(10) is False
    kept = read_clip_state(it.checkpoint)
    assert kept.header.step == 5
    assert kept.arrays["value"][0] < 1e6
    assert it.events[-1] == m.TrainingStopped(True, 5)


def test_a_window_that_is_gone_ends_the_run_and_keeps_it(bench):
    it = bench()
    it.steps(4)
    it.is_alone = True
    assert it.steps(1) is False
    assert read_clip_state(it.checkpoint).header.step == 3


def test_stopping_without_keeping_forgets(bench):
    it = bench()
    it.steps(4)
    it.commands.append(m.Pause())
    it.steps(1)
    assert it.checkpoint.is_file()
    it.commands.append(m.Stop(keep=False))
    assert it.steps(1) is False
    assert not it.checkpoint.exists()
    assert it.events[-1] == m.TrainingStopped(False, 3)


def test_a_full_disk_costs_the_snapshot_not_the_training(bench, monkeypatch):
    it = bench(n_steps=3)

    def full(*_args):
        raise ProjectError("The clip could not be written (No space left on device).", hint="Free some space.")

    monkeypatch.setattr("app.training.worker.folder_store.write_clip_state", full)
    it.steps(1)
    assert it.of(m.WarningRaised)[0].hint == "Free some space."
    monkeypatch.undo()
    assert it.steps(5) is False
    assert isinstance(it.events[-1], m.ClipTrained)


def test_a_fault_of_the_program_is_reported_with_its_trace(bench):
    def break_it(it):
        it.training.step = lambda n: 1 // 0

    it = bench(change=break_it)
    assert it.steps(2) is False
    failed = it.events[-1]
    assert isinstance(failed, m.TrainingFailed)
    assert failed.kind == "ZeroDivisionError"
    assert "Traceback" in failed.trace
    assert "bug in the program" in failed.hint


@pytest.mark.parametrize("n_clipped", [0, 2])
def test_clipped_steps_are_counted_and_told(bench, n_clipped):
    def clip_some(it):
        ordinary = it.training.step
        it.training.step = lambda n: replace(stats := ordinary(n), n_clipped=int(stats.step <= n_clipped))

    it = bench(n_steps=5, change=clip_some)
    assert it.steps(10) is False
    figures = read_clip_state(it.handed_over).header.figures
    assert figures.gradient_clipped_steps == n_clipped
    told = [event.detail for event in it.of(m.WarningRaised)]
    assert told == (["They were scaled down in 2 of 5 steps, up to 5."] if n_clipped else [])


def _fails_at(step):
    def change(it):
        it.training.fails_at = step

    return change


def test_a_loss_that_is_no_number_keeps_the_steps_before_and_says_so(bench):
    it = bench(change=_fails_at(4))
    assert it.steps(10) is False
    failed = it.events[-1]
    assert failed.message == (
        "The loss became nan at step 5. Step 4 is kept; training again with the same command resumes from there."
    )
    assert failed.hint == "Lower the rates."
    assert read_clip_state(it.checkpoint).header.step == 4


@pytest.mark.parametrize("has_older", [False, True])
def test_what_could_not_be_kept_is_not_said_to_be(bench, monkeypatch, has_older):
    def full(*_args):
        raise ProjectError("The clip could not be written (No space left on device).", hint="Free some space.")

    it = bench(change=_fails_at(4))
    it.steps(3)
    if has_older:
        it.commands += [m.Pause()]
        it.steps(1)
        it.commands += [m.Resume()]
    monkeypatch.setattr("tests.app.fakes.write_clip_state", full)
    assert it.steps(10) is False
    end = "with the same command resumes from step 2." if has_older else "starts from the beginning."
    assert it.events[-1].message.endswith(f"Step 4 could not be kept; training again {end}")
    assert it.of(m.WarningRaised)[-1].hint == "Free some space."


def test_a_state_that_is_no_number_is_not_kept(bench):
    def spoil(it):
        it.training.fails_at, it.training.value = 0, np.nan

    it = bench(change=spoil)
    assert it.steps(3) is False
    assert "Step 0 holds numbers that are not finite; training again starts" in it.events[-1].message
    assert not it.checkpoint.exists()


HEADER = make_header()


@pytest.fixture
def store(make_opened):
    return FolderStore(make_opened().project.folder)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_clip_with_numbers_that_are_none_is_not_kept(store, bad):
    state = ClipState({"value": np.array([1.0, bad], np.float32)}, HEADER)
    with pytest.raises(NonFiniteLoss):
        store.put_clip("0000", compact_clip(state))
    assert not list(store.folder.rglob("*.safetensors"))


def test_a_clip_that_reads_back_differently_is_not_handed_over(store, monkeypatch):
    good = ClipState({"value": np.ones(2, np.float32)}, HEADER)
    other = ClipState({"value": np.zeros(2, np.float32)}, good.header)
    monkeypatch.setattr("app.training.worker.folder_store.read_clip_state", lambda _path: good)
    with pytest.raises(ProjectError, match="differs"):
        store.put_clip("0000", compact_clip(other))
    assert not list((store.folder / "live").iterdir())


def test_what_is_dear_is_done_less_often():
    cadence = Cadence(2.0, max_share=0.1)
    assert not cadence.is_due(0.0)
    assert cadence.is_due(2.0)
    cadence.done(2.0, 3.0)  # it took a second: nine more pass before the next
    assert not cadence.is_due(11.9)
    assert cadence.is_due(12.0)
    cadence.done(20.0, 20.1)
    assert not cadence.is_due(21.9)
    assert cadence.is_due(22.0)  # counted from the start of the last one


def test_so_many_steps_are_done_at_once_as_go_into_a_report(tmp_path, capture_folder):
    asked = []

    def take_time(it):
        ordinary = it.training.step

        def step(n=1):
            asked.append(n)
            it.now_s += 0.01 * n
            return ordinary(n)

        it.training.step = step

    it = Bench(tmp_path / "p", capture_folder, n_steps=60, change=take_time)
    it.run._can_wait = True
    it.steps(60, each_s=0.0)
    assert asked[:6] == [1, 2, 4, 8, 10, 10]
    reported = it.of(m.StepReported)
    assert reported[-1].step == 60
    assert len(it.of(m.ClipTrained)) == 1
    assert reported[-1].gradient_norm == 60.0


def test_the_rate_follows_and_leaves_pauses_out():
    rate = SmoothedRate(time_constant_s=5.0)
    assert rate.eta_s(10) is None
    for second in range(60):
        rate.update(done=4.0 * second, now_s=float(second))
    assert rate.per_s == pytest.approx(4.0, rel=1e-9)
    rate.pause()
    rate.update(done=4.0 * 59, now_s=1000.0)
    rate.update(done=4.0 * 60, now_s=1001.0)
    assert rate.per_s == pytest.approx(4.0, rel=1e-9)
    for second in range(1, 40):
        rate.update(done=240.0 + second, now_s=1001.0 + second)
    assert rate.per_s == pytest.approx(1.0, rel=0.01)  # exp(-39/5) of the old speed is left
    assert rate.eta_s(10) == pytest.approx(10.0, rel=0.01)


def test_starting_the_process_is_part_of_the_preparation(bench):
    it = bench(n_steps=2, starting_s=3.0)
    assert it.steps(10, each_s=0.0) is False
    figures = read_clip_state(it.handed_over).header.figures
    assert (figures.stages_s["Starting"], figures.preparation_s) == (3.0, 3.0)


def test_a_finished_clip_says_how_long_its_stages_took_and_how_large_gradients_were(bench):
    def take_time(it):
        def prepare():
            it.now_s += 2.0
            it.training.report(Progress("Carving", 0.0))
            it.now_s += 30.0
            it.training.report(Progress("Carving", 1.0))
            it.now_s += 4.0
            it.training.report(Progress("Sizing", 1.0))  # told when it is done

        ordinary = it.training.step

        def step(n=1):
            it.now_s += 0.5
            return ordinary(n)

        it.training.prepare, it.training.step = prepare, step

    it = bench(n_steps=4, change=take_time)
    it.steps(3, each_s=0.0)
    it.commands.append(m.Pause())
    it.steps(1, each_s=0.0)
    it.now_s += 10_000.0
    it.commands.append(m.Resume())
    assert it.steps(10, each_s=0.0) is False
    figures = read_clip_state(it.handed_over).header.figures
    assert figures.stages_s == pytest.approx(
        {"Starting": 2.0, "Carving": 30.0, "Sizing": 4.0, "Measuring and keeping": 0.0, "Training": 2.0}
    )
    assert figures.preparation_s == pytest.approx(36.0)
    norms = range(1, read_clip_state(it.handed_over).header.n_steps + 1)  # of the fake: its step
    assert figures.gradient_norm_median == pytest.approx(sum(norms) / len(norms))
    assert figures.gradient_norm_max == norms[-1]
    assert figures.training_s == pytest.approx(2.0)
    rows = read_metrics(it.project.unfinished_metrics_path(0))
    assert rows[-1]["training_s"] == pytest.approx(2.0)
    assert [row["training_s"] for row in rows if "held_out_psnr" in row][-1] == pytest.approx(2.0)


def test_the_most_memory_of_a_training_is_kept_across_its_runs(bench, monkeypatch):
    held = iter([700.0, 700.0])
    monkeypatch.setattr("app.training.worker.keeper.peak_mb", lambda: next(held, 650.0))
    it = bench(n_steps=6)
    it.steps(4)
    it.commands.append(m.Stop(keep=True))
    assert it.steps(1) is False
    held = iter(())
    it.start()  # another process, which holds less
    assert it.steps(20) is False
    assert read_clip_state(it.handed_over).header.figures.memory_mb == 700.0
    assert read_metrics(it.project.unfinished_metrics_path(0))[-1]["memory_mb"] == 700.0


def test_memory_that_the_system_does_not_say_is_unknown(bench, monkeypatch):
    monkeypatch.setattr("app.training.worker.keeper.peak_mb", lambda: None)
    it = bench(n_steps=3)
    assert it.steps(10) is False
    assert read_clip_state(it.handed_over).header.figures.memory_mb is None


def test_the_times_of_a_training_that_was_stopped_add_up(bench):
    it = bench(n_steps=6)
    it.steps(4)  # the first prepares, at second 1
    it.commands.append(m.Stop(keep=True))
    assert it.steps(1) is False  # at second 5
    it.now_s += 10_000.0
    it.start()
    assert it.steps(20) is False  # from second 10 006: going on, three steps, the end
    figures = read_clip_state(it.handed_over).header.figures
    assert it.now_s == 10_010.0
    assert figures.seconds == pytest.approx(4.0 + 4.0)
    assert figures.stages_s.keys() >= {"Starting", "Training", "Measuring and keeping"}
