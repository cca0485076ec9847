"""Messages between the window's process and the one that measures: small typed values, sent as JSON."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np

from app.residuals.figures import PairFigures, RowFigures
from app.residuals.measuring_order import Look


@dataclass(frozen=True, slots=True)
class MeasureJob:
    """Everything that the process is started with.

    Attributes:
        project: Folder.
        capture, scale, frames, follow_links: How its capture is opened; the project may still name another place.
        trained: Clips that can be measured.
        rows, pairs: What is not known, by frame and camera; pairs by the later frame. [F, C] bool
        is_kept: Whether figures are written into the project.
        look: What the user looks at.
        share: Of the time that may be computed, see SetShare.
    """

    project: str
    capture: str
    scale: float
    frames: tuple[int, int] | None
    follow_links: bool
    trained: tuple[int, ...]
    rows: np.ndarray
    pairs: np.ndarray
    is_kept: bool
    look: Look
    share: float = 1.0


class LookAt(msgspec.Struct, frozen=True, tag=True):
    """The user looks at something else."""

    look: Look


class SetShare(msgspec.Struct, frozen=True, tag=True):
    """From now on compute for at most this share of one core's time, in (0, 1]."""

    share: float


class Measured(msgspec.Struct, frozen=True, tag=True):
    """A picture, or two neighbouring frames."""

    clip_index: int
    row: RowFigures | None = None
    pair: PairFigures | None = None


class Trouble(msgspec.Struct, frozen=True, tag=True):
    """Something could not be read or kept; the rest goes on."""

    message: str


class MeasuringEnded(msgspec.Struct, frozen=True, tag=True):
    """Nothing is left that could be measured."""


Command = LookAt | SetShare
Event = Measured | Trouble | MeasuringEnded

_COMMANDS = msgspec.json.Decoder(Command)
_EVENTS = msgspec.json.Decoder(Event)


def encode(message: Command | Event) -> bytes:
    """One message as JSON."""
    return msgspec.json.encode(message)


def decode_command(data: bytes) -> Command:
    """Inverse of `encode`. Raises msgspec.DecodeError."""
    return _COMMANDS.decode(data)


def decode_event(data: bytes) -> Event:
    """Inverse of `encode`. Raises msgspec.DecodeError."""
    return _EVENTS.decode(data)
