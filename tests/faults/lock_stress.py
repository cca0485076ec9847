"""Several processes fight for one lock, over left-over and stale locks, while owners are killed: are there two at once?

python -m tests.faults.lock_stress --attempts 10000 --seed 1

Whoever has the lock makes a folder of one name beside it, which the system lets only one process make, stays for a
moment and removes it. A second owner finds the folder: that is a double owner, unless its maker is dead. Some owners
kill themselves in there with SIGKILL, and in three of ten attempts somebody first puts an old or broken lock file in
place of none, as earlier versions and crashes leave them.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import random
import signal
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from app.project.lock import ProcessLock, process_start
from engine.errors import ProjectError

LEFTOVER_SHARE = 0.3
KILL_SHARE = 0.1
"""Of the takes that succeed."""
HOLD_S = 0.001
DEAD_PID = 2**22 + 1
"""Beyond the largest id of Linux."""
PF_EXITING = 0x4
"""Linux's flag of a process that is being taken apart; field 9 of its stat."""
LEFTOVERS = (
    *(b"", b"{", b"\xff\xfe", b"[" * 4000, b'{"pid": 100000000000000000000}', b'{"pid": 1e400}', b'{"pid": -5}'),
    *(b'{"pid": %d}' % DEAD_PID, b'{"pid": %d, "start": "1"}' % DEAD_PID, b'{"pid": 1, "start": "1"}'),
)
"""What crashes and earlier versions leave; the last one is a process id that was used again."""


@dataclass
class StressResult:
    """Counts of a run.

    Attributes:
        n_attempts: Calls of acquire.
        n_taken: Of these, how many got the lock.
        n_double: Of these, how many found another living owner.
        n_leftovers: Attempts before which a broken or stale lock file was put there.
        n_kills: Owners that were killed with the lock in their hands.
        n_untyped: Attempts that ended with anything but the lock or a ProjectError.
    """

    n_attempts: int = 0
    n_taken: int = 0
    n_double: int = 0
    n_leftovers: int = 0
    n_kills: int = 0
    n_untyped: int = 0

    def line(self) -> str:
        """The result in one line."""
        return (
            f"lock: {self.n_attempts} contended attempts, {self.n_leftovers} over left-over locks, "
            f"{self.n_taken} takes, {self.n_kills} owners killed: "
            f"{self.n_double} double owners, {self.n_untyped} untyped exceptions"
        )


def stress(folder: Path, *, n_attempts: int, n_processes: int, seed: int) -> StressResult:
    """Let processes fight until they have made that many attempts together; killed ones are replaced."""
    context = multiprocessing.get_context("fork")  # this process has no threads, and replaces many that are killed
    start = context.Value("i", 0)
    draw = random.Random(seed)
    running, files = [], []
    while start.value < n_attempts or running:
        if any(process.exitcode not in (None, 0, -signal.SIGKILL) for process in running):
            raise RuntimeError("a process of the test itself failed; see above")
        running = [process for process in running if process.is_alive()]
        while len(running) < n_processes and start.value < n_attempts:
            files.append(folder / f"counts-{len(files)}.jsonl")
            arguments = (folder, files[-1], start, n_attempts, draw.randrange(2**32))
            running.append(context.Process(target=_fight, args=arguments))
            running[-1].start()
        time.sleep(0.005)
    total = StressResult()
    for file in files:
        for line in file.read_text().splitlines() if file.exists() else []:
            for name, value in json.loads(line).items():
                setattr(total, name, getattr(total, name) + value)
    return total


def _fight(folder: Path, counts: Path, attempts, n_attempts: int, seed: int) -> None:
    """Attempts of one process, until there were enough or it is killed. Every one is on disk before it may die."""
    draw = random.Random(seed)
    with counts.open("a", buffering=1) as file:
        while True:
            with attempts.get_lock():
                if attempts.value >= n_attempts:
                    return
                attempts.value += 1
            result = StressResult(n_attempts=1)
            lock = ProcessLock(folder / "lock")  # kept until after the kill: a lock that nobody refers to is given back
            is_killed = _attempt(lock, draw, result)
            file.write(json.dumps(asdict(result)) + "\n")
            if is_killed:
                os.kill(os.getpid(), signal.SIGKILL)
            time.sleep(draw.random() * HOLD_S)


def _attempt(lock: ProcessLock, draw: random.Random, result: StressResult) -> bool:
    """One attempt. Returns whether this process is to be killed now, with the lock in its hands."""
    if draw.random() < LEFTOVER_SHARE and _leave(lock.path, draw.choice(LEFTOVERS)):
        result.n_leftovers += 1
    try:
        lock.acquire()
    except ProjectError:
        return False
    except Exception as error:  # noqa: BLE001 - what this looks for
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        result.n_untyped += 1
        return False
    result.n_taken += 1
    inside = lock.path.with_name("inside")
    result.n_double += not _enter(inside)
    time.sleep(draw.random() * HOLD_S)
    if draw.random() < KILL_SHARE:
        result.n_kills += 1
        return True
    with suppress(OSError):
        (inside / _name()).unlink()
        inside.rmdir()
    lock.release()
    return False


def _leave(path: Path, content: bytes) -> bool:
    """Put a broken lock file where none is; an owner that has just come overwrites it."""
    try:
        handle = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY)
    except OSError:
        return False
    with os.fdopen(handle, "wb") as file:
        file.write(content)
    return True


def _name() -> str:
    return f"{os.getpid()}-{process_start(os.getpid())}"


def _is_running(pid: str, start: str) -> bool:
    """Whether a process still runs code of its own.

    One that was killed is listed for as long as the system takes it apart, which begins with the locks it holds, and
    then until its parent takes note.
    """
    try:
        state, *numbers = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return False
    return state not in "ZX" and not int(numbers[5]) & PF_EXITING and numbers[18] == start


def _enter(inside: Path) -> bool:
    """Whether nobody alive is inside. Makes the folder this process's own."""
    is_alone = True
    try:
        inside.mkdir()
    except FileExistsError:
        for other in os.listdir(inside):
            is_alone &= not _is_running(*other.split("-"))
            with suppress(OSError):
                (inside / other).unlink()
    with suppress(OSError):  # a double owner has removed the folder
        (inside / _name()).touch()
    return is_alone


def main() -> int:
    """Run it and print the result. Returns the exit code: 1 where something happened that may not."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--attempts", type=int, default=10_000)
    parser.add_argument("--processes", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="clipgstream-lock-") as folder:
        result = stress(Path(folder), n_attempts=options.attempts, n_processes=options.processes, seed=options.seed)
    print(result.line())
    return 1 if result.n_double or result.n_untyped else 0


if __name__ == "__main__":
    sys.exit(main())
