"""Heat maps as values: the kinds there are, and one map of one picture."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from engine.metrics.clips.seams import MAP_RANGE

LEVELS = 255.0
"""Differences of colours are shown in levels of a display: 1 level is 1/255."""
LEVEL_UNIT = "1/255"


@dataclass(frozen=True, slots=True)
class HeatKind:
    """A kind of heat map.

    Attributes:
        name: Key of HEAT_KINDS.
        label: As shown to the user.
        unit: Of the values; "1" for a number without unit.
        color_map: "sequential" from nothing to much, or "signed" around zero.
        value_range: Default range of the colours: one for all frames and cameras, so that the colours themselves do not
            flicker.
        meaning: One sentence.
    """

    name: str
    label: str
    unit: str
    color_map: Literal["sequential", "signed"]
    value_range: tuple[float, float]
    meaning: str


_CHANGE_RANGE = (MAP_RANGE[0] * LEVELS, MAP_RANGE[1] * LEVELS)
"""That of the report's maps."""
_ERROR_RANGE = 51.0
"""A fifth of a display's range: larger errors need no distinction. 20 dB is an error of about 25."""


def _kinds() -> dict[str, HeatKind]:
    kinds = (
        HeatKind(
            "R",
            "R: change of the render",
            LEVEL_UNIT,
            "sequential",
            _CHANGE_RANGE,
            "How much the render differs from the previous frame, mean of the channels.",
        ),
        HeatKind(
            "G",
            "G: change of the capture",
            LEVEL_UNIT,
            "sequential",
            _CHANGE_RANGE,
            "How much the captured picture differs from the previous frame, mean of the channels.",
        ),
        HeatKind(
            "E",
            "E: excess flicker",
            LEVEL_UNIT,
            "sequential",
            _CHANGE_RANGE,
            "Change of the render beyond that of the captured picture: R minus G where positive.",
        ),
        HeatKind(
            "error",
            "Error",
            LEVEL_UNIT,
            "sequential",
            (0.0, _ERROR_RANGE),
            "How far the render is from the captured picture, mean of the channels.",
        ),
        HeatKind(
            "luminance",
            "Luminance error",
            LEVEL_UNIT,
            "signed",
            (-_ERROR_RANGE, _ERROR_RANGE),
            "Luminance of the render minus that of the captured picture; positive where the render is too bright.",
        ),
        HeatKind(
            "flip",
            "FLIP",
            "1",
            "sequential",
            (0.0, 0.5),
            "What a viewer notices when render and captured picture alternate, from 0 to 1.",
        ),
        HeatKind(
            "clips",
            "Two clips at one instant",
            LEVEL_UNIT,
            "sequential",
            _CHANGE_RANGE,
            "How far two neighbouring clips differ at the same instant, at the frames where they meet.",
        ),
    )
    return {kind.name: kind for kind in kinds}


HEAT_KINDS = _kinds()
"""Every kind by name, in the order in which they are offered."""


@dataclass(frozen=True, slots=True, eq=False)
class HeatMap:
    """One picture's map, or why there is none.

    Attributes:
        values: In the unit of the kind, NaN in pixels that the camera does not see; None where there is nothing to
            show. [H, W] float32
        kind: Name, see HEAT_KINDS.
        key: Names the content; equal keys mean equal values.
        clip_index, frame_index, camera_index: The picture.
        mean: Of the values over all pixels that the camera sees.
        is_stale: It is not the requested map, but the last one of this kind and camera.
        is_extrapolated: One of the two clips was asked for an instant outside of its own frames.
        note: Why there is none, or a remark on it, in a sentence; may be empty.
    """

    values: np.ndarray | None
    kind: str
    key: Hashable
    clip_index: int
    frame_index: int
    camera_index: int
    mean: float | None = None
    is_stale: bool = False
    is_extrapolated: bool = False
    note: str = ""
