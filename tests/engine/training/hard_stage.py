"""Generated captures of a floor and things on it: balls and boxes by formula, with light and exposure over time.

The floor has a soft pattern and is seen from a ring of nine cameras that look down, so every ray hits something.
Pictures are made in memory and are the same on every machine that rounds alike. Scene units are arbitrary: the floor
seen is about 3 across, a pixel on it 0.03.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from app.lab.synthetic import textures
from app.lab.synthetic.rigs import looking_at
from engine.camera.rig import CameraRig
from engine.capture.capture import Capture
from engine.capture.layout.format_result import Layout

WIDTH, HEIGHT, FOCAL = 96, 72, 100.0
N_CAMERAS = 9
HELD_OUT = 4
"""A camera inside the ring, so that what is measured there was never trained on."""
SUPERSAMPLING = 2
CLIP_LENGTH = 4
NOISE = 0.5
"""Of the cameras, grey levels: pictures without any are like no camera's."""
SUN = np.array([0.4, -0.3, 0.86])

Place = Callable[[int], tuple[float, float, float] | None]
"""Frame of the capture -> centre of a thing; None while it is not there."""


@dataclass(frozen=True, slots=True)
class Thing:
    """A ball or an upright box.

    Attributes:
        place: Where it is.
        size: Radius of a ball, or half edges of a box.
        colors: Two colours of its pattern, six hex digits each.
    """

    place: Place
    size: float | tuple[float, float, float]
    colors: tuple[str, str] = ("d04030", "f0c060")


def _steady(_frame: int, points: np.ndarray) -> np.ndarray:
    return np.ones(len(points))


def _level(_camera: int, _frame: int) -> float:
    return 1.0


def _at_rest(_frame: int) -> float:
    return 0.0


