"""Runs `train --clip K` for all clips of a project as a scheduler does, many at once and some twice, and kills them.

python -m tests.faults.kill_clips --kills 100 --seed 1
python -m tests.faults.kill_clips --kills 50 --folders MOUNT_1/DIR MOUNT_2/DIR   # one folder, mounted twice

Killed are processes, their workers, or both at once; others are halted for longer than a silent holder may live, and
continue; to others SIGTERM is sent, alone or to their whole group. Every process counts as one of several computers,
which know nothing of each other's processes. In the end every clip has to be what an undisturbed training makes of it,
trained once, and nothing may be left over but what the next opening sweeps. The training is a fake that takes seconds,
and a minute is three seconds.
Linux only: processes are found in /proc.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from msgspec import structs

from app.cli.cli import main as run_cli
from app.project.claims import claims, holder_record
from app.project.claims.claim_files import CLAIMS
from app.project.opening.project_access import open_project
from app.training.messages import TrainJob
from app.training.process import ProcessWorker
from app.training.store import ClipStore
from app.training.worker import keeper
from engine.clip_files.clip_state import read_clip_state
from engine.errors import EngineError
from engine.progress import Progress, StepStats
from engine.storage import files as storage
from tests.app.fakes import FakeTraining, make_fake, write_capture
from tests.faults.kill_training import ORPHANS_END_S
from tests.faults.trainings import ROOT, Kept, kept_clips, leftovers, problems_of, processes_end

COMPUTER = "CLIPGSTREAM_TEST_COMPUTER"
N_COMPUTERS = 3
DEAD_AFTER_S = 3.0
N_CLIPS, CLIP_FRAMES, N_STEPS, STEP_S = 6, 2, 60, 0.05
ACTIONS = ("process", "process", "group", "worker", "halt", "halt group", "SIGTERM", "SIGTERM group", "nothing")
USUAL_CODES = (0, 75)
CODES = {"process": (-9,), "group": (-9,), "worker": (1,), "halt": (), "halt group": (), "nothing": ()}
CODES |= {"SIGTERM": (130, -15), "SIGTERM group": (130, -15)}
SPARED_SHARE = 0.7
"""Of processes that train nothing yet, so many are spared."""
LONGEST_S = 600.0


class SlowFake(FakeTraining):
    """A fake that takes its time."""

    def step(self, n: int = 1) -> StepStats:
        time.sleep(STEP_S)
        return super().step(1)


def make_training(job: TrainJob, store: ClipStore, report: Callable[[Progress], None]) -> FakeTraining:
    """The training of a worker."""
    fake = make_fake(job, store, report)
    return SlowFake(fake.capture, fake.clip, fake.reference, report, n_steps=N_STEPS, previous=fake.previous)


def be_hurried() -> None:
    """A minute is three seconds, and this process is one of another computer."""
    claims.DEAD_AFTER_S, claims.LONGEST_GAP_S = DEAD_AFTER_S, DEAD_AFTER_S / 6
    claims.BEAT_EVERY_S, claims.LOOK_EVERY_S = DEAD_AFTER_S / 12, DEAD_AFTER_S / 30
    keeper.CHECKPOINT_EVERY_S = 0.3
    if computer := os.environ.get(COMPUTER):
        holder_record.boot_id = lambda: computer  # others of another one are not asked for in /proc
        storage.process_space = lambda: f"{int(computer):08x}"
        this_process = claims.this_process
        claims.this_process = lambda: replace(this_process(), boot=computer, host=f"computer-{computer}")


def run_command() -> None:
    """The process of a `ClipCommand`."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(run_cli(sys.argv[1:], launch=partial(ProcessWorker, make="tests.faults.kill_clips:make_training")))


