"""Handles of a volume or a movement: which there are, where they are seen, and what a drag of one makes of it.

No ImGui, no GL. A drag is always worked out from where it began, so that it has no memory and can be taken back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from msgspec import structs

from app.playback.views.pointing import pixel_ray, point_beside
from engine.camera.projection import focal_px, to_camera, to_pixels
from engine.camera.rotations import matrices_of, quat_product, quats_of_turns
from engine.editing.actions import Quat, Transform, vector_of
from engine.editing.edit import Box, Prism, Sphere, Volume
from engine.editing.volumes.prisms import with_depth

Thing = Volume | Transform
"""A thing with handles: a place that an edit acts on, or the movement that it makes."""
HandleKind = Literal["face", "radius", "center", "arrow", "ring", "scale"]
RING_PX, ARROW_PX, SCALE_PX = 62.0, 84.0, 112.0
"""How far from the middle rings, arrows and the handle that scales are seen, units."""
N_RING = 64
SNAP_ANGLE_RAD, SNAP_SCALE = math.radians(15.0), 0.1
LEAST_SHARE = 1e-3
"""The smallest size that a drag leaves, as a share of that at its beginning."""
LEAST_SCALE, LARGEST_SCALE = 0.01, 100.0
EDGE_ON = 0.25
"""A ring is turned in its own plane where it is seen at more than this cosine, else as the hands of a clock."""


@dataclass(frozen=True, slots=True)
class Handle:
    """One handle.

    Attributes:
        kind: "face" and "radius" change sizes, "center" and "arrow" move, "ring" turns, "scale" scales.
        axis: Of the thing, 0 to 2; 0 where there is no choice.
        sign: On which side; 1 where there is no choice.
    """

    kind: HandleKind
    axis: int = 0
    sign: int = 1

    @property
    def name(self) -> str:
        """Tells it apart from the others, as "face -x"."""
        if self.kind in ("center", "scale"):
            return self.kind
        side = {1: "+", -1: "-"}[self.sign] if self.kind in ("face", "radius") else ""
        return f"{self.kind} {side}{'xyz'[self.axis]}"

    @property
    def verb(self) -> str:
        """The effect of dragging it, as a verb."""
        return {"face": "resize", "radius": "resize", "ring": "rotate", "scale": "scale"}.get(self.kind, "move")


@dataclass(frozen=True, slots=True)
class HandleView:
    """How a picture is seen.

    Attributes:
        world_to_camera: Rigid map, OpenCV axes. [4, 4]
        K: Intrinsics in pixels of the picture. [3, 3]
        near: Nothing nearer is seen, scene units.
        pixels_per_unit: Of the picture, per unit in which handles are measured.
    """

    world_to_camera: np.ndarray
    K: np.ndarray
    near: float
    pixels_per_unit: float = 1.0

    def pixels(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where points [N, 3] are seen, px [N, 2], and which of them are before the picture [N] bool."""
        seen = to_camera(np.asarray(points, np.float64), self.world_to_camera)
        return to_pixels(seen, self.K), seen[:, 2] > max(self.near, 1e-9)

    def length(self, units: float, place: np.ndarray) -> float:
        """A length on the screen as one in the scene, at the depth of a place."""
        depth = float(to_camera(np.asarray(place, np.float64)[None], self.world_to_camera)[0, 2])
        return units * self.pixels_per_unit * max(depth, 1e-9) / float(focal_px(self.K))


def middle_of(thing: Thing) -> np.ndarray:
    """Where a thing's handles are gathered, scene units. [3]"""
    if isinstance(thing, Transform):
        return np.add(thing.pivot, thing.translation)
    return np.array(thing.center)


def axes_of(thing: Thing) -> np.ndarray:
    """Axes of a thing as columns: a box or a prism has its own, everything else those of the scene. [3, 3]"""
    return _matrix(thing.quat) if isinstance(thing, Box | Prism) else np.eye(3)


def handles_of(thing: Thing) -> list[Handle]:
    """All handles; where they are near each other, an earlier one is meant."""
    center = [Handle("center")]
    rings = [Handle("ring", axis) for axis in range(3)]
    if isinstance(thing, Box | Prism):
        faces = [Handle("face", axis, sign) for axis in range(3) for sign in (1, -1)]
        return [*faces, *center, *rings]
    if isinstance(thing, Sphere):
        return [*(Handle("radius", axis, sign) for axis in range(3) for sign in (1, -1)), *center]
    return [Handle("scale"), *(Handle("arrow", axis) for axis in range(3)), *center, *rings]


