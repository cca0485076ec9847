"""What changes in a long capture beside its motion: exposures of cameras, or the light in the room.

Every change is a factor on display-encoded colours: the gain of a camera at a frame, times what becomes of the light
at a place. A factor of 0.9 on them is an exposure of 0.9 ** 2.2 in linear light.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.lab.synthetic.scene import SyntheticScene
from tests.long_captures.scene import inside_clip

Light = Callable[[int, np.ndarray], np.ndarray]
"""(frame_index, world positions [H, W, 3]) -> factor on colours there, broadcasts to [H, W, 3]."""

DRIFTS = (0.10, -0.10, 0.09, -0.09, 0.0, 0.07, -0.07, 0.06, -0.06, 0.0)
"""Logarithms of gains at the end of the capture, dealt to the training cameras. They add up to nothing: a common drift
of all cameras would be a change of the light."""
CHANNEL_SPREAD = 0.15
"""By how much of itself the drift of a channel differs at most from that of its camera."""
STEP_AT, STEP = 0.4, 0.08
"""Share of the capture after which exposures jump, and the logarithm of the jump, up in one camera and down in the
next."""
SHADOW_DEPTH = 0.3
"""Share of the light that is missing in the middle of the shadow."""
SHADOW_WAY = np.array([[-2.4, -1.6], [2.2, 1.5]])
"""Where on the floor the middle of the shadow is at the first and the last frame, scene units."""
SHADOW_RADII = (0.45, 1.15)
"""It is full within the first of these distances and ends at the second, scene units."""
SHADOW_HEIGHTS = (0.35, 0.95)
"""It is full below the first of these heights and ends at the second: it lies on the floor and on low things."""
LAMP_POSITION, LAMP_REACH = np.array([1.9, 1.7, 1.2]), 1.3
"""Where the lamp that dims stands, and at which distance half of its share in the light is left, scene units."""
LAMP_DIMMING, LAMP_AT = 0.22, (0.25, 0.7)
"""Share of the light that is lost at the lamp itself, and the part of the capture over which it is."""
DAYLIGHT_END = np.array([1.04, 1.0, 0.92])
"""Factors on red, green and blue at the end of the capture."""


@dataclass(frozen=True, slots=True)
class Change:
    """One way in which a capture differs from the unchanged one.

    Attributes:
        words: What it is.
        camera_gains: True gains of the cameras; ones where it is the light that changes. [camera, frame, 3] float64
        light: What becomes of the light; the same for every camera.
    """

    words: str
    camera_gains: np.ndarray
    light: Light

    def factors(self, camera_index: int, frame_index: int, positions: np.ndarray) -> np.ndarray:
        """By what the colours of the surfaces at these world positions [H, W, 3] are multiplied. [H, W, 3]"""
        light = self.light(frame_index, positions)
        return np.broadcast_to(self.camera_gains[camera_index, frame_index] * light, positions.shape)


def make_change(name: str, scene: SyntheticScene, *, seed: int = 0) -> Change:
    """A change of this scene by its name.

    Args:
        name: One of CHANGES.
        seed: Decides which cameras drift or jump, how fast, and how their channels differ.
    Raises:
        ValueError: There is no such change.
    """
    if name not in CHANGES:
        raise ValueError(f"there is no change called {name}; there are {', '.join(CHANGES)}")
    return CHANGES[name](scene, np.random.default_rng([seed, list(CHANGES).index(name)]))


def _none(scene: SyntheticScene, generator: np.random.Generator) -> Change:
    return Change("nothing but the motion", _no_gains(scene), _same_light)


def _drift(scene: SyntheticScene, generator: np.random.Generator) -> Change:
    """From a gain of 1 at the first frame, each camera at its own pace."""
    trained = _trained(scene)
    time = _time(scene.n_frames)
    logs = np.zeros((len(scene.rig), scene.n_frames, 3))
    for camera_index, drift in zip(trained, generator.permutation(_dealt(DRIFTS, len(trained))), strict=True):
        by_channel = drift * (1 + generator.uniform(-CHANNEL_SPREAD, CHANNEL_SPREAD, 3))
        logs[camera_index] = time[:, None] ** generator.uniform(0.8, 1.3) * by_channel
    return Change("exposures drift by up to 10 %", np.exp(logs), _same_light)


def _step(scene: SyntheticScene, generator: np.random.Generator) -> Change:
    """In every third training camera at once, in the middle of a clip."""
    from_frame = inside_clip(STEP_AT, n_frames=scene.n_frames, clip_length=scene.clip_length)
    gains = _no_gains(scene)
    for i, camera_index in enumerate(_trained(scene)[1::3]):
        gains[camera_index, from_frame:] = np.exp(STEP if i % 2 == 0 else -STEP)
    return Change("a third of the cameras change their exposure by 8 % at once", gains, _same_light)


def _shadow(scene: SyntheticScene, generator: np.random.Generator) -> Change:
    time = _time(scene.n_frames)

    def light(frame_index: int, positions: np.ndarray) -> np.ndarray:
        middle = SHADOW_WAY[0] + time[frame_index] * (SHADOW_WAY[1] - SHADOW_WAY[0])
        distance = np.linalg.norm(positions[..., :2] - middle, axis=-1)
        share = (1 - _ramp(distance, *SHADOW_RADII)) * (1 - _ramp(positions[..., 2], *SHADOW_HEIGHTS))
        return (1 - SHADOW_DEPTH * share)[..., None]

    return Change("a soft shadow crosses the floor", _no_gains(scene), light)


def _lamp(scene: SyntheticScene, generator: np.random.Generator) -> Change:
    dimmed = LAMP_DIMMING * _ramp(_time(scene.n_frames), *LAMP_AT)

    def light(frame_index: int, positions: np.ndarray) -> np.ndarray:
        distance = np.linalg.norm(positions - LAMP_POSITION, axis=-1)
        return (1 - dimmed[frame_index] / (1 + (distance / LAMP_REACH) ** 2))[..., None]

    return Change("a lamp dims, most of all near to it", _no_gains(scene), light)


def _daylight(scene: SyntheticScene, generator: np.random.Generator) -> Change:
    by_frame = DAYLIGHT_END ** _time(scene.n_frames)[:, None]
    return Change("daylight turns warmer", _no_gains(scene), lambda frame_index, positions: by_frame[frame_index])


CHANGES: dict[str, Callable[[SyntheticScene, np.random.Generator], Change]] = {
    "none": _none,
    "drift": _drift,
    "step": _step,
    "shadow": _shadow,
    "lamp": _lamp,
    "daylight": _daylight,
}
"""Name to what makes it. New ones come last, or the seeds of those behind them change."""


def _same_light(frame_index: int, positions: np.ndarray) -> np.ndarray:
    return np.ones(1)


def _no_gains(scene: SyntheticScene) -> np.ndarray:
    return np.ones((len(scene.rig), scene.n_frames, 3))


def _trained(scene: SyntheticScene) -> list[int]:
    """Cameras whose exposure may change. Held-out ones keep theirs, so that what is compared with stays the same."""
    return [i for i, name in enumerate(scene.rig.names) if name not in scene.default_holdout]


def _dealt(values: tuple[float, ...], n: int) -> np.ndarray:
    return np.resize(np.array(values), n)


def _time(n_frames: int) -> np.ndarray:
    """0 at the first frame, 1 at the last. [frame]"""
    return np.linspace(0.0, 1.0, n_frames)


def _ramp(value: np.ndarray, start: float, stop: float) -> np.ndarray:
    """Smoothly from 0 up to `start` to 1 from `stop` on."""
    share = np.clip((value - start) / (stop - start), 0.0, 1.0)
    return share * share * (3 - 2 * share)
