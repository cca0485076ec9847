"""Scenes that are hard for "model only what a scene needs": light, shadows, exposure, what comes and goes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.lab.synthetic import textures
from tests.engine.training.hard_stage import CLIP_LENGTH, HardScene, Place, Thing

CRATE = Thing(lambda _: (0.65, -0.6, 0.2), (0.22, 0.18, 0.2), ("307050", "80c0a0"))
"""Stands still in all clips."""


def _rolling(frame: int) -> tuple[float, float, float]:
    return (-0.7 + 0.11 * frame, 0.65, 0.25)


BALL = Thing(_rolling, 0.22)
"""Moves in all clips, along one edge of the scene."""


def _soft(distance: np.ndarray, edge: float, width: float) -> np.ndarray:
    """1 below the edge, 0 above, with a soft rim of this width."""
    return 1.0 - textures.step(distance, edge, width)


def spot(x: float, y: float, radius: float) -> Callable[[np.ndarray], np.ndarray]:
    """How much of a lamp falls on points of the floor. [P, 3] to [P]"""
    return lambda points: _soft(np.hypot(points[:, 0] - x, points[:, 1] - y), radius, 0.12)


EARLY_SPOT, LATE_SPOT = spot(0.0, -0.1, 0.27), spot(-0.65, -0.5, 0.3)


def lamps() -> HardScene:
    """Two lamps that add a third: one is switched on between the clips, the other in the middle of clip 1."""

    def light(frame: int, points: np.ndarray) -> np.ndarray:
        early, late = frame >= CLIP_LENGTH, frame >= CLIP_LENGTH + 2
        return 1.0 + 0.35 * (early * EARLY_SPOT(points) + late * LATE_SPOT(points))

    return HardScene("lamps", things=(CRATE, BALL), light=light)


SHADOW_WAY = (-0.9, -0.25)
"""Where along x the edge of the slow shadow passes."""


def in_shadow_way(points: np.ndarray) -> np.ndarray:
    """1 on the strip of floor over which the edge of the slow shadow passes. [P, 3] to [P]"""
    x, y = points[:, 0], points[:, 1]
    return ((y < 0.2) & (x > SHADOW_WAY[0]) & (x < SHADOW_WAY[1])).astype(np.float64)


def slow_shadow() -> HardScene:
    """A soft shadow of something outside that creeps over the floor, a pixel and a half a frame."""

    def light(frame: int, points: np.ndarray) -> np.ndarray:
        return 1.0 - 0.3 * _soft(points[:, 0], -0.75 + 0.05 * frame, 0.3) * (points[:, 1] < 0.2)

    return HardScene("slow_shadow", things=(CRATE, BALL), light=light)


DRIFTING = 2
"""The camera whose exposure drifts."""


def drifting_exposure() -> HardScene:
    """One camera's pictures become brighter by 3 % a frame."""
    return HardScene(
        "drifting_exposure",
        things=(CRATE, BALL),
        exposure=lambda camera, frame: 1.0 + 0.03 * frame * (camera == DRIFTING),
    )


LID, TREASURE = 2, 3


def lifted_lid() -> HardScene:
    """A box that rests for two clips, then moves aside and uncovers a small one that nobody has seen before."""

    def lid(frame: int) -> tuple[float, float, float]:
        return (-0.3 + 0.18 * max(0, frame - 2 * CLIP_LENGTH + 1), -0.3, 0.2)

    things = (
        CRATE,
        BALL,
        Thing(lid, (0.24, 0.24, 0.2), ("6040a0", "a080d0")),
        Thing(lambda _: (-0.3, -0.3, 0.1), (0.12, 0.12, 0.1), CRATE.colors),
    )
    return HardScene("lifted_lid", n_clips=3, things=things)


LEAVING, RESTING, ENTERING = 2, 3, 4


def coming_and_going() -> HardScene:
    """One that moves and has left by clip 1, one that rests in clip 0 and has left by clip 1, one that comes in the
    middle of clip 1."""

    def leaving(frame: int) -> tuple[float, float, float] | None:
        return (-0.6 + 0.1 * frame, 0.05, 0.2) if frame < CLIP_LENGTH else None

    def resting(frame: int) -> tuple[float, float, float] | None:
        return (-0.5, -0.6, 0.18) if frame < CLIP_LENGTH else None

    def entering(frame: int) -> tuple[float, float, float] | None:
        return (0.15 + 0.1 * (frame - 6), -0.25, 0.2) if frame >= CLIP_LENGTH + 2 else None

    things = (
        CRATE,
        BALL,
        Thing(leaving, 0.2, ("2060c0", "60a0f0")),
        Thing(resting, 0.18, ("f0f0f0", "c0c0c0")),
        Thing(entering, 0.2, ("c02080", "f070c0")),
    )
    return HardScene("coming_and_going", n_clips=2, things=things)


def all_moving() -> HardScene:
    """The floor's pattern slides and everything on it moves along: no pixel ever rests."""

    def along(x: float, y: float, z: float) -> Place:
        return lambda frame: (x + 0.12 * frame, y, z)

    things = (
        Thing(along(-0.5, 0.5, 0.25), 0.22),
        Thing(along(-0.4, -0.4, 0.2), (0.22, 0.18, 0.2), ("307050", "80c0a0")),
    )
    return HardScene("all_moving", things=things, slide=lambda frame: 0.12 * frame)


def all_still() -> HardScene:
    """Nothing but noise ever changes."""
    return HardScene("all_still", things=(CRATE,))


def plain() -> HardScene:
    """The ball rolls, and that is all."""
    return HardScene("plain", things=(CRATE, BALL))


def one_frame_clips(n_clips: int = 3) -> HardScene:
    """Clips of one frame each; the ball has gone its own width from one to the next."""

    def jumping(frame: int) -> tuple[float, float, float]:
        return _rolling(4 * frame)

    return HardScene(f"{n_clips}_frames", n_clips=n_clips, things=(CRATE, Thing(jumping, 0.22)), clip_length=1)
