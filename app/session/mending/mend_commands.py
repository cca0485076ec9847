"""Commands about mending."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AskMend:
    """Show what mending a boundary, or some frames, would do, and what is known of it.

    Attributes:
        after: The clip that begins at the boundary; None for frames.
        frames: First frame and the one behind the last; None for a boundary.
    """

    after: int | None = None
    frames: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True)
class StartMend:
    """Mend what is shown. method: "auto", or a name of engine.mending.figures.METHODS."""

    method: str = "auto"


@dataclass(frozen=True, slots=True)
class StopMend:
    """End the mending that runs; all clips are as they were."""


@dataclass(frozen=True, slots=True)
class CompareMended:
    """Put what a mended clip was beside what it is now, or no more."""


@dataclass(frozen=True, slots=True)
class RevertMend:
    """Bring back what the clips were before they were mended."""


@dataclass(frozen=True, slots=True)
class CloseMend:
    """Keep what is, and show nothing of it any more. A mending that runs is ended."""


MendCommand = AskMend | StartMend | StopMend | CompareMended | RevertMend | CloseMend
"""What is done about a seam or a stretch with flicker."""
