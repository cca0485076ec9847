"""Many cases of damage in child processes: what each ended with, how long and how much memory it took.

A case is a module-level function that gets a `Case` and returns an `Outcome`. It runs in a spawned process that is
used for many cases; one that hangs is killed and its process replaced. Opened files are watched by an audit hook.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from pathlib import Path

from engine.errors import EngineError

TIMEOUT_S = 20.0
"""No reader may work this long on a damaged file; the first case of a process has its imports on top."""
STARTING_S = 60.0
BUSY_FACTOR = 15
"""A machine that does other work gives a process at least this part of its time; one that takes longer stands still."""


@dataclass(frozen=True, slots=True)
class Case:
    """One case. `index` and `seed` fix what is damaged and how; `work_dir` is the process's own folder."""

    index: int
    seed: int
    work_dir: Path


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a case ended.

    Attributes:
        what: What was damaged and how, to find the case again.
        verdict: "typed" (refused with an EngineError), "accepted" (without effect on the result, or one that was
            named), or a fault: "untyped", "hang", "outside", "changed", "memory".
        detail: The message.
        file_bytes: Size of the damaged file.
        extra_bytes: Peak memory beyond that before the case: what the case itself found, or of the process.
        seconds: Wall time.
    """

    what: str
    verdict: str
    detail: str = ""
    file_bytes: int = 0
    extra_bytes: int = 0
    seconds: float = 0.0


FAULTS = ("untyped", "hang", "outside", "changed", "memory")
RunCase = Callable[[Case], Outcome]


@dataclass(slots=True)
class Tally:
    """Outcomes of a run."""

    name: str
    outcomes: list[Outcome] = field(default_factory=list)

    @property
    def faults(self) -> list[Outcome]:
        """Cases that may not happen."""
        return [outcome for outcome in self.outcomes if outcome.verdict in FAULTS]

    def line(self) -> str:
        """The result in one line."""
        counts = Counter(outcome.verdict for outcome in self.outcomes)
        told = ", ".join(f"{counts[verdict]} {verdict}" for verdict in ("typed", "accepted", *FAULTS))
        extra = max((outcome.extra_bytes for outcome in self.outcomes), default=0)
        slowest = max((outcome.seconds for outcome in self.outcomes), default=0.0)
        return (
            f"{self.name}: {len(self.outcomes)} cases, {told}; "
            f"extra memory at most {extra / 1e6:.0f} MB, slowest {slowest:.1f} s"
        )


def run_cases(
    name: str,
    run_case: RunCase,
    *,
    n_cases: int,
    seed: int,
    work_dir: Path,
    first: int = 0,
    timeout_s: float = TIMEOUT_S,
    on_outcome: Callable[[int, Outcome], None] = lambda index, outcome: None,
) -> Tally:
    """Run cases `first` to `first + n_cases` one after the other.

    Args:
        name: Begins the result line.
        run_case: Module-level, so that a spawned process finds it. What it opens outside of its work folder, the
            package folders and the interpreter's has to be allowed by `watch_files`.
        work_dir: Each process gets an empty folder of its own below it.
    """
    tally = Tally(name)
    child: _Child | None = None
    for index in range(first, first + n_cases):
        if child is None:
            folder = work_dir / f"process-{index}"
            folder.mkdir(parents=True)
            child = _Child(run_case, folder)
        outcome = child.run(index, seed, timeout_s)
        if outcome.verdict == "hang":
            child.kill()
            child = None
        tally.outcomes.append(outcome)
        on_outcome(index, outcome)
    if child is not None:
        child.kill()
    return tally


class _Child:
    """A process that runs cases until it is killed."""

    def __init__(self, run_case: RunCase, folder: Path) -> None:
        context = multiprocessing.get_context("spawn")
        self._mine, its = context.Pipe()
        self._folder, self._is_new = folder, True
        self._process = context.Process(target=_serve, args=(its, run_case), daemon=True)
        self._process.start()
        its.close()

    def run(self, index: int, seed: int, timeout_s: float) -> Outcome:
        """One case; a hang when it does not end in time, untyped when the process dies of it."""
        started_s = time.monotonic()
        self._mine.send(Case(index, seed, self._folder))
        is_there = self._answers(timeout_s + (STARTING_S if self._is_new else 0.0))
        self._is_new = False
        if not is_there:
            return Outcome(f"case {index}", "hang", f"no end after {timeout_s:.0f} s of work", seconds=timeout_s)
        try:
            outcome = self._mine.recv()
        except EOFError:
            self._process.join(5.0)
            code = self._process.exitcode
            return Outcome(f"case {index}", "hang", f"the process died with code {code}")  # replaced like a hang
        return replace(outcome, seconds=time.monotonic() - started_s)

    def _answers(self, limit_s: float) -> bool:
        """Whether it answers before it has worked for so long. Time that the machine gives to others does not count."""
        until_s, limit_s = time.monotonic() + BUSY_FACTOR * limit_s, limit_s + self._worked_s()
        while not self._mine.poll(0.5):
            if self._worked_s() > limit_s or time.monotonic() > until_s:
                return False
        return True

    def _worked_s(self) -> float:
        times = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()[11:13]
        return sum(map(int, times)) / os.sysconf("SC_CLK_TCK")

    def kill(self) -> None:
        """End it."""
        self._process.kill()
        self._process.join()
        self._mine.close()


def _serve(pipe: Connection, run_case: RunCase) -> None:
    while True:
        try:
            case = pipe.recv()
        except EOFError:
            return
        start_memory()
        try:
            outcome = run_case(case)
        except Exception:  # noqa: BLE001 - the harness itself: shown as a fault
            outcome = Outcome(f"case {case.index}", "untyped", traceback.format_exc())
        pipe.send(replace(outcome, extra_bytes=max(outcome.extra_bytes, _peak_bytes() - _before[0], 0)))


def judge(act: Callable[[], object]) -> tuple[str, str]:
    """Run a reader. Returns "typed", "accepted" or "untyped", and the message."""
    try:
        act()
    except EngineError as error:
        return "typed", str(error)
    except Exception as error:  # noqa: BLE001 - what this is all about
        where = traceback.extract_tb(error.__traceback__)[-1]
        return "untyped", f"{type(error).__name__}: {error!s:.200} ({Path(where.filename).name}:{where.lineno})"
    return "accepted", ""


# ---------------------------------------------------------------- what is opened


_allowed: list[str] = []
_outside: list[str] = []
_hooks: list[object] = []


def watch_files(allowed: list[Path]) -> None:
    """From now on, remember files that this process opens outside of these folders and its own program's."""
    program = [Path(sys.prefix), Path(sys.base_prefix), Path(__file__).resolve().parents[2]]
    _allowed[:] = [str(folder.resolve()) for folder in [*allowed, *program]] + ["/proc/", "/sys/", "/usr/", "/dev/shm"]
    if not _hooks:  # a hook cannot be taken off again
        _hooks.append(_on_audit)
        sys.addaudithook(_on_audit)


