"""Commands that mark where the scene is static or moves."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MarkRegion:
    """Mark a sphere in which everything counts as static or dynamic, in clips whose training starts from now on."""

    treat: str
    """"static" or "dynamic"."""
    center: tuple[float, float, float]
    """Scene units."""
    radius: float
    """Scene units."""


@dataclass(frozen=True, slots=True)
class MarkBox:
    """Mark a box along the axes of the scene as MarkRegion marks a sphere."""

    treat: str
    low: tuple[float, float, float]
    """Scene units."""
    high: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class RemoveRegion:
    """Forget the marked region at this position of the list."""

    index: int


MarkCommand = MarkRegion | MarkBox | RemoveRegion
"""Commands that change the marked regions and can be undone."""
