"""Trainings of the sample in processes of their own, for tests that kill them or fill their disk."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from msgspec.structs import replace

from app.cli.cli import main
from app.project.opening.project_access import open_project
from app.training.messages import TrainJob
from app.training.process import ProcessWorker
from app.training.store import ClipStore
from app.training.worker import disk_retries, keeper
from app.training.worker.build import build_training
from app.training.worker.interface import Training
from engine.assets import asset_path
from engine.clip_files.clip_header import ClipHeader
from engine.clip_files.clip_state import read_clip_state
from engine.errors import EngineError
from engine.progress import ReportProgress

ROOT = Path(__file__).resolve().parents[2]
SETTINGS = ("--preset", "toy", "--scale", "0.25", "--set", "passes=6", "--clip-length", "5")
FAST = (*SETTINGS, "--set", "static_steps=30", "--set", "joint_steps=30", "--set", "source_steps=20",
        "--holdout", ",".join(f"cam{i:02d}" for i in range(20) if i % 5 in (1, 3, 4)))  # fmt: skip
"""The same with eight cameras and so few steps that a clip takes seconds."""
CADENCE = "CLIPGSTREAM_TEST_CHECKPOINT_EVERY_S"
PATIENCE = "CLIPGSTREAM_TEST_PATIENCE_S"
"""How long a finished clip that nothing else holds is tried again on a full disk."""


@dataclass(frozen=True, slots=True)
class Kept:
    """A finished clip: everything in it that must not depend on how often it was interrupted."""

    fingerprint: str
    header: ClipHeader


def kept_clips(project: Path) -> dict[int, Kept]:
    """The finished clips of a project, read in full.

    Raises:
        EngineError: One of them is damaged.
    """
    found = {}
    for path in sorted((project / "clips").glob("*.safetensors")):
        state = read_clip_state(path)
        # what was measured holds times; the rest of the header is a result like the arrays
        found[int(path.stem)] = Kept(state.fingerprint, replace(state.header, metrics=None))
    return found


def problems_of(project: Path) -> list[str]:
    """What is wrong with a project that was interrupted: it has to open, and everything in it has to be readable."""
    if not (project / "project.json").exists():  # killed before there was one
        return []
    found = []
    try:
        open_project(project, is_writable=False).close()
        kept_clips(project)
    except EngineError as error:
        found.append(f"the project does not open: {error}")
    for path in (project / "checkpoints").glob("[0-9]*.safetensors"):  # not what a process that still lives is writing
        try:
            read_clip_state(path)
        except EngineError as error:
            found.append(f"a checkpoint cannot be read: {error}")
    return found


def leftovers(project: Path, scratch: Path) -> list[str]:
    """Files and folders that a finished training leaves though nobody needs them.

    Args:
        scratch: The temporary folder of its processes.
    """
    names = [path for path in project.rglob("*") if path.name.startswith((".partial-", ".tmp", "lock"))]
    names += [*project.glob("checkpoints/*"), *project.glob("live/*"), *project.glob("prep/clip-*")]
    names += [path for path in scratch.iterdir() if path.name.startswith("clipgstream")]
    return [str(path) for path in names]


class Command:
    """One run of `clipgstream train`, in a session of its own.

    Args:
        project: Project folder.
        scratch: Temporary folder of its processes; also their mark, by which they are found.
        settings: Arguments.
        clips: As "0:2"; "1" trains clip 1 as any number of processes may at once.
        every_s: Checkpoint cadence; None leaves the default.
    """

    def __init__(
        self, project: Path, scratch: Path, settings: tuple[str, ...], clips: str, *, every_s: float | None
    ) -> None:
        self.started_s = time.time()
        self._errors = scratch / f"stderr-{time.monotonic_ns()}.txt"
        self._scratch = scratch
        chosen = ["--clips" if ":" in clips else "--clip", clips]
        arguments = ["train", str(asset_path("sample")), "--project", str(project), *chosen, *settings]
        environment = {**os.environ, "TMPDIR": str(scratch), "PYTHONPATH": str(ROOT)}
        if every_s is not None:
            environment[CADENCE] = str(every_s)
        with self._errors.open("wb") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-c", "from tests.faults.trainings import run_command; run_command()", *arguments],
                stdout=subprocess.DEVNULL,
                stderr=errors,
                env=environment,
                cwd=ROOT,
                start_new_session=True,
            )

    def wait(self, timeout_s: float) -> bool:
        """Whether it has ended within so many seconds."""
        try:
            self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return False
        return True

    def said(self) -> str:
        """Its standard error."""
        return self._errors.read_text(errors="replace")

    def worker(self) -> int | None:
        """Process id of the training worker, if there is one now."""
        for pid, name in _processes_of(self._scratch):
            if pid != self.process.pid and "app.training.process" in name:
                return pid
        return None

    def kill_group(self) -> None:
        """Everything at once, as when a machine runs out of memory or a session ends."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)

    def others_end(self, timeout_s: float) -> list[str]:
        """Processes that this run started and that still live after so many seconds."""
        return processes_end(self._scratch, timeout_s, but=self.process.pid)


def processes_end(scratch: Path, timeout_s: float, *, but: int | None = None) -> list[str]:
    """Processes with this temporary folder that still live after so many seconds; returns as soon as there is none.

    but: One that does not count.
    """
    until_s = time.monotonic() + timeout_s
    while True:
        alive = [f"{pid} {name}" for pid, name in _processes_of(scratch) if pid != but]
        if not alive or time.monotonic() > until_s:
            return alive
        time.sleep(0.1)


def _processes_of(scratch: Path) -> Iterator[tuple[int, str]]:
    """Id and command of every living process with this temporary folder."""
    mark = f"TMPDIR={scratch}".encode()
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            environment = (folder / "environ").read_bytes()  # empty for one that has ended and was not waited for
            if mark in environment.split(b"\0"):
                yield int(folder.name), (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")


def make_training(job: TrainJob, store: ClipStore, report: ReportProgress) -> Training:
    """The real training."""
    return build_training(job, store, report)


if CADENCE in os.environ:
    keeper.CHECKPOINT_EVERY_S = float(os.environ[CADENCE])
if PATIENCE in os.environ:
    disk_retries.PATIENCE_UNKEPT_S = float(os.environ[PATIENCE])


def run_command() -> None:
    """The process of a `Command`."""
    # whatever started the tests in the background made its children ignore Ctrl+C; a terminal does not
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(main(sys.argv[1:], launch=partial(ProcessWorker, make="tests.faults.trainings:make_training")))
