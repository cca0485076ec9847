"""FarChild: a child process on another computer, as `ChildProcess` is one on this. A thread talks to its `Runner`."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, Literal, Protocol, TypeVar

from app.cluster.nodes import Seat
from app.cluster.ray_library import ray_library
from app.project.claims.holder_record import MachineLoad
from engine.children.kind import ChildFailed, ChildKind, Event, Job, Result
from engine.children.messages import Refusal, decoded, encoded
from engine.children.process import Child
from engine.errors import EngineError

logger = logging.getLogger(__name__)

LAST_WORDS_S = 2.0
"""A computer that does not answer within this time is not waited for at the end."""
EXCHANGE_EVERY_S = 0.5
_LOOK_EVERY_S = 0.2
JobThere = TypeVar("JobThere", covariant=True)


class NodeLost(ChildFailed):
    """The computer, or the process on it, is gone or cannot be reached."""


class NodeRefused(Exception):
    """The other computer could not do something. error: Its own."""

    def __init__(self, error: EngineError) -> None:
        super().__init__(str(error))
        self.error = error


class NotWanted(Exception):
    """Raised on the thread of a child that is to end."""


class Remote:
    """Calls the methods of a Runner. For one thread; only `is_ending` is set by another.

    Attributes:
        is_ending: Once it is set, calls raise NotWanted.
    """

    def __init__(self, actor: Any) -> None:
        self._ray, self._actor = ray_library(), actor
        self.is_ending = threading.Event()

    def call(self, method: str, *arguments: object, timeout_s: float | None = None) -> Any:
        """The value that a method returns.

        Args:
            timeout_s: Wait at most so long, whether it is to end or not.
        Raises:
            NodeRefused: With the method's own error.
            NodeLost: The computer does not answer.
            NotWanted: It is to end.
        """
        began_s = time.monotonic()
        try:
            reference = getattr(self._actor, method).remote(*arguments)
            while not self._ray.wait([reference], timeout=_LOOK_EVERY_S)[0]:
                if timeout_s is None and self.is_ending.is_set():
                    raise NotWanted
                if timeout_s is not None and time.monotonic() - began_s > timeout_s:
                    raise NodeLost("It did not answer in time", is_final=False)
            how, value = self._ray.get(reference)
        except self._ray.exceptions.RayError as error:
            raise NodeLost(lost_words(error), is_final=False) from error
        if how == "refused":
            raise NodeRefused(decoded(value, Refusal).error())
        return value

    def kill(self) -> None:
        """End the actor; its child ends with it."""
        with suppress(Exception):
            self._ray.kill(self._actor)


class Errand(Protocol[JobThere]):
    """What has to be brought to the other computer and back. Methods are for the thread of the child."""

    def begin(self, remote: Remote) -> JobThere:
        """Bring what is needed. Returns the job as it is there."""
        ...

    def receive(self, remote: Remote, events: Sequence[Any]) -> None:
        """Fetch what these events are about, before anybody hears of them."""
        ...

    def keep(self, remote: Remote, *, timeout_s: float) -> None:
        """The child has ended without having been asked what became of it: fetch its progress."""
        ...


class FarChild(Child[Job, Event, Result]):
    """One child on another computer. It is started at once; that it could not be is its ending.

    Args:
        kind: The kind of its work.
        seat: Where it runs.
        errand: Brings its job there, and its results back.
        environment: Variables in addition to those of the process there.
    """

    def __init__(
        self, kind: ChildKind[Job, Event, Result], *, seat: Seat, errand: Errand[Job], environment: Mapping[str, str]
    ) -> None:
        super().__init__(kind)
        self._environment = dict(environment)
        self._errand, self._remote = errand, Remote(seat.runner())
        self._name = seat.node.name
        self._grace_s = 0.0
        self.fault: Literal["", "lost", "there", "here"] = ""
        """Why it gave no answer: the other computer was lost, could not do something, or this one could not."""
        self.pid: int | None = None
        """Its process there; None before it runs."""
        self.load: MachineLoad | None = None
        """How busy the other computer was when it was last asked."""
        self._thread = threading.Thread(target=self._work, name=f"child on {self._name}", daemon=True)
        self._thread.start()

    def end(self, grace_s: float = 0.0) -> None:
        """See `Child`."""
        self._grace_s = grace_s
        self._remote.is_ending.set()
        self._thread.join(grace_s + LAST_WORDS_S)

    # ---------------------------------------------------------------- on the thread

    def _work(self) -> None:
        try:
            ending = self._run()
        except NotWanted:
            ending = ChildFailed(f"{self.kind.what} was ended", is_final=False)
            self._tidy_up()
        except NodeLost as error:
            self.fault = "lost"
            ending = NodeLost(f"{self.kind.what} on {self._name} was lost ({error})", is_final=False)
        except NodeRefused as refused:
            self.fault, ending = "there", refused.error
        except EngineError as error:
            self.fault, ending = "here", error
        except ChildFailed as error:
            self.fault, ending = "" if error.is_final else "lost", error
        except Exception as error:
            logger.exception("a child on %s", self._name)
            ending = ChildFailed(f"{self.kind.what} failed ({error})", is_final=True)
        self._remote.kill()
        self._end_with(ending)

    def _run(self) -> Result:
        job = self._errand.begin(self._remote)
        self.pid = self._remote.call("start", self.kind.place, encoded(job), self._environment)
        while True:
            said, ending, load = self._remote.call("exchange", self._told(), EXCHANGE_EVERY_S)
            events = [decoded(data, self.kind.event) for data in said]
            self._errand.receive(self._remote, events)
            for event in events:
                self._say(event)
            if load is not None:
                self.load = decoded(load, MachineLoad)
            if ending is not None:
                return self._ended(*ending)

    def _told(self) -> list[bytes]:
        messages: list[bytes] = []
        with suppress(queue.Empty):
            while (message := self._outbox.get_nowait()) is not None:
                messages.append(message)
        return messages

    def _ended(self, how: str, value: Any, is_final: bool) -> Result:
        if how == "refused":
            raise NodeRefused(decoded(value, Refusal).error())
        if how == "failed":
            raise ChildFailed(f"{value}, on {self._name}", is_final=is_final)
        return decoded(value, self.kind.result)

    def _tidy_up(self) -> None:
        if self.pid is None or self._grace_s <= 0.0:
            return
        until_s = time.monotonic() + self._grace_s
        with suppress(NodeLost, NodeRefused, EngineError):
            self._remote.call("end", self._grace_s, timeout_s=self._grace_s)
            self._errand.keep(self._remote, timeout_s=max(until_s - time.monotonic(), LAST_WORDS_S))


def lost_words(error: Exception) -> str:
    """Ray's reason in a few words: its messages are paragraphs."""
    kind = type(error).__name__
    words = {
        "NodeDiedError": "the computer is gone",
        "ActorDiedError": "its process, or the computer, is gone",
        "ActorUnavailableError": "it cannot be reached",
        "OutOfMemoryError": "it ran out of memory",
        "ActorUnschedulableError": "the computer is gone",
        "TaskUnschedulableError": "the computer is gone",
    }
    return words.get(kind, f"{kind}: {str(error).strip().splitlines()[-1] if str(error).strip() else ''}")
