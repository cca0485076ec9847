"""Stretch: the frames that are mended, and what lies on either side of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from engine.capture.clip import Clip
from engine.errors import ProjectError

FADE_FRAMES = 4
"""Frames on each side of a boundary over which a jump is spread. A clip of ten frames has two boundaries."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """Frames of one clip, or of two neighbouring ones, between which something jumps or flickers. A value.

    Attributes:
        first, stop: Frames that may change, `stop` not among them. Those just before and behind stay as they are.
        pairs: Later frames of the pairs that are to be mended: the boundary, or all of the stretch.
        clip_indices: Clips that hold frames of it, rising; at most two.
    """

    first: int
    stop: int
    pairs: tuple[int, ...]
    clip_indices: tuple[int, ...]

    @property
    def words(self) -> str:
        """The mended clips or boundary, for a sentence."""
        if len(self.pairs) == 1:
            return f"the seam at frame {self.pairs[0]}"
        return f"frames {self.pairs[0] - 1} to {self.pairs[-1]}"

    def frames_in(self, clip: Clip) -> range:
        """Frames of a clip that may change."""
        return range(max(self.first, clip.start), min(self.stop, clip.stop))


def boundary_stretch(clips: Sequence[Clip], after: int) -> Stretch:
    """The frames around the start of a clip.

    Args:
        clips: All of the capture.
        after: The clip that begins there.
    Raises:
        ProjectError: No clip begins there behind another one.
    """
    if not 0 < after < len(clips):
        raise ProjectError(
            f"Clip {after} has no boundary before it.",
            hint=f"Boundaries lie before clips 1 to {len(clips) - 1}." if len(clips) > 1 else "There is one clip only.",
        )
    before, clip = clips[after - 1], clips[after]
    n_before, n_after = (min(FADE_FRAMES, max(1, one.n_frames // 2)) for one in (before, clip))
    return Stretch(clip.start - n_before, clip.start + n_after, (clip.start,), (after - 1, after))


def frames_stretch(clips: Sequence[Clip], first: int, stop: int) -> Stretch:
    """Some frames that flicker.

    Args:
        clips: All of the capture.
        first, stop: Capture frames, `stop` not among them.
    Raises:
        ProjectError: They are none, fewer than two, outside of the capture, or of more than two clips.
    """
    n_frames = clips[-1].stop
    if not 0 <= first < stop <= n_frames or stop - first < 2:
        raise ProjectError(
            f"Frames {first} to {stop} cannot be mended: the capture has frames 0 to {n_frames - 1}.",
            hint="Choose two frames or more.",
        )
    indices = tuple(i for i, clip in enumerate(clips) if clip.start < stop and first < clip.stop)
    if len(indices) > 2:
        raise ProjectError(
            f"Frames {first} to {stop - 1} lie in {len(indices)} clips.", hint="Choose frames of one or two clips."
        )
    return Stretch(first, stop, tuple(range(first + 1, stop)), indices)
