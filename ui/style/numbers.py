"""Numbers as they are written everywhere in the window."""

import math


def format_count(number: int) -> str:
    """A count with thousands apart: 4,320."""
    return f"{number:,}"


def number_format(value: float, finest: float = 1e-8) -> str:
    """How an input field writes a number: in three digits, but none below `finest`; never with an exponent."""
    if value == 0 or not math.isfinite(value):
        return "%.3g"
    n_places = 2 - math.floor(math.log10(abs(value)))
    return f"%.{max(0, min(n_places, math.ceil(-math.log10(finest))))}f"


def parsed_count(text: str) -> int | None:
    """The inverse: a whole number as somebody types it, with or without signs between thousands; None for others."""
    try:
        return int(text.replace(",", "").replace(" ", ""))
    except ValueError:
        return None
