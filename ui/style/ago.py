"""How long ago something was, in words."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, tzinfo


def ago_text(then: str, now: datetime, zone: tzinfo | None = None) -> str:
    """A moment as people say it: "today, 14:05", "yesterday", "3 days ago", "12 March 2026"; empty where unknown.

    Args:
        then: ISO 8601; without a zone it counts as UTC.
        now: With its zone.
        zone: In which days begin; that of this computer when None.
    """
    try:
        moment = datetime.fromisoformat(then)
        moment = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).astimezone(zone)
        here = now.astimezone(zone)
    except (ValueError, OverflowError, OSError):
        return ""
    n_days = (here.date() - moment.date()) // timedelta(days=1)
    if n_days <= 0:
        return f"today, {moment:%H:%M}"
    if n_days == 1:
        return "yesterday"
    return f"{n_days} days ago" if n_days < 14 else f"{moment.day} {moment:%B %Y}"
