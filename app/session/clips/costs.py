"""Expected times for training clips, from those of the project's trained clips."""

from __future__ import annotations

from collections.abc import Sequence

from app.project.clips.clip_catalog import ClipCatalog
from engine.capture.clip import Clip


def expected_seconds(
    catalog: ClipCatalog, clips: Sequence[Clip], n_frames: Sequence[int], *, n_references: int = 0
) -> float | None:
    """Seconds of training clips of these lengths, one after the other.

    Args:
        catalog, clips: Of the project as it is; give the time per frame.
        n_frames: Of each clip that would be trained.
        n_references: How many of them, at the beginning, inherit nothing.
    Returns:
        None where nothing was recorded.
    """
    reference = catalog.order[0] if catalog.order else 0
    rates: dict[bool, list[float]] = {True: [], False: []}
    for index in range(min(len(catalog), len(clips))):
        seconds = catalog[index].seconds
        if seconds is not None and clips[index].n_frames:
            rates[index == reference].append(seconds / clips[index].n_frames)
    means = {kind: sum(found) / len(found) for kind, found in rates.items() if found}
    if not means:
        return None
    known = next(iter(means.values()))  # of the other kind where there is none of this one
    return sum(n * means.get(place < n_references, known) for place, n in enumerate(n_frames))
