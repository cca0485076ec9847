"""Why an anchor is static or dynamic: the codes of the gate and their words. Plain values, for whoever shows them."""

from __future__ import annotations

STILL, CHANGES, LIGHT, ONE_VIEW, UNSEEN, NEAR_MOTION = range(6)
USER_STATIC, USER_DYNAMIC, LEARNED_NOTHING, ALONE, INSIDE = range(6, 11)
REASONS = (
    "still",
    "changes in several views",
    "lamp or shadow: only the brightness changes",
    "changes in too few of the views that see it",
    "seen unhidden by fewer than two views",
    "something moves here, which has anchors of its own",
    "marked as static",
    "marked as dynamic",
    "had a dynamic feature and learned no change",
    "changes, but nothing beside it does",
    "something else is seen in its place from all sides",
)
"""In words, by code."""
NO_REASON = 255
"""Of an anchor about which the gate was not asked: those of hulls, and clips trained without a look at the pictures."""


def reason_text(code: int) -> str:
    """The words of a code, empty for NO_REASON and for codes of later versions."""
    return REASONS[code] if 0 <= code < len(REASONS) else ""