def take_outside() -> list[str]:
    """Files opened outside since the last call."""
    found = _outside[:]
    _outside.clear()
    return found


def _on_audit(event: str, arguments: tuple[object, ...]) -> None:
    if event != "open" or not isinstance(arguments[0], str | bytes):
        return
    path = os.path.abspath(os.fsdecode(arguments[0]))  # links are followed by what they are named, not where they lead
    if path != "/dev/null" and not path.startswith(tuple(_allowed)):
        _outside.append(path)


# ---------------------------------------------------------------- memory


_before = [0]


def start_memory() -> None:
    """The case's memory counts from here on: called again by a case after what it loads or makes only once."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")  # the peak is what is resident now
    _before[0] = _resident_bytes()


def _resident_bytes() -> int:
    return _status("VmRSS:")


def _peak_bytes() -> int:
    return _status("VmHWM:")


def _status(key: str) -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(key):
            return int(line.split()[1]) * 1024
    return 0


def fuzz_main(name: str, description: str, run_case: RunCase, *, n_cases: int = 1000) -> int:
    """The command line of a script that damages things: prints each fault, what was damaged, and one line of results.

    Returns:
        The exit code: 1 when there was a fault.
    """
    parser = argparse.ArgumentParser(description=description.partition("\n")[0])
    parser.add_argument("--cases", type=int, default=n_cases)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="index of the first case")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        tally = run_cases(
            f"{name} seed {options.seed}",
            run_case,
            n_cases=options.cases,
            seed=options.seed,
            work_dir=Path(folder),
            first=options.first,
        )
    for outcome in tally.faults:
        print(f"{outcome.verdict}: {outcome.what}: {outcome.detail}")
    kinds = Counter(outcome.what.partition(":")[0] for outcome in tally.outcomes)
    print(", ".join(f"{n} {kind}" for kind, n in sorted(kinds.items())))
    print(tally.line())
    return 1 if tally.faults else 0
