"""ViewPlace: viewpoint and lens of a view, as plain values that can be kept and gone back to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from app.playback.views.orbit_view import OrbitView
from app.playback.views.scene_axes import RIG_UP, UP_AXES

_RANGES = {
    "distance": (1e-4, 1e6),
    "yaw": (-7.0, 7.0),
    "pitch": (-1.58, 1.58),
    "roll": (-7.0, 7.0),
    "fov_y": (0.02, 3.0),
}


@dataclass(frozen=True, slots=True)
class ViewPlace:
    """See the attributes of OrbitView; `camera` is the name of the capture camera that is looked through, or None."""

    pivot: tuple[float, float, float]
    distance: float
    yaw: float
    pitch: float
    roll: float
    fov_y: float
    is_orthographic: bool
    up_axis: str
    camera: str | None

    @classmethod
    def of(cls, view: OrbitView) -> Self:
        """The place of a view, or the one it is moving to."""
        rig, camera = view.rig, view.look_through
        return cls(
            pivot=(float(view.pivot[0]), float(view.pivot[1]), float(view.pivot[2])),
            distance=float(view.distance),
            yaw=float(view.yaw),
            pitch=float(view.pitch),
            roll=float(view.roll),
            fov_y=float(view.fov_y),
            is_orthographic=view.is_orthographic,
            up_axis=view.up_axis,
            camera=None if camera is None or rig is None else rig.names[camera],
        )

    @classmethod
    def read(cls, values: dict[str, Any]) -> Self | None:
        """A place from the result of `values`; None where that is not valid. Entries newer than the file may be
        missing."""
        pivot = values.get("pivot")
        place = _numbers([(value, -1e6, 1e6) for value in pivot] if isinstance(pivot, list | tuple) else [])
        angles = _numbers([(values.get(name, 0.0), *limits) for name, limits in _RANGES.items()])
        if len(place) != 3 or not angles:
            return None
        up_axis, camera = values.get("up_axis", RIG_UP), values.get("camera")
        return cls(
            pivot=(place[0], place[1], place[2]),
            **dict(zip(_RANGES, angles, strict=True)),
            is_orthographic=values.get("is_orthographic") is True,
            up_axis=up_axis if isinstance(up_axis, str) and up_axis in UP_AXES else RIG_UP,
            camera=camera if isinstance(camera, str) else None,
        )

    def values(self) -> dict[str, Any]:
        """Everything as values for JSON."""
        return {name: getattr(self, name) for name in self.__slots__} | {"pivot": list(self.pivot)}

    def show(self, view: OrbitView) -> None:
        """Let a view go there; a camera that the rig does not have is left out."""
        names = () if view.rig is None else view.rig.names
        with view.jump():
            view.set_up_axis(self.up_axis)
            view.pivot = np.array(self.pivot, dtype=np.float64)
            view.distance, view.fov_y = self.distance, self.fov_y
            view.yaw, view.pitch, view.roll = self.yaw, self.pitch, self.roll
            view.is_orthographic = self.is_orthographic
            view.look_through = names.index(self.camera) if self.camera in names else None


def _numbers(found: list[tuple[Any, float, float]]) -> list[float]:
    """Values that are numbers within their limits; none at all if one of them is not."""
    numbers = [
        float(value)
        for value, low, high in found
        if isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high  # NaN is not
    ]
    return numbers if len(numbers) == len(found) else []
