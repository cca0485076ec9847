"""The capture doctor as the window shows it: a plain value, remade when something changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.status import JobStatus
from engine.doctor.finding import Finding

if TYPE_CHECKING:  # loading the doctor takes a second: that is left to the thread
    from engine.doctor.doctor import Diagnosis


@dataclass(frozen=True, eq=False)
class DoctorStatus:
    """State and findings of the doctor.

    Attributes:
        state: "idle", "running" or "done".
        findings: So far; from the numbers alone before a capture was examined.
        diagnosis: None before the end.
        progress: Of the job that runs; None while none does.
        revision: Differs whenever the findings do.
        memory_bytes: That examining takes; 0 until known.
    """

    state: str = "idle"
    findings: tuple[Finding, ...] = ()
    diagnosis: Diagnosis | None = None
    progress: JobStatus | None = None
    revision: int = 0
    memory_bytes: int = 0
