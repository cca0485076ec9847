"""Arrival: a finished clip on its way from its worker to its place in the project, for whoever has claimed it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from app.background.latest import nothing
from app.project.clips.finished_clip import take_in
from app.project.project import Project
from app.training.worker.disk_retries import Retries
from engine.errors import DiskError, ProjectError
from engine.training.preparation.stages import remove_stages


class Arrival:
    """Takes a clip in on a thread, since that reads the earlier one and waits for the disk; again after a while where
    the disk refuses. Methods are for one other thread and do not wait.

    Args:
        project: With its lock, or with a claim of the clip.
        is_endless: A window is open: its user makes room, or stops the training.
        check: Called on the thread before; raises ProjectError where this process may not put the clip there any more.
        clock: Seconds; tests bring their own.

    Attributes:
        error: Why it could not be put in its place; None where it is.
        n_refused: How often the disk has refused.
    """

    def __init__(
        self,
        project: Project,
        clip_index: int,
        *,
        is_endless: bool,
        check: Callable[[], None] = nothing,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._project, self._clip_index, self._check = project, clip_index, check
        self._retries = Retries(is_endless=is_endless, clock=clock)
        self._thread: threading.Thread | None = None
        self.error: ProjectError | None = None
        self.n_refused = 0
        self._begin()

    def poll(self) -> bool:
        """Whether it is over: the clip is in its place, or was given up."""
        if self._thread is None:
            if self._retries.wait_s <= 0.0:
                self._begin()
            return False
        if self._thread.is_alive():
            return False
        self._thread = None
        if not isinstance(self.error, DiskError):
            return True
        self.n_refused += 1
        return not self._retries.failed(is_kept=True)

    def wait(self) -> None:
        """Wait for the thread's present work."""
        if self._thread is not None:
            self._thread.join()

    def _begin(self) -> None:
        self.error = None
        self._thread = threading.Thread(target=self._take_in, name=f"clip {self._clip_index} arrives", daemon=True)
        self._thread.start()

    def _take_in(self) -> None:
        try:
            self._check()
            try:
                is_there = take_in(self._project, self._clip_index)
            except DiskError:
                if not remove_stages(self._project.prep_dir, self._clip_index):  # no longer of use, and may fill a disk
                    raise
                is_there = take_in(self._project, self._clip_index)
            if not is_there:
                raise ProjectError("The trained clip was removed before it was in its place.", hint="Train it again.")
        except ProjectError as error:
            self.error = error
