"""ChildProcess: the side of the process that starts a child: it sends, listens, notices the end, and ends it.

Threads write and read the pipes, so that neither side ever waits for a full one: what a child says is kept until
somebody asks. A child is started as a program of its own and ends when its input does: also when this process was
killed. It belongs to this process's group, so that Ctrl+Z in a terminal halts both; neither Ctrl+C nor a request to
end, which schedulers send to whole groups, reaches it, since this process decides what that means.
"""

from __future__ import annotations

import logging
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, Generic, cast

import msgspec

from engine.children.kind import ChildFailed, ChildKind, Event, Job, Result
from engine.children.messages import Message, Refusal, decoded, framed, read_message, write_all
from engine.own_modules import module_name, python_path

logger = logging.getLogger(__name__)

POLL_S = 0.1
MAX_TAIL_BYTES = 4000
MAX_EVENTS_PER_POLL = 200
"""A window that slept must not spend a whole frame on old reports."""
END_TIMEOUT_S = 20.0
"""A killed process is gone in a few milliseconds, on a machine that stalls in some seconds. Whoever goes on before may
remove files that it still writes."""
_CREATION_FLAGS = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
"""On Windows, where Ctrl+C reaches a whole group and cannot be blocked."""


class Child(Generic[Job, Event, Result]):
    """A child as its parent sees it, wherever it runs: what it has said, and what it is to be told.

    Args:
        kind: The kind of its work.
    """

    def __init__(self, kind: ChildKind[Job, Event, Result]) -> None:
        self.kind = kind
        self._events: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self._outbox: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._ending: Result | Exception | None = None
        self._has_news, self._is_over = threading.Event(), threading.Event()

    @property
    def is_over(self) -> bool:
        """Whether it has answered, failed or died. Asked before `poll`, that returns its last words."""
        return self._is_over.is_set()

    def send(self, command: object) -> None:
        """Tell the child something. Never waits and never fails."""
        self.pass_on(framed(Message.COMMAND, command))

    def pass_on(self, message: bytes) -> None:
        """The same with a message as `send` makes it."""
        self._outbox.put(message)

    def poll(self, n_most: int = MAX_EVENTS_PER_POLL) -> list[Event]:
        """The events reported since the last call, oldest first. Never waits."""
        events: list[Event] = []
        with suppress(queue.Empty):
            while len(events) < n_most:
                events.append(self._events.get_nowait())
        return events

    def wait(self, timeout_s: float) -> None:
        """Wait until it says something, or ends."""
        self._has_news.wait(timeout_s)
        self._has_news.clear()

    def result(self) -> Result:
        """The child's answer, once it is over.

        Raises:
            EngineError: The child's own error.
            ChildFailed: It gave no answer.
        """
        if isinstance(self._ending, Exception):
            raise self._ending
        return cast("Result", self._ending)

    def end(self, grace_s: float = 0.0) -> None:
        """Have it ended: asked, waited for, killed.

        Args:
            grace_s: How long to wait for it to end by itself.
        """
        raise NotImplementedError

    def _say(self, event: Event) -> None:
        self._events.put(event)
        self._has_news.set()

    def _end_with(self, ending: Result | Exception) -> None:
        self._ending = ending
        self._is_over.set()
        self._has_news.set()


