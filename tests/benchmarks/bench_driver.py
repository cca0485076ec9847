"""The driver of many workers, simulated: what it costs to look after 10,000 clips on 500 workers that only pretend.

    python -m tests.benchmarks.bench_driver [--clips 10000] [--workers 500] [--clip-s 180] [--profile]

Everything of the driver is real: the catalog, the queue, the service, `train_clips`, the lines on the terminal, and
putting finished clips in their place. Workers and time are not: a clip takes about --clip-s seconds of a made-up
clock, in which its worker reports every --report-s seconds and then leaves a tiny clip file. What counts is the
processor time of the whole process less that of the pretended work; files lie in memory where there is /dev/shm.
Memory is what the process holds (RSS), after each tenth of the clips.

Then the project is opened as the window does, and what the window makes of it is timed: states of all clips for the
timeline, and forecasts, after a clip has ended and when nothing has changed.
"""

from __future__ import annotations

import argparse
import cProfile
import os
import platform
import pstats
import random
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from app.cli.terminal.progress import ProgressLine
from app.cli.terminal.training_lines import show_event, show_outcome, show_status
from app.evaluation.headless import ClipOutcome, train_clips
from app.project.claims.claim_files import ClaimFile, holder_path, make_claim
from app.project.claims.claims import Claims
from app.project.claims.holder_record import ClipProgress, HolderRecord, write_holder
from app.project.clips.clip_catalog import ClipCatalog
from app.project.lock import this_process
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.training.due import due_clips
from app.training.messages import (
    ClipTrained,
    Command,
    Event,
    HeldOutMeasured,
    StageReported,
    StepReported,
    TrainJob,
    WorkerReady,
)
from app.training.service import TrainingService
from app.training.training_status import ClipStatuses, training_status
from engine.capture.clip import split_clips
from engine.clip_files.clip_state import ClipState, write_clip_state
from tests.app.fakes import anchor_arrays
from tests.app.made_projects import clip_header, make_project

TARGET_MS = 5.0
N_STEPS = 10_000
N_CAMERAS = 60


@dataclass
class Simulation:
    """The made-up clock, and the time that pretending took, which is not the driver's."""

    clip_s: float
    report_s: float
    now_s: float = 0.0
    pretended_s: float = 0.0
    n_looks: int = 0

    def sleep(self, seconds: float) -> None:
        """Time passes for the workers."""
        self.now_s += seconds
        self.n_looks += 1


@dataclass
class PretendedWorker:
    """See `app.training.process.Worker`. Trains nothing."""

    job: TrainJob
    project: Project
    simulation: Simulation
    began_s: float = 0.0
    n_reports: int = 0
    is_over: bool = False
    next_s: float = 0.0
    clip_s: float = 0.0

    def __post_init__(self) -> None:
        self.began_s = self.next_s = self.simulation.now_s
        self.clip_s = self.simulation.clip_s * random.Random(self.job.clip_index).uniform(0.7, 1.3)

    def send(self, command: Command) -> None:
        """See `Worker`."""

    def poll(self) -> list[Event]:
        """See `Worker`."""
        if self.simulation.now_s < self.next_s or self.is_over:
            return []
        started_s = time.thread_time()
        events = self._events()
        self.simulation.pretended_s += time.thread_time() - started_s
        return events

    def close(self, *, timeout_s: float) -> None:
        """See `Worker`."""

    def _events(self) -> list[Event]:
        simulation = self.simulation
        self.n_reports += 1
        self.next_s += simulation.report_s
        share = (simulation.now_s - self.began_s) / self.clip_s
        if self.n_reports == 1:
            return [
                WorkerReady(1, 1, f"render-{self.job.clip_index % 100}"),
                StageReported("Reading pictures", 0.5, ""),
            ]
        if share < 1.0:
            step = round(share * N_STEPS)
            report = StepReported(step, N_STEPS, 0.1, 25.0, 1000, "source", 60.0, 0.1)
            return [report, HeldOutMeasured(step, 25.0)] if self.n_reports % 8 == 0 else [report]
        self.is_over = True
        hand_over(self.project, self.job)
        return [ClipTrained(N_STEPS, 25.0)]


def hand_over(project: Project, job: TrainJob) -> None:
    """Leave a finished clip for the driver, with a header as long as that of a real one."""
    source = {"role": "source", "reference_fingerprint": "clip-0"} if job.reference is not None else {}
    header = clip_header(job.clip_index, camera_names=[f"camera_{i:02d}" for i in range(N_CAMERAS)], **source)
    path = project.files(job.clip_index).handed_over
    path.parent.mkdir(exist_ok=True)
    write_clip_state(path, ClipState(anchor_arrays("static"), header))


