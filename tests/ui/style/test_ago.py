"""Moments in words."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

import pytest

from ui.style.ago import ago_text

NOW = datetime(2026, 11, 22, 18, 0, tzinfo=UTC)


@pytest.mark.parametrize(
    ("then", "words"),
    [
        ("2026-11-22T14:05:09+00:00", "today, 14:05"),
        ("2026-11-22T14:05:09", "today, 14:05"),
        ("2026-11-21T23:59:00+00:00", "yesterday"),
        ("2026-11-19T10:00:00+00:00", "3 days ago"),
        ("2026-03-02T10:00:00+00:00", "2 March 2026"),
        ("2026-11-25T10:00:00+00:00", "today, 10:00"),  # a clock that went wrong
        ("", ""),
        ("lately", ""),
        ("9999-12-31T23:59:59-23:59", ""),
    ],
)
def test_moments_are_said_as_people_do(then: str, words: str) -> None:
    assert ago_text(then, NOW, UTC) == words


def test_days_begin_where_the_computer_is() -> None:
    east = timezone(timedelta(hours=9))
    assert ago_text("2026-11-22T14:30:00+00:00", NOW, UTC) == "today, 14:30"
    assert ago_text("2026-11-22T14:30:00+00:00", NOW, east) == "yesterday", "it is past midnight there"