class ChildProcess(Child[Job, Event, Result]):
    """A child on this computer. It is started at once; that it could not be is its ending, like every other failure.

    Args:
        kind: The kind of its work.
        job: Its job.
        folder: The folder the child removes where this process has died before it.
        environment: Variables in addition to those of this process.
        sweep: Called with the child's number once it has died without an answer; removes what it would have removed
            itself.
    """

    def __init__(
        self,
        kind: ChildKind[Job, Event, Result],
        job: Job,
        *,
        folder: Path | None = None,
        environment: Mapping[str, str] | None = None,
        sweep: Callable[[int], None] = lambda pid: None,
    ) -> None:
        super().__init__(kind)
        self._sweep = sweep
        self.still_s = 0.0
        """For how long it has done no work."""
        self._threads: list[threading.Thread] = []
        self._process: subprocess.Popen[bytes] | None = None
        try:
            with ExitStack() as kept:
                self._said = kept.enter_context(tempfile.TemporaryFile())
                self._process = _start(kind, folder, environment or {}, self._said)
                kept.pop_all()
        except OSError as error:
            reason = f"{kind.what} could not be started ({error.strerror or error})"
            self._end_with(ChildFailed(reason, is_final=True))
            return
        self._outbox.put(framed(Message.JOB, job))
        for work in (self._write, self._listen):
            self._threads.append(threading.Thread(target=work, args=(self._process,), daemon=True))
            self._threads[-1].start()

    @property
    def pid(self) -> int | None:
        """The child's number; None where it could not be started."""
        return None if self._process is None else self._process.pid

    def ask_to_end(self) -> None:
        """The child is no longer wanted. It ends at once, or tidies up first, as its kind says."""
        self._outbox.put(None)

    def kill(self) -> None:
        """End it now."""
        if self._process is not None:
            self._process.kill()

    def end(self, grace_s: float = 0.0) -> None:
        """See `Child`."""
        self.ask_to_end()
        if self._process is None:
            return
        if grace_s:
            self._threads[-1].join(grace_s)
        self.kill()
        self._threads[-1].join(END_TIMEOUT_S)

    # ---------------------------------------------------------------- on threads

    def _write(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdin is not None
        with suppress(OSError):  # it has ended
            while (data := self._outbox.get()) is not None:
                write_all(process.stdin.fileno(), data)
        with suppress(OSError):
            process.stdin.close()

    def _listen(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        while (said := read_message(process.stdout.fileno())) is not None:
            kind, data = said
            self.still_s = 0.0
            try:
                if kind is Message.EVENT:
                    self._say(decoded(data, self.kind.event))
                elif kind is Message.RESULT:
                    self._end_with(decoded(data, self.kind.result))
                elif kind is Message.ERROR:
                    self._end_with(decoded(data, Refusal).error())
            except msgspec.DecodeError as error:
                self._end_with(ChildFailed(f"{self.kind.what} sent an unreadable message ({error})", is_final=True))
                process.kill()
        code = process.wait()
        if not self.is_over:
            self._sweep(process.pid)
            self._end_with(self._death(code))
        process.stdout.close()
        self._said.close()
        self._outbox.put(None)

    def _death(self, code: int) -> ChildFailed:
        with suppress(OSError):
            self._said.seek(max(self._said.seek(0, os.SEEK_END) - MAX_TAIL_BYTES, 0))
            tail = self._said.read().decode(errors="replace").strip()
            lines = tail.splitlines()
            if lines:
                logger.warning("%s: %s", self.kind.what, tail)
            if code < 0:
                memory = ", perhaps because memory ran out" if code == -9 else ""
                return ChildFailed(f"{self.kind.what} was ended by signal {-code}{memory}", is_final=False)
            said = f" ({lines[-1]})" if lines else ""
            return ChildFailed(f"{self.kind.what} ended with code {code}{said}", is_final=True)
        return ChildFailed(f"{self.kind.what} ended with code {code}", is_final=code >= 0)


def _start(
    kind: ChildKind[Job, Event, Result], folder: Path | None, added: Mapping[str, str], said: IO[bytes]
) -> subprocess.Popen[bytes]:
    environment = {**os.environ, **added, "PYTHONPATH": python_path()}
    if kind.is_spreading:
        environment["OPENBLAS_NUM_THREADS"] = "1"
    command = [
        sys.executable,
        "-P",
        "-m",
        module_name("engine.children"),
        kind.place,
        *([str(folder)] if folder else []),
    ]
    with undisturbed():
        return subprocess.Popen(
            command,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=said,
            bufsize=0,
            creationflags=_CREATION_FLAGS,
        )


@contextmanager
def undisturbed() -> Iterator[None]:
    """Start processes in this block; Ctrl+C and requests to end never reach them. One that comes meanwhile reaches this
    process after it.

    A process takes over which signals are blocked where it is started, and so do those that it starts.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def run_child(
    kind: ChildKind[Job, Event, Result],
    job: Job,
    *,
    report: Callable[[Event], None] = lambda event: None,
    alive: Callable[[], None] = lambda: None,
    stall_s: float | None = None,
    folder: Path | None = None,
) -> Result:
    """Have a child work, and wait for it.

    Args:
        kind, job, folder: See `ChildProcess`.
        report: Called with the child's reports, once for repeated ones. An error raised by it ends the child.
        alive: Called several times a second; what it raises ends the child, after its time to tidy up.
        stall_s: In place of the kind's.
    Raises:
        EngineError: The child's own error.
        ChildFailed: It gave no result; says why.
    """
    stall_s = kind.stall_s if stall_s is None else stall_s
    child = ChildProcess(kind, job, folder=folder)
    last: Event | None = None
    try:
        while True:
            is_over, began_s = child.is_over, time.monotonic()
            alive()
            for event in child.poll():
                if event != last:
                    report(event)
                last = event
            if is_over:
                return child.result()
            child.wait(POLL_S)
            # a machine that slept, or a group of processes that was halted, has not waited
            child.still_s += min(time.monotonic() - began_s, 1.0)
            if stall_s is not None and child.still_s > stall_s:
                raise ChildFailed(f"{kind.what} did not respond for {stall_s:.0f} s", is_final=False)
    finally:
        child.end(0.0 if child.is_over else kind.grace_s)
