"""How a video says its pictures are turned for display: quarter turns and mirrorings, as phones write them.

The container carries a matrix; whoever shows the video applies it, and so do most calibration tools. Angles between
quarter turns are taken to the nearest one.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from engine.storage.files import open_regular

IDENTITY = (0x10000, 0, 0, 0, 0x10000, 0, 0, 0, 0x40000000)
"""The matrix of pictures that are shown as they are stored; 16.16 fixed point, the last column 2.30."""
MAX_BOXES = 10_000
"""Boxes of an MP4 file that are looked at; a damaged one may seem to hold more."""
_NESTED = (b"moov", b"trak")


@dataclass(frozen=True, slots=True)
class Turn:
    """How stored pictures are made upright: first rows and columns change places, then sides do.

    Attributes:
        is_transposed: Whether width and height change places.
        is_mirrored_x: Whether left and right change places after that.
        is_mirrored_y: Whether top and bottom do.
    """

    is_transposed: bool = False
    is_mirrored_x: bool = False
    is_mirrored_y: bool = False

    @property
    def is_none(self) -> bool:
        """Whether pictures are upright as stored."""
        return self == Turn()

    def size(self, stored: tuple[int, int]) -> tuple[int, int]:
        """Width and height of the upright picture."""
        return (stored[1], stored[0]) if self.is_transposed else stored

    def upright(self, image: np.ndarray) -> np.ndarray:
        """The upright picture. image: [H, W, 3]. A picture of its own unless nothing is turned."""
        if self.is_none:
            return image
        turned = image.swapaxes(0, 1) if self.is_transposed else image
        turned = turned[:, ::-1] if self.is_mirrored_x else turned
        turned = turned[::-1] if self.is_mirrored_y else turned
        return np.ascontiguousarray(turned)

    def text(self) -> str:
        """In words: "turned by 90 degrees"."""
        words = {
            (False, True, True): "turned by 180 degrees",
            (True, True, False): "turned by 90 degrees clockwise",
            (True, False, True): "turned by 90 degrees counter-clockwise",
            (False, False, False): "upright",
        }
        return words.get((self.is_transposed, self.is_mirrored_x, self.is_mirrored_y), "mirrored")


UPRIGHT = Turn()
"""Pictures that are shown as they are stored."""


def turn_of_matrix(matrix: tuple[int, ...]) -> Turn:
    """The nearest turn to a display matrix of nine numbers, row by row: x' = m0 x + m3 y, y' = m1 x + m4 y."""
    along, across = abs(matrix[0]) + abs(matrix[4]), abs(matrix[1]) + abs(matrix[3])
    if across > along:
        return Turn(True, matrix[3] < 0, matrix[1] < 0)
    return Turn(False, matrix[0] < 0, matrix[4] < 0)


def turn_of_frame(frame: Any) -> Turn:
    """How a decoded frame (av.VideoFrame) says it is to be turned."""
    for data in frame.side_data:
        if data.type.name == "DISPLAYMATRIX" and len(bytes(data)) >= 36:
            return turn_of_matrix(struct.unpack("=9i", bytes(data)[:36]))
    return UPRIGHT


def may_be_turned(path: Path) -> bool:
    """Whether an MP4 or QuickTime file has any display matrix but the one that changes nothing. Reads headers only.

    Raises:
        OSError: The system refuses the file.
    """
    with open_regular(path) as file:
        end = file.seek(0, 2)
        return any(matrix != IDENTITY for matrix in _matrices(file, end))


def _matrices(file: BinaryIO, end: int) -> Iterator[tuple[int, ...]]:
    """Matrices of all movie and track headers. What is cut off or damaged gives none."""
    ends = [(0, end)]
    for _ in range(MAX_BOXES):
        while ends and ends[-1][0] + 8 > ends[-1][1]:
            ends.pop()
        if not ends:
            return
        start, box_end = ends.pop()
        file.seek(start)
        head = file.read(16)
        if len(head) < 8:
            return
        size, kind, n_head = int.from_bytes(head[:4], "big"), head[4:8], 8
        if size == 1 and len(head) == 16:
            size, n_head = int.from_bytes(head[8:], "big"), 16
        stop = box_end if size == 0 else start + size
        if stop < start + n_head or stop > box_end:
            return
        ends.append((stop, box_end))
        if kind in _NESTED:
            ends.append((start + n_head, stop))
        elif kind in (b"tkhd", b"mvhd") and stop - start < 1024:
            file.seek(start + n_head)
            body = file.read(stop - start - n_head)
            is_long = body[:1] == b"\x01"  # times of 64 bits
            at = (52 if is_long else 40) if kind == b"tkhd" else (48 if is_long else 36)
            if len(body) >= at + 36:
                yield struct.unpack(">9i", body[at : at + 36])
