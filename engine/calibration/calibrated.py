"""The results of a calibration: plain values."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from engine.calibration.pair_lines import PairCounts
from engine.camera.lens import Lens
from engine.camera.rig import CameraRig


@dataclass(frozen=True, slots=True)
class CalibratedRig:
    """The cameras that were found.

    Attributes:
        rig: At the size of the videos' frames; its pictures are still as the lenses made them. World: z up, the floor
            or the middle of what the cameras see at 0.
        lenses: One per camera.
        points: Points seen by several cameras. [P, 3]
        point_errors_px: Mean distance of each point's sightings from where it lands. [P]
        camera_errors_px: Median distance, per camera. [C]
        n_sightings: Points that each camera sees. [C]
        explained_shares: Of the matches each camera has with others, found before there were cameras, those that the
            cameras explain; low where patterns repeat or a camera is misplaced. [C]
        doubts: Why the place of each camera cannot be trusted; empty for one that nothing speaks against.
        is_metric: Whether units are metres, by a known distance or a board.
        up: The source of the up axis: "floor", "board", one that lay on the floor, or "cameras".
        board_frames: Frames, of those looked at, in which each camera sees the board; None where there is none. [C]
    """

    rig: CameraRig
    lenses: tuple[Lens, ...]
    points: np.ndarray
    point_errors_px: np.ndarray
    camera_errors_px: np.ndarray
    n_sightings: np.ndarray
    explained_shares: np.ndarray
    doubts: tuple[str, ...]
    is_metric: bool
    up: str
    board_frames: np.ndarray | None = None


@dataclass(frozen=True, slots=True)
class MissingCamera:
    """A camera whose place was not found.

    Attributes:
        name: Of its video.
        reason: Why, with numbers.
        nearest: The camera it has most matches with; empty where there is none.
        n_matches: With that camera.
    """

    name: str
    reason: str
    nearest: str = ""
    n_matches: int = 0


@dataclass(frozen=True, slots=True)
class Calibration:
    """The outcome.

    Attributes:
        found: The cameras that were found, in natural order.
        missing: Those that were not.
        warnings: Doubts about it, in sentences.
        failure: Why it has failed although cameras were found; empty where it has not.
        pairs: Every two cameras that were found, with their matches.
    """

    found: CalibratedRig
    missing: tuple[MissingCamera, ...] = ()
    warnings: tuple[str, ...] = field(default=())
    failure: str = ""
    pairs: tuple[PairCounts, ...] = ()
