"""State of the project, its regions, and jobs for the window. Plain values."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from engine.gate.regions import GateRegion


@dataclass(frozen=True, slots=True)
class ProjectStatus:
    """The open project.

    Attributes:
        name: As shown to the user.
        folder: Where it lies.
        n_trained, n_clips: Clips that are finished and up to date, and all of them.
        is_writable: Whether it can be trained into.
        word: For clips that are finished.
    """

    name: str
    folder: Path
    n_trained: int = 0
    n_clips: int = 0
    is_writable: bool = True
    word: str = "trained"

    @property
    def trained_text(self) -> str:
        """How far it is trained, in words."""
        return f"{self.n_trained} of {self.n_clips} clips {self.word}"


@dataclass(frozen=True, slots=True)
class RecordingStatus:
    """The recording of the open capture.

    Attributes:
        is_followed: Whether frames are taken in as they come.
        words: What is waited for; empty where nothing is.
    """

    is_followed: bool = False
    words: str = ""


@dataclass(frozen=True, slots=True)
class RegionsStatus:
    """Where the user marks static and moving parts.

    Attributes:
        regions: As they are kept in the project; later ones overrule earlier ones.
        can_mark: Whether a region can be marked or removed now.
        why_not: The reason if it cannot, and what to do.
        effect: In which clips they take effect.
    """

    regions: tuple[GateRegion, ...] = ()
    can_mark: bool = False
    why_not: str = ""
    effect: str = ""


LEAST_TOLD = 0.05
"""Before this share of a job is done, the time left is not shown: it would be a guess."""


@dataclass(frozen=True, slots=True)
class JobStatus:
    """A short job on a thread.

    Attributes:
        done: Share that is finished, 0..1; 0 when unknown.
        message: Its work at the moment.
        began_s: When it began, by `time.monotonic`; None where nobody noted it.
        can_cancel: Whether the user may give it up.
    """

    name: str
    done: float = 0.0
    message: str = ""
    began_s: float | None = None
    can_cancel: bool = False

    def elapsed_s(self, now_s: float) -> float | None:
        """Seconds since it began. now_s: By `time.monotonic`."""
        return None if self.began_s is None else max(now_s - self.began_s, 0.0)

    def eta_s(self, now_s: float) -> float | None:
        """Seconds that are left, if its share continues rising as it did; None before LEAST_TOLD."""
        spent_s = self.elapsed_s(now_s)
        if spent_s is None or not LEAST_TOLD <= self.done < 1.0:
            return None
        return spent_s * (1.0 - self.done) / self.done


@dataclass(frozen=True, slots=True)
class OpeningForecast:
    """Cost of training all clips of a capture that has no project yet.

    Attributes:
        n_clips: How many there are.
        size: Width and height of the pictures.
        n_pictures: Of all cameras that are trained on, in all frames.
        reference_s: Training of the first clip, which the others inherit from; None where it is not known.
        total_s: Training of all; None likewise.
        memory_mb: Most that a training holds, 10^6 bytes.
        disk_mb: Of all finished clips, roughly, 10^6 bytes.
        free_mb: Room on the disk; None where it is not known.
    """

    n_clips: int
    size: tuple[int, int]
    n_pictures: int
    reference_s: float | None
    total_s: float | None
    memory_mb: float | None
    disk_mb: float
    free_mb: float | None