class ClipCommand:
    """One run of `train --clip K`, in a session of its own."""

    def __init__(self, capture: Path, project: Path, scratch: Path, clip_index: int, computer: int) -> None:
        self.clip_index, self.action, self.halted_until_s = clip_index, "", 0.0
        self._errors = scratch / f"stderr-{time.monotonic_ns()}.txt"
        arguments = ["train", str(capture), "--project", str(project), "--clip", str(clip_index), "--quiet"]
        arguments += ["--clip-length", str(CLIP_FRAMES)]
        with self._errors.open("wb") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-c", "from tests.faults.kill_clips import run_command; run_command()", *arguments],
                stdout=subprocess.DEVNULL,
                stderr=errors,
                env={**os.environ, "TMPDIR": str(scratch), "PYTHONPATH": str(ROOT), COMPUTER: str(computer)},
                cwd=ROOT,
                start_new_session=True,
            )

    def said(self) -> str:
        """Its standard error."""
        return self._errors.read_text(errors="replace")

    def members(self) -> list[int]:
        """Processes of its session but itself."""
        found = []
        for folder in Path("/proc").glob("[0-9]*"):
            with suppress(OSError, IndexError, ValueError):
                if int((folder / "stat").read_text().rpartition(")")[2].split()[3]) == self.process.pid:
                    found.append(int(folder.name))
        return [pid for pid in found if pid != self.process.pid]

    def send(self, sent: int, *, is_group: bool) -> None:
        """Send a signal to the process, or to its whole group."""
        with suppress(ProcessLookupError):
            (os.killpg if is_group else os.kill)(self.process.pid, sent)


@dataclass
class Tally:
    """What was done and what was wrong."""

    n_runs: int = 0
    actions: Counter[str] = field(default_factory=Counter)
    codes: Counter[int] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    n_rounds: int = 0

    @property
    def n_kills(self) -> int:
        """Of processes that were alive."""
        return sum(n for action, n in self.actions.items() if action != "nothing")

    def line(self) -> str:
        """All of it in one line."""
        actions = ", ".join(f"{n} {action}" for action, n in sorted(self.actions.items()) if action != "nothing")
        codes = ", ".join(f"{n} of {code}" for code, n in sorted(self.codes.items()))
        return (
            f"{self.n_runs} runs of --clip in {self.n_rounds} rounds, {self.n_kills} disturbed ({actions}); "
            f"exit codes: {codes}: {len(self.faults)} faults"
        )


