"""LookedAt: which clips somebody looks at, and so how often the workers of each write live states."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from app.training.clip_run import ClipRun
from app.training.messages import LIVE_VIEWS, SnapshotNow


class LookedAt:
    """Live states of clips that nobody looks at would be written, and sent through a network, for nobody.

    Attributes:
        mode: How often clips that are looked at are shown anew, one of LIVE_VIEWS.
    """

    def __init__(self) -> None:
        self.mode = "live"
        self._clips: Collection[int] | None = None

    def mode_of(self, clip_index: int) -> str:
        """How often a worker of this clip writes live states."""
        return self.mode if self._clips is None or clip_index in self._clips else "off"

    def set_mode(self, mode: str, runs: Iterable[ClipRun]) -> None:
        """Show clips this often from now on; running workers hear of it, and are not waited for.

        Raises:
            ValueError: There is no such mode.
        """
        if mode not in LIVE_VIEWS:
            raise ValueError(f"the live view is one of {', '.join(LIVE_VIEWS)}, not {mode!r}")
        self.mode = mode
        self._tell(runs)

    def look_at(self, clips: Collection[int] | None, runs: Iterable[ClipRun]) -> None:
        """Only these clips are looked at; all of them when None. One that was not before is shown at once."""
        if clips == self._clips:
            return
        runs, before = list(runs), self._clips
        self._clips = clips
        self._tell(runs)
        for run in runs:
            if before is not None and run.clip_index not in before and self.mode_of(run.clip_index) != "off":
                run.worker.send(SnapshotNow())

    def _tell(self, runs: Iterable[ClipRun]) -> None:
        for run in runs:
            run.show(self.mode_of(run.clip_index))
