"""Numbers as they are written everywhere in the window."""

import math


def format_count(number: int) -> str:
    """A count with thousands apart: 4,320."""
    return f"{number:,}"


def number_format(value: float) -> str:
    """How an input field writes a number: in three digits, or eight places after the point; never with an exponent."""
    if value == 0 or not math.isfinite(value):
        return "%.3g"
    return f"%.{min(max(0, 2 - math.floor(math.log10(abs(value)))), 8)}f"


def parsed_count(text: str) -> int | None:
    """The inverse: a whole number as somebody types it, with or without signs between thousands; None for others."""
    try:
        return int(text.replace(",", "").replace(" ", ""))
    except ValueError:
        return None
