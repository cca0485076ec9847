"""A slider whose value stands next to it, where the knob never covers it."""

from __future__ import annotations

from imgui_bundle import imgui


def slider(
    label: str, value: float, low: float, high: float, words: str, flags: int = imgui.SliderFlags_.always_clamp
) -> tuple[bool, float]:
    """A slider; label and value follow it. Its width is that of the next item, without them.

    Args:
        label: Name of its setting; may be empty before "##" where that is shown elsewhere.
        words: The value in words, such as "%.1f anchors".
        flags: See imgui.SliderFlags_.
    Returns:
        Whether it was moved, and the value.
    """
    return imgui.slider_float(f"{slider_text(label, value, words)}###{label}", value, low, high, "", flags)


def slider_text(label: str, value: float, words: str) -> str:
    """Text after a slider."""
    return "  ".join(filter(None, (label.partition("##")[0], words % value)))
