"""The user's options for a calibration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from engine.calibration.boards.board import Board

Lens = Literal["simple", "opencv", "fisheye"]
Up = Literal["floor", "cameras"]
LENSES: dict[str, str] = {
    "simple": "one distortion number: most lenses",
    "opencv": "four numbers, two of them for decentred lenses: wide-angle and inexpensive lenses",
    "fisheye": "four numbers for very wide lenses, such as those of action cameras",
}
"""Lens models by name, and what each is for."""
UPS: dict[str, str] = {
    "floor": "the largest level surface below the cameras; if none is found, the cameras",
    "cameras": "the upper edge of most cameras' pictures",
}
"""Ways to find out which way is up."""
WHAT_TO_FILM = (
    "Carry the board slowly through the whole scene, hold it still here and there, and turn it to every two "
    "neighbouring cameras, so that both see it at the same time."
)


@dataclass(frozen=True, slots=True)
class KnownDistance:
    """How far two cameras stand apart, lens to lens.

    Attributes:
        first, second: Their names.
        metres: More than 0.
    """

    first: str
    second: str
    metres: float


@dataclass(frozen=True, slots=True)
class CalibrationOptions:
    """The request.

    Attributes:
        lens: Name of the lens model, see LENSES.
        is_lens_shared: Whether all cameras are of one make at one zoom: one focal length and one lens for all.
        distance: A measured distance that gives the scene its size in metres; without one the cameras stand about 3
            units from the middle of what they see.
        up: How the up axis is found, see UPS.
        board: A board that all cameras film, and whose size is known; everything is found by it.
    """

    lens: Lens = "simple"
    is_lens_shared: bool = False
    distance: KnownDistance | None = None
    up: Up = "floor"
    board: Board | None = None
