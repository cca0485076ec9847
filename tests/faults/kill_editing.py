"""Kills a program that edits a project at random moments: at most the last step is lost, and the project opens.

A program without a window changes the document of a project as the window does, step after step, by events that a seed
fixes, and says of each step when it has begun and when it is kept. It writes project.json anew after every few steps,
so that many kills hit just that, and closes the project now and then. After each kill the project has to be, to the
byte, what it was after the last step that was kept or after the one that had begun, with the whole way back; the next
round goes on from there. The same is done to the real window on a virtual screen, driven by keys.

    python -m tests.faults.kill_editing --kills 200 --windows 10
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import IO

ROOT = Path(__file__).resolve().parents[2]
MOST_STEPS = 12
"""A kill comes after at most so many steps, however fast the machine is,"""
LONGEST_S = 0.3
"""and at most so much later."""
EVENTS_PER_FILE = 12
"""Of the journal, so that project.json is written anew again and again."""
N_STEPS = 400
START_S = 60.0


@dataclass
class Tally:
    """What was done and what was wrong."""

    kills: Counter[str] = field(default_factory=Counter)
    lost: Counter[int] = field(default_factory=Counter)
    n_steps: int = 0
    faults: list[str] = field(default_factory=list)

    def line(self) -> str:
        """All of it in one line."""
        kills = ", ".join(f"{n} {kind}" for kind, n in sorted(self.kills.items()))
        lost = ", ".join(f"{n} times {steps}" for steps, n in sorted(self.lost.items()))
        return (
            f"{sum(self.kills.values())} kills ({kills}) after {self.n_steps} steps; "
            f"steps lost that had begun: {lost}; {len(self.faults)} faults"
        )


# ---------------------------------------------------------------- the program that is killed


def edit(folder: Path, seed: int) -> None:
    """Edit until killed. Prints "step N" when a step begins and "kept N" once it is on disk."""
    from app.document.storing import document_store
    from app.project.opening.project_access import open_project
    from app.session.editing.kept_document import KeptDocument
    from tests.app.document.documents import random_events

    document_store.MAX_EVENTS = EVENTS_PER_FILE
    rng = random.Random(seed)
    project = open_project(folder)
    kept = KeptDocument(guard=lambda before, after: None, on_change=lambda before, after: None)
    kept.hold(project)
    for number, (event, history) in enumerate(random_events(random.Random(seed), N_STEPS, project.history), start=1):
        print(f"step {number}", flush=True)
        kept._happen(event)
        assert project.history.present == history.present
        assert kept._files.wait_idle(60.0), "not kept after a minute"
        found = kept.take_error()
        assert found is None, found
        print(f"kept {number}", flush=True)
        if rng.random() < 0.05:
            break
    kept.close()
    print("closing", flush=True)
    project.close()


# ---------------------------------------------------------------- who kills it


class KillTest:
    """Kills programs that edit one project. work: An empty folder."""

    def __init__(self, work: Path, rng: random.Random) -> None:
        self.tally = Tally()
        self.folder = work / "project"
        self._rng = rng
        self._make()

    def _make(self) -> None:
        from app.document.project_settings import ProjectSettings
        from app.project.opening.project_access import create_project

        create_project(self.folder, ProjectSettings(capture="none", fingerprint="none")).close()

    def run(self, n_kills: int) -> None:
        """So many rounds."""
        for number in range(n_kills):
            self._round(self._rng.randrange(2**32), f"round {number}")

    def _round(self, seed: int, where: str) -> None:
        from app.project.opening.project_access import open_project
        from engine.errors import EngineError
        from tests.app.document.documents import random_events

        before = open_project(self.folder, is_writable=False).history
        states = [
            before,
            *(history for _, history in islice(random_events(random.Random(seed), N_STEPS, before), N_STEPS)),
        ]
        lines, kind = self._kill(seed)
        n_begun = sum(line.startswith("step") for line in lines)
        n_kept = sum(line.startswith("kept") for line in lines)
        self.tally.kills[kind] += 1
        self.tally.n_steps += n_begun
        if any(line.startswith("Traceback") for line in lines):
            self.tally.faults.append(f"{where}: {lines[-1]}")
        try:
            project = open_project(self.folder)
        except EngineError as error:
            self.tally.faults.append(f"{where}: it does not open: {error}")
            shutil.rmtree(self.folder)
            self._make()
            return
        found, notes = project.history, project.store.notes
        if self._rng.random() < 0.3:
            project.close()
        else:
            assert project._lock is not None
            project._lock.release()  # as after another kill: the journal stays as it is
        fits = [n for n in (n_begun, n_begun - 1) if n >= n_kept and _same(found, states[n])]
        if not fits:
            self.tally.faults.append(f"{where}: neither step {n_begun} nor the one before; {n_kept} were kept; {notes}")
        else:
            self.tally.lost[n_begun - fits[0]] += 1

    def _kill(self, seed: int) -> tuple[list[str], str]:
        """Start the program and kill it. What it has said, and when that was."""
        command = [sys.executable, "-m", "tests.faults.kill_editing", "--edit", str(self.folder), "--seed", str(seed)]
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert process.stdout is not None
        if self._rng.random() < 0.75:
            lines = _lines_up_to(f"step {self._rng.randint(1, MOST_STEPS)}", process.stdout)
            time.sleep(self._rng.uniform(0.0, LONGEST_S))
        else:
            lines = _lines_up_to("closing", process.stdout)
            time.sleep(self._rng.uniform(0.0, 0.03))
        has_ended = process.poll() is not None
        process.kill()
        lines += process.stdout.read().splitlines()
        process.wait()
        process.stdout.close()
        kind = "after its end" if has_ended else "while closing" if "closing" in lines else "while editing"
        return lines, kind


def _lines_up_to(last: str, stream: IO[str]) -> list[str]:
    found: list[str] = []
    while not found or found[-1] not in (last, ""):
        found.append(stream.readline().strip())
    return found


def _same(one: object, other: object) -> bool:
    from tests.faults.fuzz_document import steps_of

    return steps_of(one) == steps_of(other)


# ---------------------------------------------------------------- the window


def kill_windows(work: Path, n_kills: int, rng: random.Random, tally: Tally) -> None:
    """Kill the real window while keys set keys of a camera path, frame after frame. Needs Xvfb and xdotool."""
    from app.project.opening.project_access import open_project
    from tests.app.fakes import write_capture
    from tests.ui.desk import Desk

    for name in ("DATA", "CONFIG", "STATE"):
        os.environ[f"XDG_{name}_HOME"] = str(work / "home")
    capture = write_capture(work / "capture", n_frames=60)
    folder: Path | None = None
    n_before = 0
    for number in range(n_kills):
        scratch = work / f"window-{number}"
        scratch.mkdir()
        desk = Desk(scratch, [str(capture if folder is None else folder)])
        try:
            desk.wait_for(
                "the project", lambda state: state["can_mark"] and "viewport.canvas" in state["rects"], START_S
            )
            desk.focus()
            if desk.state["n_keys"] != n_before:
                tally.faults.append(f"window {number}: {desk.state['n_keys']} keys at the start, not {n_before}")
            desk.key("Home" if number % 2 == 0 else "End")
            gives_up_s, ends_s = time.monotonic() + START_S, None
            while time.monotonic() < (gives_up_s if ends_s is None else ends_s):
                desk.key("c")
                time.sleep(rng.uniform(0.1, 0.3))
                desk.key("Right" if number % 2 == 0 else "Left")
                time.sleep(rng.uniform(0.05, 0.1))
                if ends_s is None and desk.state["n_keys"] > n_before:
                    ends_s = time.monotonic() + rng.uniform(0.0, 3.0)
            desk.program.kill()
            desk.program.wait()
            n_seen = desk.state["n_keys"]
        finally:
            desk.close()
        if folder is None:
            (folder,) = (path.parent for path in (work / "home").rglob("project.json"))
        tally.n_steps += n_seen - n_before
        if n_seen == n_before:
            tally.faults.append(f"window {number}: no key was set")
        project = open_project(folder, is_writable=False)
        n_before = sum(len(path.keys) for path in project.document.camera_paths)
        tally.kills["of the window"] += 1
        tally.lost[max(n_seen - n_before, 0)] += 1
        if n_before < n_seen - 1:
            tally.faults.append(f"window {number}: {n_seen} keys were seen, {n_before} are there")


def main() -> int:
    """The command line of this script. Returns the exit code: 1 where there was a fault."""
    parser = argparse.ArgumentParser(description="Kill editing at random moments.")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--windows", type=int, default=10, help="beside these, kills of the real window")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--edit", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.edit is not None:
        edit(options.edit, options.seed)
        return 0
    from tests.ui.desk import missing_programs

    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory(prefix="kill-editing-") as folder:
        test = KillTest(Path(folder), rng)
        try:
            test.run(options.kills)
            if missing_programs():
                print(f"The window is left out: {', '.join(missing_programs())} are not installed.")
            else:
                kill_windows(Path(folder), options.windows, rng, test.tally)
        finally:
            for fault in test.tally.faults:
                print("FAULT", fault)
            print(f"seed {options.seed}: {test.tally.line()}")
    return 1 if test.tally.faults else 0


if __name__ == "__main__":
    sys.exit(main())
