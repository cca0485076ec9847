"""What the window shows of the capture doctor: a plain value, remade when something changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.status import JobStatus
from engine.doctor.finding import Finding

if TYPE_CHECKING:  # loading what examines takes a second: that is left to the thread
    from engine.doctor.doctor import Diagnosis


@dataclass(frozen=True, eq=False)
class DoctorStatus:
    """What the window shows of it.

    Attributes:
        state: "idle", "running" or "done".
        findings: What is known so far: of numbers alone before a capture was examined.
        diagnosis: What was found; None before.
        progress: Of the job that runs; None while none does.
        revision: Another one whenever findings are others.
        memory_bytes: What examining takes; 0 until that is known.
    """

    state: str = "idle"
    findings: tuple[Finding, ...] = ()
    diagnosis: Diagnosis | None = None
    progress: JobStatus | None = None
    revision: int = 0
    memory_bytes: int = 0
