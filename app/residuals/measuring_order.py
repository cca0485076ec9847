"""The order of measuring: the clip and camera that the user looks at, then the held-out cameras of all clips, which
show the seams, then everything else; the nearest clips first.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

Item = tuple[int, int]
"""clip_index and camera_index: one camera's pictures of one clip."""


@dataclass(frozen=True, slots=True)
class MeasuringFocus:
    """The clip and camera that the user looks at.

    Attributes:
        clip_index: Under the playhead.
        camera_index: Looked through; None for a free view.
    """

    clip_index: int = 0
    camera_index: int | None = None


def first_item(items: Iterable[Item], look: MeasuringFocus, holdout: Collection[int]) -> Item | None:
    """The item to measure first; None without items.

    Args:
        items: Those not measured yet.
        holdout: Held-out cameras.
    """
    return min(items, key=lambda item: _rank(item, look, holdout), default=None)


def _rank(item: Item, look: MeasuringFocus, holdout: Collection[int]) -> tuple[int, int, int, int, int]:
    clip_index, camera_index = item
    distance = abs(clip_index - look.clip_index)
    group = 0 if camera_index == look.camera_index else 1 if camera_index in holdout else 2
    is_late = group == 2
    return int(is_late), distance, group, camera_index, clip_index
