"""Collected problems of a capture, so that one message tells all of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from engine.errors import CaptureError

T = TypeVar("T")


class Findings:
    """Problems so far. Readers continue after one and hand all of them to `assemble`."""

    def __init__(self) -> None:
        self.problems: list[CaptureError] = []

    def tried(self, make: Callable[[], T], *, camera: str | None = None) -> T | None:
        """The result of `make`; where it raises a CaptureError, that is kept and the result is None.

        Args:
            make: Reads one thing.
            camera: Named in front of the problem.
        """
        try:
            return make()
        except CaptureError as error:
            self.add(error, camera=camera)
            return None

    def add(self, error: CaptureError, *, camera: str | None = None) -> None:
        """One more problem. camera: named in front of it."""
        self.problems.append(error if camera is None else error.said_of(f'Camera "{camera}"'))
