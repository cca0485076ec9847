"""Runner: the far side. A Ray actor on a computer of the cluster, one for each child process.

It starts the same child process as everywhere, passes messages on in batches, and takes and hands out files where the
project cannot be seen from there. When nobody asks it any more it ends the child, which keeps its progress.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

from app.cluster.mirror import Mirror
from app.cluster.versions import versions
from app.project.claims.holder_record import machine_load
from engine.capture.capture import open_capture
from engine.children.kind import ChildFailed, ChildKind, find
from engine.children.messages import Refusal, decoded, encoded
from engine.children.process import ChildProcess
from engine.errors import EngineError
from engine.parallel import n_cores
from engine.portable import Processor, cpu_kind

ALONE_AFTER_S = 120.0
"""A driver that has said nothing for so long has lost this computer."""
LOAD_EVERY_S = 2.0
"""Between two words on how busy this computer is."""
_NEWEST_COUNTS = ("StepReported", "Progress")
"""Events of which only the last in a row is passed on."""

Answer = tuple[str, Any]
""" "done" and a value, or "refused" and an encoded Refusal: errors cross as values, as everywhere."""


def _answered(method: Callable[..., Any]) -> Callable[..., Answer]:
    @wraps(method)
    def answer(*arguments: Any) -> Answer:
        try:
            return "done", method(*arguments)
        except EngineError as error:
            return "refused", encoded(Refusal.of(error))

    return answer


def look_around(
    probe: str, nonce: str, capture: str, follow_links: bool, is_growing: bool, cpu: Processor
) -> dict[str, Any]:
    """Describe this computer: cores, versions, and whether it sees the project and the capture.

    Args:
        probe: A file of the project that holds the nonce.
        capture, follow_links, is_growing: As the project says.
        cpu: With the instructions of which processor it is to compute.
    Returns:
        "cpu": the kind of its processor, or "no_cpu": why it cannot compute so; "sees": whether project and capture are
        here, "fingerprint" of the capture, and "why" not.
    """
    found = {"cores": n_cores(), "versions": versions(), "sees": False, "fingerprint": ""}
    try:
        found["cpu"] = cpu_kind(cpu)
    except EngineError as error:
        found["no_cpu"] = error.message
    try:
        if Path(probe).read_text("ascii") != nonce:
            return found | {"why": "another project lies in its place"}
    except (OSError, ValueError) as error:
        return found | {"why": f"project: {getattr(error, 'strerror', None) or error}"}
    try:
        seen = open_capture(Path(capture), follow_links=follow_links, is_growing=is_growing)
        fingerprint = seen.fingerprint
        seen.close()
    except (OSError, ValueError, EngineError) as error:
        return found | {"why": f"capture: {getattr(error, 'message', str(error)).rstrip('.')}"}
    return found | {"sees": True, "fingerprint": fingerprint}


class Runner:
    """One child process, and the copy of the project that it works on. Methods are for one caller at a time."""

    def __init__(self) -> None:
        self._child: ChildProcess[Any, Any, Any] | None = None
        self._mirror: Mirror | None = None
        self._asked_s = time.monotonic()
        self._load_said_s = -LOAD_EVERY_S
        threading.Thread(target=self._watch, daemon=True).start()

    @_answered
    def start(self, place: str, job: bytes, environment: dict[str, str]) -> int | None:
        """Start the child. Returns its process.

        Args:
            place: Of its kind.
            job: Encoded.
            environment: Variables in addition to those of this process.
        """
        kind: ChildKind[Any, Any, Any] = find(place)
        self._child = ChildProcess(kind, decoded(job, kind.job), environment=environment)
        return self._child.pid

    @_answered
    def exchange(
        self, messages: list[bytes], wait_s: float
    ) -> tuple[list[bytes], tuple[str, Any, bool] | None, bytes | None]:
        """Pass messages on to the child, and wait for its answers, which come together.

        Returns:
            Events, encoded; and once it is over its ending: "result", "refused" or "failed", encoded or in words, and
            whether it would be so again. And now and then how busy this computer is, a MachineLoad, encoded.
        """
        child = self._child
        assert child is not None
        for message in messages:
            child.pass_on(message)
        until_s = time.monotonic() + wait_s
        while not child.is_over and (left_s := until_s - time.monotonic()) > 0.0:
            child.wait(left_s)
        self._asked_s = time.monotonic()
        is_over, events = child.is_over, list[Any]()
        while found := child.poll():
            for event in found:
                name = type(event).__name__
                if events and name in _NEWEST_COUNTS and type(events[-1]).__name__ == name:
                    events.pop()
                events.append(event)
        ending, load = self._ending(child) if is_over else None, None
        if self._asked_s - self._load_said_s >= LOAD_EVERY_S:
            self._load_said_s, load = self._asked_s, encoded(machine_load())
        return [encoded(event) for event in events], ending, load

    def _ending(self, child: ChildProcess[Any, Any, Any]) -> tuple[str, Any, bool]:
        try:
            return "result", encoded(child.result()), True
        except EngineError as error:
            return "refused", encoded(Refusal.of(error)), True
        except ChildFailed as error:
            return "failed", str(error), error.is_final

    @_answered
    def end(self, grace_s: float) -> None:
        """Have the child ended, with time to keep its progress."""
        if self._child is not None:
            self._child.end(grace_s)

    def _watch(self) -> None:
        while time.monotonic() - self._asked_s < ALONE_AFTER_S or self._child is None:
            time.sleep(ALONE_AFTER_S / 20)
        self._child.end(self._child.kind.grace_s)
        os._exit(1)

    # ---------------------------------------------------------------- files, see Mirror

    @_answered
    def mirror(self, key: str) -> str:
        """Begin a copy. Returns its folder."""
        self._mirror = Mirror(key)
        return str(self._mirror.folder)

    @_answered
    def missing(self, digests: list[str]) -> list[str]:
        """Contents that have to be sent."""
        return self._copy.missing(digests)

    @_answered
    def put(self, parts: list[tuple[str, int, bytes, bool]]) -> None:
        """Take parts of contents."""
        self._asked_s = time.monotonic()
        self._copy.put(parts)

    @_answered
    def build(self, names: list[tuple[str, str]], key: str) -> int:
        """Put contents in their places; see Mirror.build."""
        return self._copy.build(names, key)

    @_answered
    def fingerprint(self, is_growing: bool) -> str:
        """Of the capture that was copied. Refused where it cannot be opened."""
        capture = open_capture(self._copy.capture, is_growing=is_growing)
        capture.close()
        return capture.fingerprint

    @_answered
    def digest(self, name: str) -> str:
        """Of a file of the project; empty where there is none."""
        return self._copy.digest(name)

    @_answered
    def read(self, name: str, offset: int, n_bytes: int) -> bytes:
        """A part of a file of the project."""
        self._asked_s = time.monotonic()
        return self._copy.read(name, offset, n_bytes)

    @_answered
    def forget(self) -> None:
        """Let the copy go."""
        self._copy.forget()

    @property
    def _copy(self) -> Mirror:
        assert self._mirror is not None
        return self._mirror
