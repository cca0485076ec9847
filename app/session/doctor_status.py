"""What the window shows of the capture doctor: a plain value, remade when something changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

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
        done: Share of the work, 0..1.
        message: What it does at the moment.
        eta_s: Seconds that it will still take; None where unknown.
        revision: Another one whenever findings are others.
    """

    state: str = "idle"
    findings: tuple[Finding, ...] = ()
    diagnosis: Diagnosis | None = None
    done: float = 0.0
    message: str = ""
    eta_s: float | None = None
    revision: int = 0
