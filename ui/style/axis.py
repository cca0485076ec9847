"""Where the numbers of a plot's axis stand: as people count, none of them outside the plot."""

from __future__ import annotations

import math


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


def round_ticks(low: float, high: float, most: int, *, least: float = 0.0) -> list[float]:
    """Values on an axis: multiples of 1, 2 or 5 times a power of ten.

    Args:
        low, high: Ends of the axis.
        most: At most this many, at least one.
        least: No finer than this, as 1 for counts.
    """
    span = high - low
    if not math.isfinite(span) or span <= 0:
        return [low]
    power = math.floor(math.log10(max(span / max(most, 1), least))) - 1
    while True:  # ends: with a step of more than the span there is one value at most
        for factor in (1, 2, 5):
            step = factor * 10.0**power
            first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
            if step >= least * (1 - 1e-9) and last - first < max(most, 1):
                return [number * step for number in range(first, last + 1)]
        power += 1


def log_ticks(low: float, high: float, most: int) -> list[float]:
    """Values on a logarithmic axis: powers of ten, with 2 and 5 times them where there is room; both ends positive."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for factors in ((1, 2, 3, 4, 5, 6, 8), (1, 2, 5), (1, 3), (1,)):
        ticks = [factor * 10.0**power for power in powers for factor in factors]
        ticks = [tick for tick in ticks if low <= tick <= high]
        if len(ticks) <= most:
            return ticks or [math.sqrt(low * high)]
    decades = [10.0**power for power in powers if low <= 10.0**power <= high]
    return decades[:: math.ceil(len(decades) / max(most, 1))]


def tick_text(value: float, step: float) -> str:
    """A value on an axis, with as many decimals as neighbours `step` apart need and separators of thousands."""
    if value == 0:
        return "0"
    if not 1e-4 <= abs(value) < 1e7:
        return f"{value:.0e}"
    decimals = max(-math.floor(math.log10(step) + 1e-9), 0) if step > 0 else 0
    return f"{value:,.{decimals}f}"