def place_of(thing: Thing, handle: Handle, lens: HandleView) -> np.ndarray:
    """Where a handle is, scene units; of a ring, its middle. [3]"""
    middle, axes = middle_of(thing), axes_of(thing)
    match handle.kind:
        case "face" if isinstance(thing, Box | Prism):
            return middle + handle.sign * thing.half_sizes[handle.axis] * axes[:, handle.axis]
        case "radius" if isinstance(thing, Sphere):
            return middle + handle.sign * thing.radius * axes[:, handle.axis]
        case "arrow":
            return middle + lens.length(ARROW_PX, middle) * axes[:, handle.axis]
        case "scale":
            right, down = lens.world_to_camera[0, :3], lens.world_to_camera[1, :3]
            return middle + lens.length(SCALE_PX, middle) * (right - down) / math.sqrt(2.0)
    return middle


def ring_of(thing: Thing, handle: Handle, lens: HandleView) -> np.ndarray:
    """The circle of a ring, closed. [N, 3]"""
    middle, axes = middle_of(thing), axes_of(thing)
    first, second = (axes[:, (handle.axis + step) % 3] for step in (1, 2))
    angles = np.linspace(0.0, 2.0 * math.pi, N_RING + 1)[:, None]
    return middle + lens.length(RING_PX, middle) * (np.cos(angles) * first + np.sin(angles) * second)


def handle_under(thing: Thing, lens: HandleView, x: float, y: float, *, reach_px: float) -> Handle | None:
    """The handle under a pixel; None off all of them. reach_px: How near the pointer has to be."""
    best: tuple[float, Handle] | None = None
    for handle in handles_of(thing):
        is_ring = handle.kind == "ring"
        if is_ring and best is not None:  # a point of its own is easier to miss than a long line
            break
        points = ring_of(thing, handle, lens) if is_ring else place_of(thing, handle, lens)[None]
        pixels, is_seen = lens.pixels(points)
        away = _distance(pixels, is_seen, np.array([x, y]))
        if away <= reach_px * (0.6 if is_ring else 1.0) and (best is None or away < best[0]):
            best = away, handle
    return None if best is None else best[1]


def dragged(
    thing: Thing,
    handle: Handle,
    lens: HandleView,
    start: tuple[float, float],
    stop: tuple[float, float],
    *,
    step: float = 0.0,
    is_whole: bool = False,
) -> Thing:
    """A thing after a drag. It stays where the drag means nothing.

    Args:
        thing: As it was when the drag began.
        start, stop: Where it began, and where the pointer is. px
        step: Lengths and places snap to its multiples, scene units; angles and factors to theirs. 0 snaps nothing.
        is_whole: A face moves all of the box along its axis.
    """
    try:
        if handle.kind == "center":
            return _moved(thing, _snapped_place(thing, _beside(thing, lens, start, stop), step))
        if handle.kind in ("face", "radius", "arrow"):
            return _dragged_along(thing, handle, lens, start, stop, step, is_whole=is_whole)
        if handle.kind == "ring":
            angle = _angle(thing, handle, lens, start, stop)
            angle = _to_multiple(angle, SNAP_ANGLE_RAD) if step else angle
            return _turned(thing, angle * axes_of(thing)[:, handle.axis])
        return _scaled(thing, _factor(thing, lens, start, stop), is_snapping=step > 0.0)
    except ValueError:  # a number that no edit may have
        return thing


def snap_step(size: float) -> float:
    """A length to snap to that suits a scene of a size: 1, 2 or 5 times a power of ten. Scene units"""
    wanted = max(size, 1e-9) / 50.0
    power = 10.0 ** math.floor(math.log10(wanted))
    return next(power * digit for digit in (5.0, 2.0, 1.0) if power * digit <= wanted * 1.0001)


# ---------------------------------------------------------------- along an axis


def _dragged_along(
    thing: Thing,
    handle: Handle,
    lens: HandleView,
    start: tuple[float, float],
    stop: tuple[float, float],
    step: float,
    *,
    is_whole: bool,
) -> Thing:
    direction = axes_of(thing)[:, handle.axis]
    place = place_of(thing, handle, lens)
    ends = (_along(lens, place, direction, start), _along(lens, place, direction, stop))
    if ends[0] is None or ends[1] is None:
        return thing
    along = ends[1] - ends[0]
    if isinstance(thing, Box | Prism) and not is_whole:
        size = 2.0 * thing.half_sizes[handle.axis]
        wanted = size + handle.sign * along
        wanted = max(_to_multiple(wanted, step) if step else wanted, max(step, LEAST_SHARE * size))
        halves = list(thing.half_sizes)
        halves[handle.axis] = wanted / 2.0
        center = np.array(thing.center) + handle.sign * (wanted - size) / 2.0 * direction
        sides = (halves[0], halves[1], halves[2])
        if isinstance(thing, Prism) and thing.apex is not None and handle.axis == 2:
            return with_depth(thing, vector_of(center), halves[2])
        return structs.replace(thing, center=vector_of(center), half_sizes=sides)
    if isinstance(thing, Sphere):
        wanted = thing.radius + handle.sign * along
        return Sphere(
            thing.center, max(_to_multiple(wanted, step) if step else wanted, max(step, LEAST_SHARE * thing.radius))
        )
    return _moved(thing, (_to_multiple(along, step) if step else along) * direction)


