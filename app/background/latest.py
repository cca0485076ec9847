"""LatestWorker: one thread that always works on the newest request. Older requests that did not start are dropped."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

from app.background.priority import lower_thread

Request = TypeVar("Request", bound=Hashable)
Result = TypeVar("Result")
logger = logging.getLogger(__name__)


class LatestWorker(Generic[Request, Result]):
    """Computes results off the calling thread; the newest request wins. The thread starts with the first request.

    Args:
        name: Of the thread, for logs.
        compute: Called on the thread. What it raises is kept and handed to `take_error`.
        prepare: Called once on the thread before the first request.
        on_done: Called on the thread after each result, to wake somebody up. Must not block.
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
        self._pending: list[Request] = []  # zero or one
        self._running: list[Request] = []  # zero or one
        self._finished: tuple[Request, Result] | None = None
        self._error: tuple[Request, Exception] | None = None
        self._failed: list[Request] = []  # zero or one
        self._generation = 0
        self._running_generation = 0
        self._is_closed = False
        self._thread: threading.Thread | None = None

    def request(self, request: Request) -> None:
        """Ask for a result. Never blocks for long.

        The same request again changes nothing while it waits or runs, nor after it failed: asking at every frame
        must not try in vain at every frame.
        """
        with self._condition:
            if self._is_closed or request in self._pending or request in self._failed:
                return
            is_running = request in self._running and self._running_generation == self._generation
            if not self._pending and is_running:
                return
            self._pending = [request]
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
        """The result finished last, with its request; None before the first."""
        return self._finished

    @property
    def is_still_wanted(self) -> bool:
        """For `compute`: whether what it works on was not forgotten meanwhile, so that something may be kept of it."""
        return self._running_generation == self._generation

    def forget(self) -> None:
        """Drop the last result, what waits, and what comes of the request that runs."""
        with self._condition:
            self._generation += 1
            self._pending, self._failed = [], []
            self._finished = None
            self._error = None

    def has_failed(self, request: Request) -> bool:
        """Whether this request failed, so that nothing will come of it."""
        with self._condition:
            return request in self._failed

    def take_error(self) -> tuple[Request, Exception] | None:
        """The last failure, once."""
        with self._condition:
            error, self._error = self._error, None
            return error

    @property
    def is_busy(self) -> bool:
        """Whether a request waits or runs."""
        with self._condition:
            return bool(self._pending or self._running)

    def wait_idle(self, timeout_s: float) -> bool:
        """Block until nothing waits or runs; for tests and headless use. False when the time is up."""
        with self._condition:
            return self._condition.wait_for(lambda: not (self._pending or self._running), timeout_s)

    def close(self, timeout_s: float = 2.0) -> None:
        """Stop after the running request; later requests are ignored."""
        with self._condition:
            self._is_closed = True
            self._pending = []
            self._condition.notify_all()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout_s)

    def _prepare_thread(self) -> None:
        if self._prepare is None:
            return
        try:
            self._prepare()
        except Exception:  # the edge of a job: requests will fail by themselves and say why
            logger.warning("%s could not be prepared", self._name, exc_info=True)

    def _run(self) -> None:
        lower_thread()
        self._prepare_thread()
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._pending or self._is_closed)
                if self._is_closed:
                    return
                self._running, self._pending = self._pending, []
                self._running_generation = self._generation
            request = self._running[0]
            try:
                outcome = (request, self._compute(request))
                error = None
            except Exception as raised:
                outcome, error = None, raised
                logger.debug("%s failed", self._name, exc_info=True)
            with self._condition:
                self._running = []
                is_wanted = self._running_generation == self._generation
                if outcome is not None and is_wanted:
                    self._finished = outcome
                if error is not None and is_wanted:
                    self._error = (request, error)
                    self._failed = [request]
                self._condition.notify_all()
            if self._on_done is not None:
                self._on_done()
