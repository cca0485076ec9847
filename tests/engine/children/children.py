"""Kinds of children that misbehave, one way each."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import time
from pathlib import Path

import msgspec

from engine.children.child import Parent
from engine.children.kind import ChildKind, Unwanted
from engine.errors import CaptureError, PreparationError

HERE = "tests.engine.children.children"
WIDE = "x" * (1 << 20)
"""Much more than a pipe holds."""


class Ask(msgspec.Struct, frozen=True):
    """What a child is to do.

    Attributes:
        how: A name of BEHAVIOUR.
        path: For what it leaves behind.
        payload: Sent along, and back.
    """

    how: str
    path: Path = Path()
    payload: str = ""


def kind(**options) -> ChildKind[Ask, str, str]:
    return ChildKind(work=f"{HERE}:work", what="The child", job=Ask, event=str, result=str, command=str, **options)


AT_ONCE = kind(place=f"{HERE}:AT_ONCE", stall_s=60.0)
TIDY = kind(place=f"{HERE}:TIDY", grace_s=60.0)
STUBBORN = kind(place=f"{HERE}:STUBBORN", grace_s=0.3)


def work(job: Ask, parent: Parent[str]) -> str:
    return BEHAVIOUR[job.how](job, parent)


def _echo(job: Ask, parent: Parent[str]) -> str:
    return job.payload


def _variable(job: Ask, parent: Parent[str]) -> str:
    return os.environ.get(job.payload, "none")


def _flood(job: Ask, parent: Parent[str]) -> str:
    for _ in range(20):
        parent.report(WIDE)
    os.write(1, b"from a library")
    sys.stderr.write(WIDE)
    return WIDE


def _listen(job: Ask, parent: Parent[str]) -> str:
    """Hears commands after not having listened for a while."""
    parent.report("deaf")
    while not job.path.exists():
        time.sleep(0.01)
    n_bytes = 0
    while (said := parent.receive(300.0)) != "enough":
        n_bytes += len(said)
    return str(n_bytes)


def _refuse(job: Ask, parent: Parent[str]) -> str:
    problems = [PreparationError("It is dark.", hint="Light it.", path=job.path)]
    raise CaptureError("Nothing can be seen.", hint="Open a window.", path=job.path, problems=problems)


def _fault(job: Ask, parent: Parent[str]) -> str:
    raise ZeroDivisionError("one of a kind")


def _leave(job: Ask, parent: Parent[str]) -> str:
    os._exit(7)


def _die(job: Ask, parent: Parent[str]) -> str:
    os.kill(os.getpid(), signal.SIGKILL)
    return ""


def _memory(job: Ask, parent: Parent[str]) -> str:
    raise MemoryError


def _sleep(job: Ask, parent: Parent[str]) -> str:
    parent.report(str(os.getpid()))
    time.sleep(3600.0)
    return ""


def _spin(job: Ask, parent: Parent[str]) -> str:
    parent.report("working")
    while True:
        pass


def _tidy_up(job: Ask, parent: Parent[str]) -> str:
    parent.report(str(os.getpid()))
    try:
        while True:
            parent.receive(3600.0)
    except Unwanted:
        job.path.write_text("tidy")
        raise


def _linger(job: Ask, parent: Parent[str]) -> str:
    """Takes its time to end after its answer, as processes with large libraries do."""
    atexit.register(time.sleep, 60.0)
    return job.payload


def _lie(job: Ask, parent: Parent[str]) -> str:
    return 17  # type: ignore[return-value]


BEHAVIOUR = {
    "echo": _echo,
    "variable": _variable,
    "flood": _flood,
    "listen": _listen,
    "refuse": _refuse,
    "fault": _fault,
    "leave": _leave,
    "die": _die,
    "memory": _memory,
    "sleep": _sleep,
    "spin": _spin,
    "tidy up": _tidy_up,
    "linger": _linger,
    "lie": _lie,
}
