"""How the height of the timeline is shared: which rows there are, and which give way where there is not room for all.

Arithmetic only. From top to bottom: overview, ruler, clips, seams, quality, cache, camera, objects, volumes, take,
markers. Ruler and clips are always there, the keys of the camera where there is a camera path, objects where there are
some, the keys of a volume while its edit is chosen, and the take where it is edited in time. In a low panel quality
gives way first, then markers, cache, take, volumes, camera, objects, seams and the overview, last the transport row.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

OVERVIEW, RULER, CLIPS, SEAMS, QUALITY, CACHE, CAMERA, OBJECTS, VOLUMES, TAKE, MARKERS = (
    "overview",
    "ruler",
    "clips",
    "seams",
    "quality",
    "cache",
    "camera",
    "objects",
    "volumes",
    "take",
    "markers",
)
LANES = (SEAMS, QUALITY, CACHE, CAMERA, OBJECTS, VOLUMES, TAKE, MARKERS)
"""Those that can be folded away."""
ORDER = (OVERVIEW, RULER, CLIPS, SEAMS, QUALITY, CACHE, CAMERA, OBJECTS, VOLUMES, TAKE, MARKERS)
KEPT_FIRST = (OVERVIEW, SEAMS, OBJECTS, CAMERA, VOLUMES, TAKE, CACHE, MARKERS, QUALITY)
HEIGHTS = {OVERVIEW: 16.0, RULER: 22.0, CLIPS: 32.0, SEAMS: 18.0, QUALITY: 30.0, CACHE: 12.0}
OBJECT_HEIGHT, MAX_OBJECT_ROWS = 17.0, 4
"""Of one object; of more than so many, the others are scrolled to."""
HEIGHTS |= {CAMERA: 18.0, OBJECTS: OBJECT_HEIGHT, VOLUMES: 18.0, TAKE: 18.0, MARKERS: 18.0}
"""Smallest ones, units of the screen."""
MIN_CLIPS_HEIGHT = 18.0
LARGEST = {CLIPS: 54.0, TAKE: 36.0, QUALITY: 90.0}
GAP = 2.0
MIN_TRACK_HEIGHT = HEIGHTS[RULER] + MIN_CLIPS_HEIGHT
"""Below, the transport row gives way."""


@dataclass(frozen=True, slots=True)
class Row:
    """Where a row lies, from the top of the track."""

    name: str
    top: float
    height: float


def arrange_rows(height: float, folded: Collection[str], *, is_zoomed: bool, n_objects: int = 0) -> tuple[Row, ...]:
    """Rows from top to bottom in a height.

    Args:
        folded: Lanes that are folded away.
        is_zoomed: Whether there is more than is shown, so that an overview helps.
        n_objects: Objects of the project; without any, their lane is away.
    """
    heights = {RULER: HEIGHTS[RULER], CLIPS: max(min(HEIGHTS[CLIPS], height - HEIGHTS[RULER]), MIN_CLIPS_HEIGHT)}
    left = height - sum(heights.values())
    smallest = HEIGHTS | {OBJECTS: OBJECT_HEIGHT * min(n_objects, MAX_OBJECT_ROWS)}
    folded = folded if n_objects else {*folded, OBJECTS}
    for name in KEPT_FIRST:
        is_wanted = is_zoomed if name == OVERVIEW else name not in folded
        if is_wanted and smallest[name] + GAP > left:
            break  # a lower one that comes later would fit, and be there without the one that matters more
        if is_wanted:
            heights[name] = smallest[name]
            left -= smallest[name] + GAP
    for name, largest in LARGEST.items():
        if name in heights and left > 0:
            grown = min(left, max(largest - heights[name], 0.0))
            heights[name] += grown
            left -= grown
    rows, top = [], 0.0
    for name in ORDER:
        if name in heights:
            rows.append(Row(name, top, heights[name]))
            top += heights[name] + (0.0 if name == RULER else GAP)
    return tuple(rows)
