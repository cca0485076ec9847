"""Lists of numbers in few words, however long they are."""

from __future__ import annotations

from collections.abc import Sequence

MAX_SPANS = 20
"""Runs that are written out; of more, the others are counted."""


def spans_text(numbers: Sequence[int]) -> str:
    """As "0, 1, 3 to 7", and how many more numbers there are after MAX_SPANS runs. numbers: Rising."""
    spans: list[tuple[int, int]] = []
    for number in numbers:
        if spans and number == spans[-1][1] + 1:
            spans[-1] = spans[-1][0], number
        else:
            spans.append((number, number))
    said = ", ".join(
        f"{first} to {last}" if last > first + 1 else ", ".join(map(str, range(first, last + 1)))
        for first, last in spans[:MAX_SPANS]
    )
    n_more = sum(last - first + 1 for first, last in spans[MAX_SPANS:])
    return f"{said} and {n_more} more" if n_more else said
