"""AnchorMotion: how anchors travel with what they are on, while a clip lasts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from torch import Tensor


@dataclass(frozen=True, slots=True)
class AnchorMotion:
    """Motion of the anchors of one set. Positions are those at the frame of birth.

    Attributes:
        birth_frames: Frames of the clip at which anchors are at their positions. [A] float32
        velocities: Scene units a frame. [A, 3]
        accelerations: Scene units a frame, squared; twice this is what physics calls by that name. [A, 3]
    """

    birth_frames: Tensor
    velocities: Tensor
    accelerations: Tensor

    def map(self, change: Callable[[Tensor], Tensor]) -> AnchorMotion:
        """The same change to each of the three."""
        return AnchorMotion(change(self.birth_frames), change(self.velocities), change(self.accelerations))

    def away(self, frame: float) -> Tensor:
        """How far anchors are from their positions at a frame of the clip, or between two. Scene units. [A, 3]"""
        since = (frame - self.birth_frames)[:, None]
        return since * (self.velocities + since * self.accelerations)