class ClipKills:
    """Rounds of one project each, disturbed until all of its clips are trained.

    Args:
        work: For captures and logs.
        folders: One folder, by the paths of its mounts; projects are made in it.
        rng: Chooses clips, moments and signals.
        n_at_once: Processes side by side.
    """

    def __init__(self, work: Path, folders: list[Path], rng: random.Random, *, n_at_once: int = 3) -> None:
        self._folders, self._rng, self._n_at_once = folders, rng, n_at_once
        self._capture = write_capture(work / "capture", n_frames=N_CLIPS * CLIP_FRAMES)
        self._scratch = work / "scratch"
        self._scratch.mkdir()
        self.tally = Tally()

    def reference(self) -> dict[int, Kept]:
        """The clips that nobody disturbs."""
        project = self._folders[0] / "undisturbed"
        arguments = ["train", str(self._capture), "--project", str(project), "--clip-length", str(CLIP_FRAMES)]
        code = run_cli(
            [*arguments, "--quiet"], launch=partial(ProcessWorker, make="tests.faults.kill_clips:make_training")
        )
        if code:
            raise RuntimeError(f"the training without kills failed with exit code {code}")
        return kept_clips(project)

    def run(self, n_kills: int, expected: dict[int, Kept]) -> None:
        """Disturb so often, and let the last project finish."""
        while self.tally.n_kills < n_kills:
            self.tally.n_rounds += 1
            self._round(f"round-{self.tally.n_rounds}", n_kills, expected)

    def _round(self, name: str, n_kills: int, expected: dict[int, Kept]) -> None:
        running: list[ClipCommand] = []
        finished: dict[int, Kept] = {}
        project, until_s = self._folders[0] / name, time.monotonic() + LONGEST_S
        while len(finished) < len(expected) or running:
            if time.monotonic() > until_s:
                self.tally.faults.append(f"{name}: not finished after {LONGEST_S:.0f} s: {sorted(finished)}")
                break
            while len(running) < self._n_at_once and len(finished) < len(expected):
                missing = [index for index in expected if index not in finished]
                chosen = missing if self._rng.random() < 0.9 else list(expected)
                folder, computer = self._rng.choice(self._folders), self._rng.randrange(1, N_COMPUTERS + 1)
                clip = self._rng.choice(chosen[:3])
                running.append(ClipCommand(self._capture, folder / name, self._scratch, clip, computer))
                self.tally.n_runs += 1
            time.sleep(self._rng.uniform(0.05, 0.6))
            if self.tally.n_kills < n_kills:
                self._disturb(self._rng.choice(running), self._rng.choice(ACTIONS))
            for command in list(running):
                if command.halted_until_s and time.monotonic() > command.halted_until_s:
                    command.halted_until_s = 0.0
                    command.send(signal.SIGCONT, is_group=True)
                if command.process.poll() is not None:
                    running.remove(command)
                    self._check_end(name, command)
            self._check(project, finished, expected, name)
        for command in running:
            command.send(signal.SIGKILL, is_group=True)
        self._check_last(project, expected, name)

    def _disturb(self, command: ClipCommand, action: str) -> None:
        if command.action or command.process.poll() is not None:  # one thing each, so that its end can be judged
            return
        members = command.members()
        if not members and (action == "worker" or self._rng.random() < SPARED_SHARE):  # it only starts yet
            return
        if action == "worker":
            with suppress(ProcessLookupError):
                os.kill(self._rng.choice(members), signal.SIGKILL)
        elif action.startswith("halt"):
            command.send(signal.SIGSTOP, is_group=action == "halt group")
            command.halted_until_s = time.monotonic() + self._rng.uniform(0.5, 3.0) * DEAD_AFTER_S
        elif action.startswith("SIGTERM"):
            command.send(signal.SIGTERM, is_group=action == "SIGTERM group")
        elif action != "nothing":
            command.send(signal.SIGKILL, is_group=action == "group")
        command.action = "" if action == "nothing" else action
        self.tally.actions[action] += 1

    def _check_end(self, name: str, command: ClipCommand) -> None:
        code, said = command.process.returncode, command.said()
        self.tally.codes[code] += 1
        if code not in USUAL_CODES + CODES.get(command.action, ()):
            what = command.action or "undisturbed"
            self.tally.faults.append(f"{name}: clip {command.clip_index}, {what}: exit code {code}: {said[-500:]}")
        for word in ("Traceback", "bug in the program", "Logging error"):
            if word in said:
                self.tally.faults.append(f"{name}: clip {command.clip_index}: {word}: {said[-1500:]}")

    def _check(self, project: Path, finished: dict[int, Kept], expected: dict[int, Kept], name: str) -> None:
        """Add the finished clips of a project in which others are at work, as one of its mounts shows them."""
        for path in project.glob("c*/[0-9]*.safetensors"):  # clips and checkpoints
            try:
                state = read_clip_state(path)
            except EngineError as error:
                if path.is_file():  # else its clip is finished, or the mount does not show it yet
                    self.tally.faults.append(f"{name}: {error}")
                continue
            if path.parent.name == "clips":
                index = int(path.stem)
                finished[index] = Kept(state.fingerprint, structs.replace(state.header, metrics=None))
                if finished[index] != expected[index]:
                    self.tally.faults.append(f"{name}: clip {index} differs from that without kills")

    def _check_last(self, project: Path, expected: dict[int, Kept], name: str) -> None:
        for alive in processes_end(self._scratch, ORPHANS_END_S):  # those of what was killed last, too
            self.tally.faults.append(f"{name}: still running {ORPHANS_END_S:.0f} s after the end: {alive}")
        self.tally.faults += [f"{name}: {problem}" for problem in problems_of(project)]
        open_project(project).close()
        if kept_clips(project) != expected:
            self.tally.faults.append(f"{name}: clips changed when the project was opened")
        if (project / "versions").exists():
            self.tally.faults.append(f"{name}: trained twice: {list((project / 'versions').rglob('*'))}")
        others = [path.name for path in (project / CLAIMS).glob("*") if path.name[:1].isdigit()]
        partials = [path for path in leftovers(project, self._scratch) if ".partial-" not in path]
        self.tally.faults += [f"{name}: left over: {path}" for path in partials]
        if others:  # of other computers: whoever trains or watches removes them after a minute
            print(f"  {name}: claims of the dead: {others}", flush=True)
        shutil.rmtree(project, ignore_errors=True)


if COMPUTER in os.environ:
    be_hurried()


def main() -> int:
    """The command line of this script. Returns the exit code: 1 where there was a fault."""
    parser = argparse.ArgumentParser(description="Kill processes of `train --clip`.")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--at-once", type=int, default=3)
    parser.add_argument("--folders", type=Path, nargs="+", help="one folder, by the paths of its mounts")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="kill-clips-") as folder:
        rng = random.Random(options.seed)
        folders = options.folders or [Path(folder)]
        test = ClipKills(Path(folder), folders, rng, n_at_once=options.at_once)
        try:
            test.run(options.kills, test.reference())
        finally:
            for fault in test.tally.faults:
                print("FAULT", fault)
            print(f"seed {options.seed}: {test.tally.line()}")
    return 1 if test.tally.faults else 0


if __name__ == "__main__":
    sys.exit(main())
