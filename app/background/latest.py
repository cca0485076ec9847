"""LatestWorker: one thread that always works on the newest request. Older requests that did not start are dropped.

Requests come in lanes, one for each place where a result is shown: the newest of every lane is worked on, lanes in
turn, the active one first. When nothing is requested, the thread works on the likely next requests.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Hashable, Sequence
from typing import Generic, TypeVar

from engine.children.priority import lower_thread

Request = TypeVar("Request", bound=Hashable)
Result = TypeVar("Result")
logger = logging.getLogger(__name__)
MAX_FAILED = 64


def nothing() -> None:
    """Wakes nobody."""


class LatestWorker(Generic[Request, Result]):
    """Computes results off the calling thread; the newest request wins. The thread starts with the first request.

    Attributes:
        active_lane: Its requests come first; others get every second turn.

    Args:
        name: Of the thread, for logs.
        compute: Called on the thread. Its exceptions are kept and handed to `take_error`.
        prepare: Called once on the thread before the first request.
        on_done: Called on the thread after each result that was asked for, to wake somebody up. Must not block.
    """

    def __init__(
        self,
        name: str,
        compute: Callable[[Request], Result],
        *,
        prepare: Callable[[], None] | None = None,
        on_done: Callable[[], None] | None = None,
    ) -> None:
        self._name, self._compute, self._prepare, self._on_done = name, compute, prepare, on_done
        self._condition = threading.Condition()
        self._pending: dict[Hashable, Request] = {}  # at most one a lane, those asked first in front
        self._planned: list[Request] = []
        self._running: list[Request] = []  # zero or one
        self._lane: Hashable = None  # of the running request; None where that was planned
        self._finished: tuple[Request, Result] | None = None
        self._finished_in: dict[Hashable, tuple[Request, Result]] = {}
        self._error: tuple[Request, Exception] | None = None
        self._failed: dict[Hashable, Request] = {}  # at most one a lane
        self._failed_ahead: list[Request] = []
        self._generation = 0
        self._running_generation = 0
        self._n_ahead = 0
        self._last_lane: Hashable = None
        self._is_closed = False
        self._thread: threading.Thread | None = None
        self.active_lane: Hashable = 0

    def request(self, request: Request, *, lane: Hashable = 0) -> None:
        """Ask for a result. Never blocks for long.

        The same request again changes nothing while it waits or runs, nor after it failed: a request in every frame
        must not fail in every frame.
        """
        with self._condition:
            if self._is_closed or self._pending.get(lane) == request or self._failed.get(lane) == request:
                return
            if request in self._running and self._running_generation == self._generation:
                self._pending.pop(lane, None)
                if self._lane is None:  # it was planned; now somebody waits for it
                    self._lane = lane
                return
            self._pending[lane] = request  # in its lane's place, so that no lane waits for ever
            self._start_thread()
            self._condition.notify_all()

    def plan(self, requests: Sequence[Request]) -> None:
        """Set the requests to work on, in this order, while none is pending; they replace those planned before.

        Only `compute` can keep their results: they never become `newest`, and nobody is woken up. A failed one is not
        tried again before it is requested.
        """
        with self._condition:
            self._planned = [] if self._is_closed else [one for one in requests if one not in self._failed_ahead]
            if self._planned:
                self._start_thread()
                self._condition.notify_all()

    def start(self) -> None:
        """Start the thread and prepare it now, rather than with the first request."""
        with self._condition:
            if not self._is_closed:
                self._start_thread()

    def _start_thread(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
            self._thread.start()

    @property
    def newest(self) -> tuple[Request, Result] | None:
        """The result finished last of those asked for, with its request; None before the first."""
        return self._finished

    def newest_in(self, lane: Hashable) -> tuple[Request, Result] | None:
        """The same for one lane."""
        with self._condition:
            return self._finished_in.get(lane)

    @property
    def n_ahead(self) -> int:
        """How many planned results were finished so far."""
        return self._n_ahead

    @property
    def is_still_wanted(self) -> bool:
        """For `compute`: whether its request was not forgotten meanwhile, so that the result may be kept."""
        return self._running_generation == self._generation

    def forget(self) -> None:
        """Drop the last result, waiting and planned requests, and the result of the running one."""
        with self._condition:
            self._generation += 1
            self._pending, self._failed, self._planned, self._failed_ahead = {}, {}, [], []
            self._finished, self._finished_in = None, {}
            self._error = None

    def has_failed(self, request: Request) -> bool:
        """Whether this request failed, so that nothing will come of it."""
        with self._condition:
            return request in self._failed.values()

    def has_failed_ahead(self, request: Request) -> bool:
        """Whether this request failed when nobody had asked for it yet; it is tried again once somebody does."""
        with self._condition:
            return request in self._failed_ahead

    def take_error(self) -> tuple[Request, Exception] | None:
        """The last failure of a request, once."""
        with self._condition:
            error, self._error = self._error, None
            return error

    @property
    def is_busy(self) -> bool:
        """Whether a request waits or runs."""
        with self._condition:
            return bool(self._pending or (self._running and self._lane is not None))

    @property
    def is_idle(self) -> bool:
        """Whether nothing waits, runs or is planned."""
        with self._condition:
            return not (self._pending or self._running or self._planned)

    def wait_idle(self, timeout_s: float) -> bool:
        """Block until nothing waits, runs or is planned; for tests and headless use. False when the time is up."""
        with self._condition:
            return self._condition.wait_for(lambda: not (self._pending or self._running or self._planned), timeout_s)

    @property
    def is_closed(self) -> bool:
        """For `compute`: whether its results are no longer taken up."""
        return self._is_closed

    def close(self, timeout_s: float = 2.0) -> None:
        """Stop after the running request; later requests are ignored."""
        with self._condition:
            self._is_closed = True
            self._pending, self._planned = {}, []
            self._condition.notify_all()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout_s)

    # ---------------------------------------------------------------- on the thread

    def _prepare_thread(self) -> None:
        if self._prepare is None:
            return
        try:
            self._prepare()
        except Exception:  # the edge of a job: each request will fail and say why
            logger.warning("%s could not be prepared", self._name, exc_info=True)

    def _take(self) -> tuple[Hashable, Request]:
        """The lane, None for a planned request, and the request to work on now. There is one."""
        if not self._pending:
            return None, self._planned.pop(0)
        lanes = [lane for lane in self._pending if lane != self.active_lane]
        is_turn = self.active_lane in self._pending and (self._last_lane != self.active_lane or not lanes)
        lane = self._last_lane = self.active_lane if is_turn else lanes[0]
        return lane, self._pending.pop(lane)

    def _run(self) -> None:
        lower_thread()
        self._prepare_thread()
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._pending or self._planned or self._is_closed)
                if self._is_closed:
                    return
                self._lane, request = self._take()
                self._running = [request]
                self._running_generation = self._generation
            try:
                outcome = (request, self._compute(request))
                error = None
            except Exception as raised:
                outcome, error = None, raised
                logger.debug("%s failed", self._name, exc_info=True)
            if self._take_up(request, outcome, error) and self._on_done is not None:
                self._on_done()

    def _take_up(self, request: Request, outcome: tuple[Request, Result] | None, error: Exception | None) -> bool:
        """Whether somebody asked for it."""
        with self._condition:
            lane, self._running = self._lane, []
            is_wanted = self._running_generation == self._generation
            if is_wanted and lane is None:
                self._n_ahead += 1
                if error is not None:
                    self._failed_ahead = [*self._failed_ahead, request][-MAX_FAILED:]
            elif is_wanted and outcome is not None:
                self._finished = self._finished_in[lane] = outcome
            elif is_wanted and error is not None:
                self._failed[lane] = request
                self._error = (request, error)
            self._condition.notify_all()
            return lane is not None
