"""Which version of a clip is compared with what it is now, and which comes next."""

from __future__ import annotations

from collections.abc import Sequence

from app.status import Overlays, VersionStatus, version_number


def compared_version(overlays: Overlays) -> int | None:
    """The version that the picture is compared with; None where none is."""
    return None if overlays.compare == "off" else version_number(overlays.compare_with)


def next_version(versions: Sequence[VersionStatus], shown: int | None) -> int | None:
    """The version to show after this one, from the newest to the oldest; None after the last, and without any."""
    numbers = [version.number for version in versions]
    if shown not in numbers:
        return numbers[0] if numbers else None
    place = numbers.index(shown) + 1
    return numbers[place] if place < len(numbers) else None
