"""What the published method says and what differs here, as tables, from their declaration."""

from __future__ import annotations

from engine.setting import value_text
from engine.training.published.point import Point
from engine.training.published.points import POINTS
from tests.documents.table import table


def differences_table() -> str:
    """A row per point that the paper or the released code has otherwise."""
    rows = [
        (f"**{p.name}**", p.paper, p.released, p.here, p.follows, p.reason, _settings(p)) for p in POINTS if p.reason
    ]
    return table(("what", "paper", "released code", "here", "follows", "why", "settings"), rows)


def published_table() -> str:
    """A row per point that is as published."""
    rows = [(f"**{p.name}**", p.paper, p.released, p.follows, _settings(p)) for p in POINTS if not p.is_difference]
    return table(("what", "paper", "released code", "follows", "settings"), rows)


def _settings(point: Point) -> str:
    return ", ".join(f"`{name}={value_text(value)}`" for name, value in point.settings.items())
