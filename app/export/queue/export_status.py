"""ExportStatus: one export of the queue, as the window shows it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from app.export.export_progress import ExportProgress, ExportResult

State = Literal["waiting", "running", "stopping", "done", "failed", "cancelled"]


@dataclass(frozen=True, slots=True)
class ExportStatus:
    """One export of the queue.

    Attributes:
        export_id: Its number, given once.
        title: Its kind and format, as "Metrics, CSV".
        path: The file or folder that it writes.
        state: Waiting, running, stopping, or how it has ended.
        progress: The latest progress; None before it began.
        per_s: Units per second; 0 while unknown.
        eta_s: Seconds that are left; None while unknown.
        seconds: Duration; 0 before it ended.
        result: The outcome; None unless it is done.
        message, hint: The cause of its failure, and the remedy.
        project: Folder of the project that it is of.
    """

    export_id: int
    title: str
    path: Path
    state: State = "waiting"
    progress: ExportProgress | None = None
    per_s: float = 0.0
    eta_s: float | None = None
    seconds: float = 0.0
    result: ExportResult | None = None
    message: str = ""
    hint: str = ""
    project: Path = Path()

    @property
    def is_over(self) -> bool:
        """Whether it has ended, in whatever way."""
        return self.state in ("done", "failed", "cancelled")

    @property
    def done(self) -> float:
        """Share that is written, 0..1."""
        if self.state == "done":
            return 1.0
        progress = self.progress
        return 0.0 if progress is None or progress.n_all <= 0 else min(progress.n_done / progress.n_all, 1.0)
