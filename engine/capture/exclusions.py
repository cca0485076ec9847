"""Exclusions: the parts of a capture that training never sees, apart from cameras held out for measuring. Values."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct, json

_Count = Annotated[int, Meta(ge=0, lt=2**31)]
_Share = Annotated[float, Meta(ge=-1.0, le=2.0)]


class ExcludedFrames(Struct, frozen=True, forbid_unknown_fields=True):
    """Pictures that training never sees.

    Attributes:
        camera: Its name; None for all cameras.
        first, stop: Frames [first, stop).

    Raises:
        ValueError: There is no frame in it.
    """

    camera: str | None
    first: _Count
    stop: _Count

    def __post_init__(self) -> None:
        if self.stop <= self.first:
            raise ValueError(f"frames {self.first} up to {self.stop} are an empty range")


class Stroke(Struct, frozen=True, forbid_unknown_fields=True):
    """One stroke of a brush over a picture.

    Attributes:
        points: x as a share of the picture's width, y as a share of its height; slightly outside is allowed.
        radius: As a share of the picture's width.
        is_erasing: Whether it takes away from what earlier strokes have covered.
    """

    points: Annotated[tuple[tuple[_Share, _Share], ...], Meta(min_length=1, max_length=100_000)]
    radius: Annotated[float, Meta(gt=0.0, le=1.0)]
    is_erasing: bool = False


class PaintedMask(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A part of a camera's pictures that training does not look at.

    Attributes:
        camera: Its name.
        first, stop: Frames [first, stop).
        strokes: In the order in which they were painted.
        object_id: The object of the document that it covers; None of what somebody has painted.

    Raises:
        ValueError: There is no frame in it.
    """

    camera: str
    first: _Count
    stop: _Count
    strokes: tuple[Stroke, ...]
    object_id: _Count | None = None

    def __post_init__(self) -> None:
        if self.stop <= self.first:
            raise ValueError(f"frames {self.first} up to {self.stop} are an empty range")


class Exclusions(Struct, frozen=True, forbid_unknown_fields=True):
    """The parts of a capture that training never sees, apart from cameras held out for measuring.

    Attributes:
        cameras: Names of cameras that are left out altogether.
        frames: Pictures.
        masks: Parts of pictures.
    """

    cameras: tuple[str, ...] = ()
    frames: tuple[ExcludedFrames, ...] = ()
    masks: tuple[PaintedMask, ...] = ()

    def within(self, first: int, stop: int) -> Exclusions:
        """The exclusions that concern frames [first, stop)."""

        def touches(one: ExcludedFrames | PaintedMask) -> bool:
            return one.first < stop and first < one.stop

        return Exclusions(
            self.cameras,
            tuple(one for one in self.frames if touches(one)),
            tuple(one for one in self.masks if touches(one)),
        )

    def leaves_out(self, camera: str, frame_index: int) -> bool:
        """Whether a picture is excluded as a whole."""
        return camera in self.cameras or any(
            one.camera in (None, camera) and one.first <= frame_index < one.stop for one in self.frames
        )

    def usable(self, camera_names: Sequence[str], n_frames: int) -> np.ndarray:
        """Which pictures are not excluded as a whole, cameras and frames alike. [n_frames, cameras] bool"""
        is_usable = np.ones((n_frames, len(camera_names)), bool)
        for row, name in enumerate(camera_names):
            if name in self.cameras:
                is_usable[:, row] = False
            for one in self.frames:
                if one.camera in (None, name):
                    is_usable[one.first : one.stop, row] = False
        return is_usable


NOTHING_EXCLUDED = Exclusions()


def exclusion_key(exclusions: Exclusions, frames: Sequence[int] | range) -> str:
    """A short text that names what is excluded of some frames; empty where nothing is. Whatever was made of pictures
    holds as long as this is the same.

    Args:
        frames: First frame and the one after the last.
    """
    part = exclusions.within(frames[0], frames[-1])
    if part == NOTHING_EXCLUDED:
        return ""
    return hashlib.sha256(json.encode(part)).hexdigest()[:16]
