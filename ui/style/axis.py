"""Where the numbers of a plot's axis stand: whole steps, as people count, none of them outside the plot."""

from __future__ import annotations


def whole_ticks(last: float, most: int) -> list[int]:
    """Steps at which an axis from 0 to `last` gets a number: multiples of 1, 2 or 5 times a power of ten.

    Args:
        last: End of the axis.
        most: At most this many numbers, at least one.
    """
    end = max(int(last), 1)
    power = 1
    while True:
        for factor in (1, 2, 5):
            if end // (factor * power) < max(most, 1):
                return list(range(0, end + 1, factor * power))
        power *= 10


def ticks_that_fit(last: float, width: float, half_width_of: dict[int, float], ticks: list[int]) -> list[int]:
    """Without those whose number, centred on its place, would stand out over the right edge.

    Args:
        last: End of the axis.
        width: Of the plot, units.
        half_width_of: Half the width of each number, units.
    """
    return [tick for tick in ticks if (1.0 - tick / max(last, 1.0)) * width + 4.0 >= half_width_of[tick]]
