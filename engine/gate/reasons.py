"""Why an anchor is static or dynamic: the codes of the gate and their words. Plain values, for whoever shows them."""

from __future__ import annotations

REASONS = (
    "still",
    "changes in several views",
    "lamp or shadow: only the brightness changes",
    "changes in too few of the views that see it",
    "seen unoccluded by fewer than two views",
    "moving content with its own anchors is here",
    "marked as static",
    "marked as dynamic",
    "had a dynamic feature but learned no change",
    "changes, but its neighbours do not",
    "something else is seen in its place",
)
"""In words, by code. Clips that are trained today have the three codes below; the others stand in clips of projects
whose gate also looked at the pictures."""
STILL, USER_STATIC, USER_DYNAMIC = 0, 6, 7
NO_REASON = 255
"""Of an anchor about which the gate was not asked: those of hulls, and clips without a marked region."""


def reason_text(code: int) -> str:
    """The words of a code, empty for NO_REASON and for codes of later versions."""
    return REASONS[code] if 0 <= code < len(REASONS) else ""
