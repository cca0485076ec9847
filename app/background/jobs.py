"""Short jobs on threads, such as opening a capture: progress, cancelling, and one result handed back in poll()."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from app.status import JobStatus

logger = logging.getLogger(__name__)


class JobCancelled(Exception):
    """Raised inside a job by `JobContext.report` after it was cancelled."""


class JobContext:
    """A job's access to the outside."""

    def __init__(self, name: str, *, can_cancel: bool = False) -> None:
        self.status = JobStatus(name, began_s=time.monotonic(), can_cancel=can_cancel)
        self._is_cancelled = threading.Event()

    def report(self, done: float, message: str = "") -> None:
        """Report progress, 0..1.

        Raises:
            JobCancelled: The job is no longer wanted.
        """
        if self._is_cancelled.is_set():
            raise JobCancelled
        self.status = replace(self.status, done=min(max(done, 0.0), 1.0), message=message)

    def cancel(self) -> None:
        """Make the next report raise."""
        self._is_cancelled.set()

    @property
    def is_cancelled(self) -> bool:
        """Whether the job should end soon."""
        return self._is_cancelled.is_set()


class BackgroundJob:
    """One function on one thread.

    Args:
        name: As shown to the user.
        work: Runs on the thread with a JobContext; its return value goes to `on_done`.
        on_done: Called by `Jobs.poll` on the polling thread.
        on_error: Likewise, with the exception.
        can_cancel: Whether the user may give it up.
    """

    def __init__(
        self,
        name: str,
        work: Callable[[JobContext], Any],
        on_done: Callable[[Any], None],
        on_error: Callable[[Exception], None],
        *,
        can_cancel: bool = False,
    ) -> None:
        self.context = JobContext(name, can_cancel=can_cancel)
        self._work, self._on_done, self._on_error = work, on_done, on_error
        self._result: Any = None
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._result = self._work(self.context)
        except Exception as error:  # noqa: BLE001 - the edge of a job: handed to the poller
            self._error = error

    @property
    def is_running(self) -> bool:
        """Whether the thread works."""
        return self._thread.is_alive()

    def join(self, timeout_s: float) -> None:
        """Wait for the end."""
        self._thread.join(timeout_s)

    def deliver(self) -> None:
        """Hand over the result or the error; nothing when it was cancelled."""
        if isinstance(self._error, JobCancelled) or self.context.is_cancelled:
            return
        if self._error is not None:
            self._on_error(self._error)
        else:
            self._on_done(self._result)


class Jobs:
    """The running jobs.

    Args:
        on_fault: Called with a job's name and the exception raised by taking up its result; by default that is logged.
    """

    def __init__(self, on_fault: Callable[[str, Exception], None] | None = None) -> None:
        self._jobs: list[BackgroundJob] = []
        self._on_fault = on_fault

    def start(
        self,
        name: str,
        work: Callable[[JobContext], Any],
        on_done: Callable[[Any], None],
        on_error: Callable[[Exception], None],
        *,
        can_cancel: bool = False,
    ) -> BackgroundJob:
        """Run `work` on a thread; `on_done` or `on_error` follow in `poll`, neither if the user gives it up."""
        job = BackgroundJob(name, work, on_done, on_error, can_cancel=can_cancel)
        self._jobs.append(job)
        return job

    @property
    def statuses(self) -> list[JobStatus]:
        """Of every job that was not delivered yet."""
        return [job.context.status for job in self._jobs]

    def poll(self) -> bool:
        """Deliver finished jobs on this thread. Whether there were any. Exceptions of taking up a result end here."""
        finished = [job for job in self._jobs if not job.is_running]
        self._jobs = [job for job in self._jobs if job not in finished]
        for job in finished:
            try:
                job.deliver()
            except Exception as error:  # the edge of a job: one bad result must not end the window
                logger.exception("%s: the result could not be used", job.context.status.name)
                if self._on_fault is not None:
                    self._on_fault(job.context.status.name, error)
        return bool(finished)

    def give_up(self, name: str) -> None:
        """The user does not want the jobs of this name, as far as they can be cancelled."""
        for job in self._jobs:
            if job.context.status.name == name and job.context.status.can_cancel:
                job.context.cancel()

    def cancel(self) -> None:
        """Cancel all running jobs."""
        for job in self._jobs:
            job.context.cancel()

    def close(self, timeout_s: float = 1.0) -> None:
        """Cancel everything; threads that do not end in time are daemons and end with the program."""
        self.cancel()
        for job in self._jobs:
            job.join(timeout_s)
        self._jobs = []
