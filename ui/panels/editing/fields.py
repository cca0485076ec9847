"""Numeric fields of an edit: a drag or an input in one of them is one step of the history."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from imgui_bundle import imgui

from engine.camera.rotations import quats_of_turns, turns_of_quats
from engine.editing.actions import Quat
from ui.panels.state import UiState

LABEL_WIDTH = 86.0


def label_before(label: str) -> None:
    """Words at the left, and the rest of the line for what follows."""
    imgui.align_text_to_frame_padding()
    imgui.text_disabled(label)
    imgui.same_line(LABEL_WIDTH)
    imgui.set_next_item_width(-1)


def numbers(
    ui: UiState,
    name: str,
    label: str,
    values: Sequence[float],
    *,
    speed: float,
    low: float,
    high: float,
    text_format: str = "%.3f",
) -> tuple[float, ...] | None:
    """One or three numbers side by side. The new ones, once they were changed. name: In ui.rects."""
    label_before(label)
    flags = imgui.SliderFlags_.always_clamp
    if len(values) == 1:
        is_changed, one = imgui.drag_float(f"##{name}", values[0], speed, low, high, text_format, flags)
        found = (one,)
    else:
        is_changed, several = imgui.drag_float3(f"##{name}", list(values), speed, low, high, text_format, flags)
        found = tuple(several)
    ui.mark(f"edits.{name}")
    if imgui.is_item_activated():
        ui.editing.begin_gesture()
    if not is_changed or not all(math.isfinite(value) for value in found):
        return None
    return tuple(min(max(value, low), high) for value in found)


def whole_numbers(
    ui: UiState, name: str, label: str, values: Sequence[int], *, low: int, high: int
) -> tuple[int, ...] | None:
    """One or two whole numbers side by side; otherwise as `numbers`."""
    label_before(label)
    flags = imgui.SliderFlags_.always_clamp
    if len(values) == 1:
        is_changed, one = imgui.drag_int(f"##{name}", values[0], 0.2, low, high, "%d", flags)
        found = (one,)
    else:
        is_changed, several = imgui.drag_int2(f"##{name}", list(values), 0.2, low, high, "%d", flags)
        found = tuple(several)
    ui.mark(f"edits.{name}")
    if imgui.is_item_activated():
        ui.editing.begin_gesture()
    return tuple(min(max(value, low), high) for value in found) if is_changed else None


def turn_fields(ui: UiState, name: str, quat: Quat, label: str = "Rotation") -> Quat | None:
    """A rotation as degrees about the axes of the scene."""
    degrees = tuple(float(value) for value in np.degrees(turns_of_quats(np.array(quat))))
    found = numbers(ui, name, label, degrees, speed=0.25, low=-180.0, high=180.0, text_format="%.1f°")
    if found is None:
        return None
    w, x, y, z = (float(value) for value in quats_of_turns(np.radians(found)))
    return w, x, y, z
