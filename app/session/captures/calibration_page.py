"""CalibrationPage: a folder of plain videos to calibrate, as the window shows it. Values only."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from app.project.opening.capture_report import RefusedFolder

State = Literal["looking", "asking", "running", "done"]


@dataclass(frozen=True, slots=True)
class VideoFacts:
    """One camera of the folder: its name, width and height, number of frames, and frames per second (0 unknown)."""

    name: str
    image_size: tuple[int, int]
    n_frames: int
    fps: float


@dataclass(frozen=True, slots=True)
class CalibrationResult:
    """Result of a calibration.

    Attributes:
        capture: The folder to open.
        needs_links: Whether it has to be opened with follow_links, since its videos lie elsewhere.
        n_found: Cameras that were found.
        missing: Names of those that were not.
        has_doubts: Whether the places of some cannot be trusted.
        failure: Why no capture was written; empty where one was.
        lines: The report in sentences.
    """

    capture: Path
    needs_links: bool
    n_found: int
    missing: tuple[str, ...]
    has_doubts: bool
    failure: str
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CalibrationPage:
    """Contents of the dialog.

    Attributes:
        folder: Of the videos.
        state: "looking" into the folder, "asking" for options, "running", or "done".
        cameras: In natural order; none before it was looked at.
        has_capture_json: Whether the folder has one already, which would be replaced.
        failure: Why it cannot be calibrated, or why it was not; None where nothing failed.
        result: None before the end.
    """

    folder: Path
    state: State = "looking"
    cameras: tuple[VideoFacts, ...] = ()
    has_capture_json: bool = False
    failure: RefusedFolder | None = None
    result: CalibrationResult | None = None
