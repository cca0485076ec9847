"""Kills a training at random moments and goes on with the same command: nothing may be lost but seconds.

python -m tests.faults.kill_training --kills 200 --seed 1

Killed are the whole process group, the main process, the main process with a restart at once, or the worker alone, and
Ctrl+C and SIGTERM are sent, at any moment from the start of the program on, preparation included. After each the
project has to open, finished clips have to be what they were, standard error has to be free of tracebacks, and no
process may stay. When all clips are finished they have to equal, bit for bit, those of a run that nobody disturbed, and
nothing may be left over.
Linux only: processes are found in /proc.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from app.project.clips.metrics_file import read_metrics
from tests.faults.trainings import FAST, SETTINGS, Command, Kept, kept_clips, leftovers, problems_of

KINDS = ("group", "group", "main", "restart at once", "worker", "worker", "Ctrl+C", "SIGTERM")
ALLOWED_CODES = {
    "group": (-9,),
    "main": (-9,),
    "restart at once": (-9,),
    "worker": (1, 0),  # 0: it was the process that measures the machine's speed
    "Ctrl+C": (130,),
    "SIGTERM": (130,),
}
ORPHANS_END_S = 120.0
LONGEST_RUN_S = 600.0
MAX_LOST_S = 30.0


@dataclass
class Tally:
    """What was done and what was wrong."""

    n_rounds: int = 0
    kills: Counter[str] = field(default_factory=Counter)
    states: Counter[str] = field(default_factory=Counter)
    """Of the clip when it was killed: starting or preparing, training."""
    lost_s: list[float] = field(default_factory=list)
    """Training that has to be done again after a hard kill, seconds."""
    faults: list[str] = field(default_factory=list)

    def line(self) -> str:
        """All of it in one line."""
        kinds = ", ".join(f"{n} {kind}" for kind, n in sorted(self.kills.items()))
        states = ", ".join(f"{n} {state}" for state, n in sorted(self.states.items()))
        lost = f"{max(self.lost_s):.1f} s" if self.lost_s else "nothing"
        return (
            f"{sum(self.kills.values())} kills ({kinds}; {states}) in {self.n_rounds} rounds: "
            f"{len(self.faults)} faults, at most {lost} of training lost"
        )


class KillTest:
    """Rounds of one project each, killed until it is finished.

    Args:
        work: An empty folder.
        settings, clips: Arguments of the training.
        every_s: Checkpoint cadence; None leaves the default.
        rng: Chooses moments and kinds.
        longest_s: Latest moment of a kill after the start of the program,
        after_step_s: or after the first step of a training.
    """

    def __init__(
        self,
        work: Path,
        *,
        settings: tuple[str, ...],
        clips: str,
        every_s: float | None,
        rng: random.Random,
        longest_s: float = 14.0,
        after_step_s: float = 5.0,
    ) -> None:
        self._work, self._settings, self._clips, self._every_s = work, settings, clips, every_s
        self._rng, self._longest_s, self._after_step_s = rng, longest_s, after_step_s
        self.tally = Tally()

    def reference(self) -> dict[int, Kept]:
        """The clips of a run that nobody disturbs."""
        project, scratch = self._folders("reference")
        command = self._start(project, scratch)
        if not command.wait(LONGEST_RUN_S) or command.process.returncode != 0:
            command.kill_group()
            raise RuntimeError(f"the training without kills failed: {command.said()}")
        return kept_clips(project)

    def run(self, n_kills: int, expected: dict[int, Kept]) -> None:
        """Kill so often, then let the last project finish."""
        while sum(self.tally.kills.values()) < n_kills:
            self.tally.n_rounds += 1
            self._round(f"round-{self.tally.n_rounds}", n_kills, expected)

    def _round(self, name: str, n_kills: int, expected: dict[int, Kept]) -> None:
        project, scratch = self._folders(name)
        finished: dict[int, Kept] = {}
        command, has_ended = None, False
        # a project is finished at the latest by the last run, which nobody kills; one that was killed leaves its lock
        while len(finished) < len(expected) or not has_ended:
            is_last = sum(self.tally.kills.values()) >= n_kills
            command = self._start(project, scratch)
            kind = self._rng.choice(KINDS)
            has_ended = command.wait(LONGEST_RUN_S) if is_last else self._wait(command, project)
            if has_ended:
                self._check_output(command, "end", (0,))
            elif is_last:
                command.kill_group()
                self.tally.faults.append(f"{name}: not finished after {LONGEST_RUN_S:.0f} s: {command.said()[-500:]}")
                return
            else:
                self._kill(command, kind, project)
            finished = self._check(project, finished, expected, f"{name}, {kind}")
        if command is not None:
            self._check_orphans(command)
        self.tally.faults += [f"{name}: left over: {path}" for path in leftovers(project, scratch)]
        shutil.rmtree(project.parent)

    def _kill(self, command: Command, kind: str, project: Path) -> None:
        worker = command.worker()
        if kind == "worker" and worker is None:  # none yet
            kind = "main"
        self.tally.kills[kind] += 1
        state, lost_s = _progress(project, command.started_s)
        self.tally.states[state] += 1
        print(f"  {time.time() - command.started_s:5.1f} s: {kind}, {state}, {lost_s:.1f} s unkept", flush=True)
        if kind == "group":
            command.kill_group()
        elif kind == "worker":
            with suppress(ProcessLookupError):
                os.kill(worker or 0, signal.SIGKILL)
        elif kind == "Ctrl+C":  # a terminal sends it to all of them
            os.killpg(command.process.pid, signal.SIGINT)
        else:
            command.process.send_signal(signal.SIGTERM if kind == "SIGTERM" else signal.SIGKILL)
        if not command.wait(ORPHANS_END_S + 60.0):
            self.tally.faults.append(f"{kind}: the command did not end")
            command.kill_group()
        if kind in ("group", "worker"):  # an orphan and a signal keep what was learned
            self.tally.lost_s.append(lost_s)
            if self._every_s is None and lost_s > MAX_LOST_S:
                self.tally.faults.append(f"{kind}: {lost_s:.1f} s of work lost")
        if kind != "restart at once":
            self._check_orphans(command)
        self._check_output(command, kind, ALLOWED_CODES[kind])

    def _check_orphans(self, command: Command) -> None:
        for alive in command.others_end(ORPHANS_END_S):
            self.tally.faults.append(f"still running {ORPHANS_END_S:.0f} s after the end: {alive}")
            with suppress(ProcessLookupError):
                os.kill(int(alive.split()[0]), signal.SIGKILL)

    def _check_output(self, command: Command, kind: str, codes: tuple[int, ...]) -> None:
        code, said = command.process.returncode, command.said()
        # a signal may come before the program listens to any
        is_early = kind == "SIGTERM" and code == -signal.SIGTERM and not said
        # a kill may also come when all is done, or while the interpreter ends
        is_late = code == 0 or (
            code == -signal.SIGINT and "Forecast against measured" in said.rstrip().rsplit("\n", 1)[-1]
        )
        if code not in codes and not is_early and not is_late:
            self.tally.faults.append(f"{kind}: exit code {code}: {said[-500:]}")
        for word in ("Traceback", "bug in the program", "Logging error"):
            if word in said:
                self.tally.faults.append(f"{kind}: {word}: {said[-1500:]}")

    def _check(self, project: Path, before: dict[int, Kept], expected: dict[int, Kept], where: str) -> dict[int, Kept]:
        """The finished clips of a project, compared with what was there before and with what should be."""
        found = problems_of(project)
        if found:
            self.tally.faults += [f"{where}: {problem}" for problem in found]
            return before
        clips = kept_clips(project)
        for index, kept in before.items():
            if clips.get(index) != kept:
                self.tally.faults.append(f"{where}: clip {index} was finished and has changed or is gone")
        for index in clips.keys() - before.keys():
            if clips[index].fingerprint != expected[index].fingerprint:
                self.tally.faults.append(f"{where}: the arrays of clip {index} differ from those without kills")
            elif clips[index].header != expected[index].header:
                self.tally.faults.append(f"{where}: the header of clip {index} differs from that without kills")
        return clips

    def _wait(self, command: Command, project: Path) -> bool:
        """Wait for a moment to kill it: in its first seconds, at any time, or while it learns. Whether it has ended."""
        choice = self._rng.random()
        if choice < 0.15:
            return command.wait(self._rng.uniform(0.05, 3.0))
        if choice < 0.5:
            return command.wait(self._rng.uniform(2.0, self._longest_s))
        after_s = self._rng.uniform(0.0, self._after_step_s)
        while not _has_stepped(project, command.started_s):
            if command.wait(0.05):
                return True
        return command.wait(after_s)

    def _folders(self, name: str) -> tuple[Path, Path]:
        scratch = self._work / name / "scratch"
        scratch.mkdir(parents=True)
        return self._work / name / "project", scratch

    def _start(self, project: Path, scratch: Path) -> Command:
        return Command(project, scratch, self._settings, self._clips, every_s=self._every_s)


def _progress(project: Path, started_s: float) -> tuple[str, float]:
    """What a run is doing, and seconds of work that nothing on disk holds: since its start, or since it last kept some.

    An upper bound: starting the program counts as well.
    """
    kept_s = started_s
    for pattern in ("checkpoints/*.safetensors", "clips/*.safetensors", "prep/*.safetensors"):
        for path in project.glob(pattern):
            with suppress(OSError):
                kept_s = max(kept_s, path.stat().st_mtime)
    state = "training" if _has_stepped(project, started_s) else "starting or preparing"
    return state, time.time() - kept_s


def _has_stepped(project: Path, started_s: float) -> bool:
    """Whether a training has written curves since then."""
    for path in project.glob("metrics/*.jsonl"):
        with suppress(OSError):
            if path.stat().st_mtime > started_s and any("train_psnr" in row for row in read_metrics(path)[-4:]):
                return True
    return False


def main() -> int:
    """The command line of this script. Returns the exit code: 1 where there was a fault."""
    parser = argparse.ArgumentParser(description="Kill trainings at random moments.")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--clips", default="0:2")
    parser.add_argument("--every", type=float, default=1.0, help="checkpoint cadence, seconds; 0: the default")
    parser.add_argument("--longest", type=float, default=14.0, help="latest moment of a kill, seconds")
    parser.add_argument("--after-step", type=float, default=5.0, help="or seconds after the first step")
    parser.add_argument("--fast", action="store_true", help="so few steps that a clip takes seconds")
    parser.add_argument("--reference", type=Path, help="project trained with the same settings that nobody disturbed")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="kill-training-") as folder:
        test = KillTest(
            Path(folder),
            settings=FAST if options.fast else SETTINGS,
            clips=options.clips,
            every_s=options.every or None,
            rng=random.Random(options.seed),
            longest_s=options.longest,
            after_step_s=options.after_step,
        )
        expected = test.reference() if options.reference is None else kept_clips(options.reference)
        first, _, end = options.clips.partition(":")
        expected = {index: kept for index, kept in expected.items() if int(first) <= index < int(end)}
        try:
            test.run(options.kills, expected)
        finally:
            for fault in test.tally.faults:
                print("FAULT", fault)
            print(f"seed {options.seed}: {test.tally.line()}")
    return 1 if test.tally.faults else 0


if __name__ == "__main__":
    sys.exit(main())
