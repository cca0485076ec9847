"""Commands about captures: examining them, calibrating plain videos, and synchronising cameras."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.calibration.job import CalibrationRequest
from engine.capture.writers.capture_json import Corrections


@dataclass(frozen=True, slots=True)
class ExamineCapture:
    """Let the capture doctor look at the open capture."""


@dataclass(frozen=True, slots=True)
class StopExamining:
    """Stop the examination."""


@dataclass(frozen=True, slots=True)
class CorrectCapture:
    """Write corrections into the capture's capture.json and open it as a new project.

    Attributes:
        corrections: For capture.json.
        words: The same for the question that is asked before, as "Exclude cam07".
        is_confirmed: It was asked and answered.
    """

    corrections: Corrections
    words: str
    is_confirmed: bool = False


DoctorCommand = ExamineCapture | StopExamining | CorrectCapture
"""Commands of the capture doctor."""


@dataclass(frozen=True, slots=True)
class LookAtVideos:
    """Show which cameras are in a folder of plain videos, to calibrate them."""

    folder: Path


@dataclass(frozen=True, slots=True)
class CalibrateVideos:
    """Find the cameras of the folder that is shown, and write capture.json."""

    request: CalibrationRequest


@dataclass(frozen=True, slots=True)
class KeepCalibration:
    """Write a calibration that has failed all the same, with doubtful cameras in use."""


@dataclass(frozen=True, slots=True)
class StopCalibration:
    """End the calibration that runs; nothing is written."""


CalibrationCommand = LookAtVideos | CalibrateVideos | KeepCalibration | StopCalibration
"""From plain videos to a capture."""


@dataclass(frozen=True, slots=True)
class FollowRecording:
    """Take in frames of the open capture as they are recorded, and train each clip once complete; or stop that."""

    is_wanted: bool = True


@dataclass(frozen=True, slots=True)
class SynchroniseCameras:
    """Measure how far the cameras of the open capture are ahead of each other."""


@dataclass(frozen=True, slots=True)
class ApplyOffsets:
    """Write a capture with the offsets that were measured."""

    target: Path
    """The capture's own folder, or another one."""


SynchronisationCommand = SynchroniseCameras | ApplyOffsets
"""Cameras that are ahead of others."""
