"""The figures of a stretch before and after it was mended. Free of torch: a window imports it."""

from __future__ import annotations

import msgspec

MAX_PSNR_LOSS_DB = 0.05
"""A clip may lose so much on its training cameras, and no more."""
ENOUGH = 0.5
"""Share of the excess flicker that may be left: then nothing else is tried."""
_NOTICEABLE = 0.02
"""Share of the excess by which it has to fall for an attempt to be kept."""
_NEXT_DOOR = 0.1, 0.02
"""By how much of itself, and by how many 1/255, the worst pair elsewhere in the clips may rise."""


class StretchFigures(msgspec.Struct, frozen=True):
    """Figures of a stretch. Changes of static pixels in 1/255, PSNR in dB; None where there is nothing to measure.

    Attributes:
        excess: E on static pixels of the pairs that are to be mended, less the median of the other pairs inside the
            clips: at a boundary the seam score of `eval`. Mean over the training cameras.
        worst: The largest E on static pixels among all pairs of the stretch, mean over the training cameras.
        elsewhere: Likewise among the other pairs of the clips, boundaries to the neighbouring clips included.
        psnr: On the training cameras, by clip index as text: files know no other names.
        held_out_excess, held_out_psnr: The same of the cameras that were held out: reported, and never decided by.
    """

    excess: float | None
    worst: float | None
    elsewhere: float | None
    psnr: dict[str, float]
    held_out_excess: float | None = None
    held_out_psnr: dict[str, float] = {}

    def is_better_than(self, other: StretchFigures, original: StretchFigures) -> bool:
        """Whether an attempt is kept: less excess than the best before it, not bought with anything else.

        Args:
            other: The best so far.
            original: Before anything was done; clips may not lose against that.
        """
        if self.excess is None or other.excess is None or self.worst is None or other.worst is None:
            return False
        if self.excess > other.excess - _NOTICEABLE * abs(original.excess or 0.0) or self.worst > other.worst:
            return False
        return self.holds(original)

    def holds(self, original: StretchFigures) -> bool:
        """Whether no clip has lost PSNR, and nothing flickers elsewhere that did not."""
        if any(self.psnr[i] < original.psnr[i] - MAX_PSNR_LOSS_DB for i in original.psnr):
            return False
        if self.elsewhere is None or original.elsewhere is None:
            return True
        share, least = _NEXT_DOOR
        return self.elsewhere <= original.elsewhere * (1.0 + share) + least

    def is_enough(self, original: StretchFigures) -> bool:
        """Whether so little is left that nothing else has to be tried."""
        if self.excess is None or original.excess is None:
            return True
        return self.excess <= ENOUGH * max(original.excess, 0.0)


class Attempt(msgspec.Struct, frozen=True):
    """One thing that was tried.

    Attributes:
        method: One of METHODS.
        words: The attempt, as a sentence without its full stop.
        figures: The result.
        is_kept: Whether it is part of the result.
        seconds: The time it took.
    """

    method: str
    words: str
    figures: StretchFigures
    is_kept: bool
    seconds: float


METHODS = {
    "light": "camera exposure and the light on static parts are measured again",
    "fade": "dynamic features are faded from one clip into the other",
    "joint": "the frames around it are briefly trained towards each other",
}
"""Ways to mend and their effects, cheapest first."""
CHOICES = ("auto", *METHODS, "retrain")
