"""Files of a training that the disk refuses: tried again, reported once, and never written into another project."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from app.document.storing.document_file import PROJECT_FILE
from app.training.messages import WarningRaised
from engine.errors import ProjectError, TrainingError

RETRY_AFTER_S = (1.0, 2.0, 4.0, 10.0)
"""Waits between attempts to write a finished clip; the last one repeats."""
PATIENCE_S = 7.0
"""How long a finished clip is tried again where no user is waiting and a checkpoint holds all of it."""
PATIENCE_UNKEPT_S = 60.0
"""The same where it exists in memory only."""


class ProjectGone(TrainingError):
    """The project folder was deleted, moved or replaced while a clip was trained into it."""


class FolderWatch:
    """Notices that a project folder is not there any more, so that nothing is written into a folder of the same name.

    Args:
        folder: The project as it is now.
    Raises:
        ProjectGone: It is missing already.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known = self._look()

    def check(self) -> None:
        """Check that it is there.

        Raises:
            ProjectGone: It is not, or another folder is in its place.
        """
        found = self._look()
        if found is None:
            return
        if self._known is not None and found != self._known:
            raise self._gone("another folder is in its place")
        self._known = found

    def _look(self) -> tuple[int, int] | None:
        """Which folder it is; None while the disk does not answer."""
        try:
            found = os.stat(self._folder)
            os.stat(self._folder / PROJECT_FILE)
        except FileNotFoundError:
            raise self._gone("it was deleted or moved") from None
        except OSError:
            return None
        return found.st_dev, found.st_ino

    def _gone(self, how: str) -> ProjectGone:
        return ProjectGone(
            f"The project folder is gone: {how}. Training has ended.",
            hint="Put it back, and train again.",
            path=self._folder,
        )


class Refusals:
    """Reports once that a kind of file cannot be written, not every two seconds for as long as the disk is full.

    Args:
        title: Names the missing feature.
        tell: Takes the warning.
    """

    def __init__(self, title: str, tell: Callable[[WarningRaised], None]) -> None:
        self._title, self._tell = title, tell
        self._is_told = False

    def refused(self, error: ProjectError) -> None:
        """Record that it could not be written."""
        if not self._is_told:
            self._tell(WarningRaised(self._title, error.message, error.hint))
        self._is_told = True

    def written(self) -> None:
        """Record that it was written: the next refusal is reported again."""
        self._is_told = False


class Retries:
    """When a finished clip that could not be written is tried again, and when that is given up.

    Args:
        is_endless: A window is open: its user makes room, or stops the training.
        clock: Seconds.
    """

    def __init__(self, *, is_endless: bool, clock: Callable[[], float]) -> None:
        self._is_endless, self._clock = is_endless, clock
        self._since_s: float | None = None
        self._next_s = 0.0
        self._n_failed = 0

    @property
    def wait_s(self) -> float:
        """Until the next attempt; 0 when it is due."""
        return 0.0 if self._since_s is None else max(self._next_s - self._clock(), 0.0)

    @property
    def is_first(self) -> bool:
        """Whether no attempt has failed before the present one."""
        return self._n_failed == 0

    def failed(self, *, is_kept: bool) -> bool:
        """An attempt has failed; `is_kept` says whether a checkpoint holds everything. Whether to try again."""
        now_s = self._clock()
        if self._since_s is None:
            self._since_s = now_s
        self._next_s = now_s + RETRY_AFTER_S[min(self._n_failed, len(RETRY_AFTER_S) - 1)]
        self._n_failed += 1
        return self._is_endless or now_s - self._since_s < (PATIENCE_S if is_kept else PATIENCE_UNKEPT_S)
