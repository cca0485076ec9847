"""Attention: whether the user has just looked elsewhere, so that cores are for the shown picture."""

from __future__ import annotations

import time

LASTS_S = 2.0
"""For this long after the view or the playhead has moved."""


class Attention:
    """Follows the view and the playhead. For one thread."""

    def __init__(self) -> None:
        self._looked_at: object = None
        self._moved_s = -LASTS_S

    def follow(self, looked_at: object) -> bool:
        """Whether that has changed a moment ago. looked_at: Equal while it is the same."""
        now_s = time.monotonic()
        if looked_at != self._looked_at:
            self._looked_at, self._moved_s = looked_at, now_s
        return now_s - self._moved_s < LASTS_S