@dataclass(frozen=True, slots=True)
class HardScene:
    """What happens in one capture.

    Attributes:
        n_clips: Of CLIP_LENGTH frames, unless `clip_length` says otherwise.
        things: All things, whenever they are there.
        light: (frame, points on the floor [P, 3]) -> factor of what they reflect. [P]
        exposure: (camera, frame) -> factor of the whole picture.
        slide: Frame -> how far the floor's pattern has moved along x.
    """

    name: str
    n_clips: int = 2
    things: tuple[Thing, ...] = ()
    light: Callable[[int, np.ndarray], np.ndarray] = _steady
    exposure: Callable[[int, int], float] = _level
    slide: Callable[[int], float] = _at_rest
    clip_length: int = CLIP_LENGTH

    @property
    def n_frames(self) -> int:
        """Of the whole capture."""
        return self.n_clips * self.clip_length

    def capture(self) -> Capture:
        """The pictures as an opened capture."""
        rig = make_rig()
        pixels = np.stack([self.video(camera) for camera in range(N_CAMERAS)])
        return Capture(
            path=Path(self.name),
            format="made in memory",
            rig=rig,
            n_frames=self.n_frames,
            fps=10.0,
            scale=1.0,
            native_rig=rig,
            default_holdout=(rig.names[HELD_OUT],),
            warnings=(),
            fingerprint=f"{self.name}-{self.n_frames}",
            store=_Pixels(pixels),  # type: ignore[arg-type]
            layout=Layout("made in memory", (), self.n_frames, 10.0),
        )

    def video(self, camera: int) -> np.ndarray:
        """All frames of one camera. [T, H, W, 3] uint8"""
        return np.stack([self._image(camera, frame) for frame in range(self.n_frames)])

    def shows(self, camera: int, frame: int, *things: int) -> np.ndarray:
        """Pixels of which these things cover at least half. [H, W] bool"""
        return _pixels(np.isin(_met(self, camera, frame), things).astype(np.float64)) >= 0.5

    def floor(self, camera: int, frame: int) -> np.ndarray:
        """Pixels that show nothing but floor. [H, W] bool"""
        return _pixels((_met(self, camera, frame) >= 0).astype(np.float64)) == 0.0

    def floor_under(self, camera: int, light: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """A function of points on the floor, as this camera sees it. [H, W]"""
        return _pixels(light(_rays(camera)[2]))

    def _image(self, camera: int, frame: int) -> np.ndarray:
        shown = _pixels(self._colors(camera, frame)) * self.exposure(camera, frame)
        noise = np.random.default_rng([camera, frame]).normal(0.0, NOISE, shown.shape)
        return np.clip(np.floor(shown * 255.0 + noise + 0.5), 0, 255).astype(np.uint8)

    def _colors(self, camera: int, frame: int) -> np.ndarray:
        """Colour of every ray. [R, 3]"""
        origin, directions, floor = _rays(camera)
        slide = self.slide(frame)
        colors = _floor_colors(camera) if slide == 0.0 else _pattern(floor - [slide, 0.0, 0.0])
        colors = colors * self.light(frame, floor)[:, None]
        met, reach = self._hits(camera, frame)
        for index in np.unique(met[met >= 0]):
            thing, is_here = self.things[index], met == index
            points = origin + directions[is_here] * reach[is_here, None] - np.array(thing.place(frame))
            share = textures.cloudy(points * 7.0 + 11.0, int(index))
            albedo = textures.mix(textures.rgb(thing.colors[0]), textures.rgb(thing.colors[1]), share)
            lit = 0.6 + 0.4 * np.maximum(_normals(thing.size, points) @ SUN, 0.0)
            colors[is_here] = albedo * lit[:, None]
        return colors

    def _hits(self, camera: int, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """The thing that every ray meets, -1 for the floor [R], and how far away in depths of the camera [R]."""
        origin, directions, _ = _rays(camera)
        nearest, met = -origin[2] / directions[:, 2], np.full(len(directions), -1, dtype=np.int8)
        for index, thing in enumerate(self.things):
            center = thing.place(frame)
            if center is not None:
                reach = _meet(thing.size, origin - np.array(center), directions)
                met[reach < nearest] = index
                nearest = np.minimum(reach, nearest)
        return met, nearest


@cache
def _met(scene: HardScene, camera: int, frame: int) -> np.ndarray:
    return scene._hits(camera, frame)[0]


class _Pixels:
    """Frames in memory, in the place of engine.capture.frames.FrameStore."""

    def __init__(self, pixels: np.ndarray) -> None:
        self._pixels = pixels

    def frames(self, camera_index: int, frame_indices: Sequence[int]) -> Iterator[np.ndarray]:
        yield from self._pixels[camera_index, list(frame_indices)]

    def valid(self, camera_index: int) -> None:
        """All pixels are."""

    def moving_mask(self, camera_index: int, frame_index: int) -> None:
        """Nobody painted any."""

    def close(self) -> None:
        pass


@cache
def make_rig() -> CameraRig:
    """Nine cameras on a ring, 55 degrees above the floor, so that neighbours see the same floor 23 degrees apart."""
    poses = []
    for i in range(N_CAMERAS):
        azimuth, elevation = 2 * np.pi * i / N_CAMERAS, np.radians(57.0 if i % 2 else 52.0)
        flat = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
        center = 3.2 * np.array([*flat, np.sin(elevation)])
        poses.append(looking_at(center, np.array([0.0, 0.0, 0.1])))
    K = np.array([[FOCAL, 0.0, WIDTH / 2], [0.0, FOCAL, HEIGHT / 2], [0.0, 0.0, 1.0]])
    sizes = np.tile(np.array([WIDTH, HEIGHT], dtype=np.int64), (N_CAMERAS, 1))
    names = tuple(f"cam{i}" for i in range(N_CAMERAS))
    return CameraRig(names, np.stack(poses), np.tile(K, (N_CAMERAS, 1, 1)), sizes)


@cache
def _rays(camera: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Camera centre [3], directions of all rays [R, 3], and where they meet the floor [R, 3]."""
    rig, n = make_rig(), SUPERSAMPLING
    x = ((np.arange(WIDTH * n) + 0.5) / n - WIDTH / 2) / FOCAL
    y = ((np.arange(HEIGHT * n) + 0.5) / n - HEIGHT / 2) / FOCAL
    x, y = np.meshgrid(x, y)
    directions = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3) @ rig.world_to_camera[camera, :3, :3]
    origin = rig.centers[camera]
    return origin, directions, origin - directions * (origin[2] / directions[:, 2])[:, None]


def _pixels(values: np.ndarray) -> np.ndarray:
    """Means over the rays of each pixel. [R, ...] to [H, W, ...]"""
    n = SUPERSAMPLING
    return values.reshape(HEIGHT, n, WIDTH, n, *values.shape[1:]).mean(axis=(1, 3))


@cache
def _floor_colors(camera: int) -> np.ndarray:
    return _pattern(_rays(camera)[2])


def _pattern(points: np.ndarray) -> np.ndarray:
    """What the floor reflects: soft patches about 0.3 across, between 70 and 170 of 255. [P, 3]"""
    flat = points[:, :2]
    first = textures.mix(textures.rgb("5f6f8f"), textures.rgb("a89878"), textures.cloudy(flat * 3.0, 1))
    return first * (0.8 + 0.4 * textures.cloudy(flat * 4.5 + 7.0, 2))[:, None]


def _meet(size: float | tuple[float, float, float], origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """How far along each ray a ball or box around zero begins, infinite where it does not. [R]"""
    if isinstance(size, tuple):
        to_faces = np.sign(directions) * np.array(size)
        start = ((-to_faces - origin) / directions).max(axis=1)
        end = ((to_faces - origin) / directions).min(axis=1)
        return np.where((start < end) & (start > 0.0), start, np.inf)
    a, b = (directions**2).sum(axis=1), directions @ origin
    inside = b * b - a * (origin @ origin - size * size)
    return np.where(inside > 0.0, (-b - np.sqrt(np.maximum(inside, 0.0))) / a, np.inf)


def _normals(size: float | tuple[float, float, float], points: np.ndarray) -> np.ndarray:
    """Of points on a ball or box around zero. [P, 3]"""
    if not isinstance(size, tuple):
        return points / size
    parts = points / np.array(size)
    axes = np.abs(parts).argmax(axis=1)[:, None]
    normals = np.zeros_like(points)
    np.put_along_axis(normals, axes, np.sign(np.take_along_axis(parts, axes, axis=1)), axis=1)
    return normals
