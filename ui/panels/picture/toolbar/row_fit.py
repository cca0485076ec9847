"""The part of a row of widgets that fits its width: how wide each is, and which go into a menu at its end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class RowFit:
    """Contents of a row.

    Attributes:
        style: Number of the style of which everything is; 0 is the roomiest.
        widths: Of the widgets in the row by name, units.
        hidden: Names of the others, in the order of the row.
    """

    style: int
    widths: dict[str, float]
    hidden: tuple[str, ...] = ()


def fit_row(
    styles: Sequence[Mapping[str, float]], room: float, *, gap: float, menu: float, can_hide: Sequence[str]
) -> RowFit:
    """Choose the first style in which everything fits; in the last one what can be hidden goes, one after the other.

    Args:
        styles: Least widths of the widgets by name, the roomiest style first, units.
        room: Of the row, units.
        gap: Between two widgets.
        menu: Width of the button that shows what is hidden.
        can_hide: Widgets that can be hidden, those missed least first.
    """
    for number, widths in enumerate(styles):
        if _total(widths, gap) <= room:
            return RowFit(number, dict(widths))
    shown, hidden = dict(styles[-1]), set[str]()
    for name in can_hide:
        if _total(shown, gap) + gap + menu <= room and hidden:
            break
        del shown[name]
        hidden.add(name)
    in_order = tuple(name for name in styles[-1] if name in hidden)
    return RowFit(len(styles) - 1, shown, in_order)


def _total(widths: Mapping[str, float], gap: float) -> float:
    return sum(widths.values()) + gap * max(len(widths) - 1, 0)