def _along(lens: HandleView, place: np.ndarray, direction: np.ndarray, at: tuple[float, float]) -> float | None:
    """How far along a line the point is that is nearest to the ray of a pixel; None where one looks along the line."""
    origin, ray = pixel_ray(lens.world_to_camera, lens.K, *at)
    away, cosine = place - origin, float(direction @ ray)
    sine_squared = 1.0 - cosine * cosine
    if sine_squared < 1e-3:
        return None
    return float(cosine * (ray @ away) - direction @ away) / sine_squared


# ---------------------------------------------------------------- the rest


def _beside(thing: Thing, lens: HandleView, start: tuple[float, float], stop: tuple[float, float]) -> np.ndarray:
    """The way of a drag in the plane of the picture, as deep as the middle of a thing. [3]"""
    middle = middle_of(thing)
    here, there = (point_beside(lens.world_to_camera, lens.K, *at, middle) for at in (start, stop))
    return there - here


def _snapped_place(thing: Thing, way: np.ndarray, step: float) -> np.ndarray:
    if not step:
        return way
    offset = np.array(thing.translation if isinstance(thing, Transform) else thing.center)
    return np.array([_to_multiple(value, step) for value in offset + way]) - offset


def _angle(
    thing: Thing, handle: Handle, lens: HandleView, start: tuple[float, float], stop: tuple[float, float]
) -> float:
    """By how much a drag of a ring turns, radians about the positive axis."""
    middle, axes = middle_of(thing), axes_of(thing)
    normal = axes[:, handle.axis]
    first, second = (axes[:, (handle.axis + step) % 3] for step in (1, 2))
    sight = middle - pixel_ray(lens.world_to_camera, lens.K, *start)[0]
    cosine = float(normal @ sight) / max(float(np.linalg.norm(sight)), 1e-12)
    angles = []
    for at in (start, stop):
        origin, ray = pixel_ray(lens.world_to_camera, lens.K, *at)
        across = float(normal @ ray)
        if abs(cosine) < EDGE_ON or abs(across) < EDGE_ON / 4:
            break
        met = origin + float(normal @ (middle - origin)) / across * ray - middle
        angles.append(math.atan2(float(met @ second), float(met @ first)))
    if len(angles) < 2:
        center = lens.pixels(middle[None])[0][0]
        angles = [math.atan2(at[1] - center[1], at[0] - center[0]) for at in (start, stop)]
        if cosine < 0.0:  # the axis points to the eye: clockwise on the screen is backwards
            angles = [-angle for angle in angles]
    return math.remainder(angles[1] - angles[0], 2.0 * math.pi)


def _factor(thing: Thing, lens: HandleView, start: tuple[float, float], stop: tuple[float, float]) -> float:
    center = lens.pixels(middle_of(thing)[None])[0][0]
    before, after = (math.hypot(at[0] - center[0], at[1] - center[1]) for at in (start, stop))
    return after / max(before, 1.0)


def _moved(thing: Thing, way: np.ndarray) -> Thing:
    if isinstance(thing, Transform):
        return structs.replace(thing, translation=vector_of(np.add(thing.translation, way)))
    return structs.replace(thing, center=vector_of(np.add(thing.center, way)))


def _turned(thing: Thing, turn: np.ndarray) -> Thing:
    if isinstance(thing, Sphere):
        return thing
    quat = quat_product(quats_of_turns(turn), np.array(thing.quat))
    w, x, y, z = (quat / np.linalg.norm(quat)).tolist()
    return structs.replace(thing, quat=(w, x, y, z))


def _scaled(thing: Thing, factor: float, *, is_snapping: bool) -> Thing:
    if not isinstance(thing, Transform):
        return thing
    scale = min(max(thing.scale * factor, LEAST_SCALE), LARGEST_SCALE)
    return structs.replace(thing, scale=max(_to_multiple(scale, SNAP_SCALE), SNAP_SCALE) if is_snapping else scale)


def _to_multiple(value: float, step: float) -> float:
    return round(value / step) * step


def _distance(pixels: np.ndarray, is_seen: np.ndarray, at: np.ndarray) -> float:
    """From a pixel to a line of points [N, 2], or to a single one."""
    if len(pixels) == 1:
        return float(np.hypot(*(pixels[0] - at))) if is_seen[0] else math.inf
    starts, steps = pixels[:-1], np.diff(pixels, axis=0)
    shares = ((at - starts) * steps).sum(axis=1) / np.maximum((steps * steps).sum(axis=1), 1e-12)
    away = np.linalg.norm(starts + np.clip(shares, 0.0, 1.0)[:, None] * steps - at, axis=1)
    return float(np.where(is_seen[:-1] & is_seen[1:], away, math.inf).min())


def _matrix(quat: Quat) -> np.ndarray:
    values = np.array(quat)
    return matrices_of(values / np.linalg.norm(values))
