"""The child's side: `python -m engine.children KIND [FOLDER]`. It hears, works, reports and answers.

A child ends when its input does: it is no longer wanted, or the process that started it has died.
"""

from __future__ import annotations

import os
import queue
import shutil
import threading
import time
from contextlib import suppress
from typing import Any, Generic

from engine.children.kind import ChildKind, Event, Unwanted, find
from engine.children.messages import Message, Refusal, decoded, framed, read_message, write_all
from engine.children.priority import idle_process, lower_process
from engine.errors import EngineError

BEAT_EVERY_S = 1.0


class Parent(Generic[Event]):
    """A child's view of the process that started it. For any thread.

    Args:
        heard, said: Descriptors of pipes.
        folder: Removed where nobody is left to do so.
    """

    def __init__(self, heard: int, said: int, folder: str | None = None) -> None:
        self._heard, self._said, self._folder = heard, said, folder
        self._inbox: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._is_gone, self._may_tidy_up = threading.Event(), threading.Event()
        self._lock = threading.Lock()
        self._kind: ChildKind[Any, Event, Any] | None = None
        for work in (self._listen, self._beat):
            threading.Thread(target=work, daemon=True).start()

    def report(self, event: Event) -> None:
        """Tell how far it is.

        Raises:
            Unwanted: Nobody listens now.
        """
        if self._is_gone.is_set():
            raise Unwanted
        self.write(Message.EVENT, event)

    def receive(self, wait_s: float) -> Any:
        """The next command; None where none came in this time.

        Raises:
            Unwanted: No more will come.
        """
        assert self._kind is not None
        try:
            data = self._inbox.get(timeout=wait_s) if wait_s > 0 else self._inbox.get_nowait()
        except queue.Empty:
            return None
        if data is None:
            self._inbox.put(None)
            raise Unwanted
        return decoded(data, self._kind.command)

    def write(self, kind: Message, value: object) -> None:
        """Send one message. Raises Unwanted."""
        try:
            with self._lock:
                write_all(self._said, framed(kind, value))
        except OSError as error:
            raise Unwanted from error

    def answer(self, kind: Message, value: object) -> None:
        """Send the last message. From now on the folder is left to its owner, who reads the results in it.

        Raises:
            Unwanted: Nobody listens now.
        """
        self._folder = None
        self.write(kind, value)

    def job(self, kind: ChildKind[Any, Event, Any]) -> Any:
        """The job of this child. Waits for it; ends the process where nobody asks."""
        self._kind = kind
        data = self._inbox.get()
        if data is None:
            self._leave()
        if kind.grace_s:
            self._may_tidy_up.set()
            if self._is_gone.is_set():
                self._leave()
        return decoded(data or b"", kind.job)

    def _listen(self) -> None:
        while (message := read_message(self._heard)) is not None:
            self._inbox.put(message[1])
        self._is_gone.set()
        self._inbox.put(None)
        if not self._may_tidy_up.is_set():
            self._leave()

    def _leave(self) -> None:
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
        os._exit(1)

    def _beat(self) -> None:
        """Tell for as long as this process works, so that work can be distinguished from standing still."""
        worked_s = 0.0
        while True:
            time.sleep(BEAT_EVERY_S)
            if (now_s := time.process_time()) > worked_s + 0.005:
                worked_s = now_s
                with suppress(Unwanted):
                    self.write(Message.BEAT, None)


def main(place: str, folder: str | None = None) -> None:
    """Do the work of a kind of child."""
    heard, said = os.dup(0), os.dup(1)  # for this process alone; what libraries print goes where errors go
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    parent: Parent[Any] = Parent(heard, said, folder)
    kind: ChildKind[Any, Any, Any] = find(place)
    if kind.priority != "normal":  # before libraries start threads, which take over the priority
        idle_process() if kind.priority == "idle" else lower_process()
    work = find(kind.work)
    with suppress(Unwanted):
        try:
            job = parent.job(kind)
            parent.answer(Message.RESULT, work(job, parent))
        except EngineError as error:
            parent.answer(Message.ERROR, Refusal.of(error))
        except MemoryError:
            error = EngineError("There is not enough memory.", hint="Close other programs.")
            parent.answer(Message.ERROR, Refusal.of(error))