def resident_mb() -> float:
    """Memory that the process holds, 10^6 bytes."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@dataclass
class Tenth:
    """What a tenth of the clips took."""

    n_done: int
    driver_ms: float
    resident_mb: float


def drive(project: Project, options: argparse.Namespace) -> list[Tenth]:
    """Train all clips with pretended workers."""
    simulation = Simulation(options.clip_s, options.report_s)
    started_s = time.process_time()
    service = TrainingService(
        project,
        split_clips(options.clips, 1),
        holdout=(0,),
        launch=lambda job, project: PretendedWorker(job, project, simulation),
        is_window_open=False,
        n_workers=options.workers,
    )
    print(f"opening the empty project: {time.process_time() - started_s:.2f} s")
    tenths: list[Tenth] = []
    n_done, of_tenth = 0, max(options.clips // 10, 1)
    before_s = time.process_time() - simulation.pretended_s

    def count(line: ProgressLine, outcome: ClipOutcome) -> None:
        nonlocal n_done, before_s
        show_outcome(line, outcome)
        assert outcome.state == "trained", outcome
        n_done += 1
        if n_done % of_tenth == 0:
            now_s = time.process_time() - simulation.pretended_s
            tenths.append(Tenth(n_done, (now_s - before_s) / of_tenth * 1e3, resident_mb()))
            print(
                f"{n_done:6} clips: {tenths[-1].driver_ms:6.2f} ms a clip, {tenths[-1].resident_mb:6.0f} MB", flush=True
            )
            before_s = now_s

    with open(os.devnull, "w") as nowhere:
        line = ProgressLine(nowhere)
        train_clips(
            service,
            range(options.clips),
            on_status=partial(show_status, line),
            on_event=partial(show_event, line),
            on_outcome=partial(count, line),
            sleep=simulation.sleep,
        )
    service.close()
    print(f"{simulation.n_looks} looks at the workers in {simulation.now_s / 3600:.2f} made-up hours")
    return tenths


def pretend_holder(folder: Path, index: int) -> None:
    """A process of another computer that trains one clip."""
    owner = replace(this_process(), host=f"render-{index}", machine="another", boot="another")
    key, token = f"{index:04d}", f"{index:032x}"
    record = HolderRecord(token, owner, clips={key: ClipProgress(index, "running", owner.host, step=5, n_steps=9)})
    write_holder(holder_path(folder, token), record)
    make_claim(ClaimFile(folder, key, 1), token)


def timed_ms(call: Callable[[], object], n: int = 5) -> float:
    """Processor time of a call, the least of some."""
    times = []
    for _ in range(n):
        started_s = time.thread_time()
        call()
        times.append(time.thread_time() - started_s)
    return min(times) * 1e3


def look(folder: Path, options: argparse.Namespace) -> None:
    """What a window that opens the project and looks on pays."""
    started_s = time.perf_counter()
    project = open_project(folder, is_writable=False)
    catalog = ClipCatalog(project, options.clips)
    print(f"opening it with {options.clips} trained clips: {time.perf_counter() - started_s:.2f} s")
    service = TrainingService(project, split_clips(options.clips, 1), holdout=(0,), catalog=catalog)
    statuses = ClipStatuses(service)
    middle = options.clips // 2
    claims = Claims(folder, has_thread=False)
    claims.take("999999")
    for index in range(options.workers):
        pretend_holder(folder, index)
    service.claims.look()
    rows: list[tuple[str, Callable[[], object]]] = [
        ("claims, who only trains", claims.look_after_held),
        (f"claims, who looks at {options.workers} others", service.claims.look),
        ("status of all trainings", lambda: training_status(service)),
        ("states of all clips, nothing has changed", statuses.all),
        ("a clip has ended: judge", lambda: catalog.update(middle)),
        ("a clip has ended: judge, states of all clips", lambda: (catalog.update(middle), statuses.all())),
        ("clips that are due", lambda: due_clips(catalog)),
        ("next clip", lambda: service.next_clip_index),
    ]
    for what, call in rows:
        print(f"  {what:46} {timed_ms(call):8.2f} ms")


def main() -> int:
    """Run and print; 1 where a tenth was over the budget."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, default=10_000)
    parser.add_argument("--workers", type=int, default=500)
    parser.add_argument("--clip-s", type=float, default=180.0, help="made-up seconds that a clip takes")
    parser.add_argument("--report-s", type=float, default=2.0, help="made-up seconds between reports of a worker")
    parser.add_argument("--profile", action="store_true", help="also print where the time goes")
    options = parser.parse_args()
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as name:
        project = make_project(Path(name) / "project")
        profile = cProfile.Profile() if options.profile else None
        if profile is not None:
            profile.enable()
        tenths = drive(project, options)
        if profile is not None:
            profile.disable()
            pstats.Stats(profile).sort_stats("tottime").print_stats(25)
        project.close()
        look(project.folder, options)
    print(
        f"{platform.platform()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, "
        f"Python {platform.python_version()}"
    )
    return int(max(tenth.driver_ms for tenth in tenths) > TARGET_MS)


if __name__ == "__main__":
    sys.exit(main())
