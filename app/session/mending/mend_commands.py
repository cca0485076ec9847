"""Commands about mending."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AskMend:
    """Show what mending a boundary, or some frames, would do.

    Attributes:
        after: The clip that begins at the boundary; None for frames.
        frames: First frame and the one behind the last; None for a boundary.
    """

    after: int | None = None
    frames: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True)
class StartMend:
    """Begin the mending that is shown. method: "auto", or a name of engine.mending.figures.METHODS."""

    method: str = "auto"


@dataclass(frozen=True, slots=True)
class StopMend:
    """End the mending that runs; all clips are as they were."""


@dataclass(frozen=True, slots=True)
class CompareMended:
    """Show an earlier version of a mended clip next to the present one, or stop that."""


@dataclass(frozen=True, slots=True)
class RevertMend:
    """Bring back the clips from before the mending."""


@dataclass(frozen=True, slots=True)
class CloseMend:
    """Keep the result and close the page. A mending that runs is ended."""


MendCommand = AskMend | StartMend | StopMend | CompareMended | RevertMend | CloseMend
"""Commands about a seam or a stretch with flicker."""
