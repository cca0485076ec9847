"""Finding: one result of a check of a capture, with its evidence and its remedy."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import msgspec

from engine.capture.writers.capture_json import Corrections

Severity = Literal["error", "warning", "note"]
"""error: training on it is wasted; warning: costs quality, better corrected first; note: worth knowing."""
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")
Point = tuple[float, float]
"""A place in a picture as shares of its width and height, so that it holds at every size."""


class PictureEvidence(msgspec.Struct, frozen=True, tag=True):
    """A picture to look at.

    Attributes:
        camera: Name.
        frame: Capture frame index.
        caption: A description of the picture.
    """

    camera: str
    frame: int
    caption: str = ""


class PairEvidence(msgspec.Struct, frozen=True, tag=True):
    """Two cameras and what both see: where it is in each, and the line on which it ought to be in the second.

    Attributes:
        camera, other: Names.
        frame: Capture frame index to show.
        caption: A description of the pictures.
        points, other_points: Matches.
        lines: For each point the ends of its epipolar line across the second picture.
        errors_px: Distance of each match from its line, px of the picture that was matched.
    """

    camera: str
    other: str
    frame: int
    caption: str = ""
    points: tuple[Point, ...] = ()
    other_points: tuple[Point, ...] = ()
    lines: tuple[tuple[Point, Point], ...] = ()
    errors_px: tuple[float, ...] = ()


Evidence = PictureEvidence | PairEvidence


@dataclass(frozen=True, slots=True)
class Finding:
    """The finding of a check.

    Attributes:
        kind: Which kind of thing, as "frozen"; see the files of engine.doctor.checks.
        severity: How bad it is.
        cameras: Names of those concerned; empty for the whole capture.
        frames: Capture frame indices concerned; empty for all.
        text: The finding: one sentence with numbers.
        certainty: 0 to 1: how likely it is true.
        advice: The remedy.
        fix: The correction that does it; None where capture.json cannot.
        evidence: The pictures to look at.
    """

    kind: str
    severity: Severity
    cameras: tuple[str, ...]
    frames: tuple[int, ...]
    text: str
    certainty: float
    advice: str
    fix: Corrections | None = None
    evidence: tuple[Evidence, ...] = field(default=())

    @property
    def certainty_word(self) -> str:
        """The certainty in words."""
        steps = ((0.95, "certain"), (0.8, "very likely"), (0.6, "likely"), (0.35, "possible"))
        return next((word for least, word in steps if self.certainty >= least), "a guess")


def in_order(findings: list[Finding]) -> list[Finding]:
    """The worst and most certain first; otherwise as they were found."""
    return sorted(findings, key=lambda finding: (SEVERITIES.index(finding.severity), -finding.certainty))
