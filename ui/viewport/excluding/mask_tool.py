"""MaskTool: the brush that paints what training does not look at, over the picture of one camera."""

from __future__ import annotations

from dataclasses import dataclass, field

from app.session.exclusions.exclusion_commands import PaintMask
from engine.capture.clip import Clip
from engine.capture.exclusions import Stroke

SCOPES = {"all": "all frames", "clip": "the clip", "frame": "this frame"}
"""Which frames of a camera are painted at once, in words."""
SMALLEST, LARGEST = 0.004, 0.25
"""Radius of the brush, shares of the picture's width."""
GROWTH = 1.15
LEAST_STEP = 0.002
"""Points of a stroke closer to each other than this are one, shares of the picture's width."""


@dataclass
class MaskTool:
    """State of the brush.

    Attributes:
        camera_index: The camera whose pictures are painted; None while nothing is.
        scope: One of SCOPES.
        radius: Share of the picture's width.
        points: Of the stroke in progress, shares of width and height.
        is_erasing: Whether that takes away.
    """

    camera_index: int | None = None
    scope: str = "all"
    radius: float = 0.03
    points: list[tuple[float, float]] = field(default_factory=list)
    is_erasing: bool = False

    @property
    def is_active(self) -> bool:
        """Is something being painted?"""
        return self.camera_index is not None

    def start(self, camera_index: int, scope: str) -> None:
        """Take the brush."""
        if scope not in SCOPES:
            raise ValueError(f"scopes are {', '.join(SCOPES)}, not {scope!r}")
        self.camera_index, self.scope, self.points = camera_index, scope, []

    def stop(self) -> None:
        """Lay it down; a stroke in progress is forgotten."""
        self.camera_index, self.points = None, []

    def resize(self, steps: float) -> None:
        """A larger brush, or a smaller one."""
        self.radius = min(max(self.radius * GROWTH**steps, SMALLEST), LARGEST)

    def extend(self, x: float, y: float) -> None:
        """The stroke continues to here, in shares; slightly outside is allowed."""
        x, y = min(max(x, -0.5), 1.5), min(max(y, -0.5), 1.5)
        if not self.points or max(abs(self.points[-1][0] - x), abs(self.points[-1][1] - y)) >= LEAST_STEP:
            self.points.append((round(x, 5), round(y, 5)))

    def take_stroke(self, frame_index: int, clip: Clip | None, n_frames: int) -> PaintMask | None:
        """The finished stroke as a command; None where there is none.

        Args:
            frame_index, clip: Of the playhead.
            n_frames: Of the capture.
        """
        points, self.points = tuple(self.points), []
        if self.camera_index is None or not points:
            return None
        first, stop = 0, n_frames
        if self.scope == "frame":
            first, stop = frame_index, frame_index + 1
        elif self.scope == "clip" and clip is not None:
            first, stop = clip.start, clip.stop
        return PaintMask(self.camera_index, first, stop, Stroke(points, round(self.radius, 5), self.is_erasing))
