"""What happens in the captures: people who touch, once or again and again, leave, stand still, and throw a ball."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from app.lab.synthetic import meshes, textures
from app.lab.synthetic.rigs import RING_RADIUS, looking_at
from app.lab.synthetic.scene import Part, SyntheticScene, make_room, placed, still
from app.lab.synthetic.textures import rgb
from engine.camera.rig import CameraRig
from tests.long_captures.scene import CONTRAST, FOCAL, PAINT
from tests.objects_truth.people import Clothes, Walk, hand, make_person, walk

SIZE = (160, 120)
"""Width and height of every picture."""
CLIP_LENGTH = 10
"""Frames per clip of the training to come."""
N_CAMERAS, ARC_DEG = 12, 200.0
"""So many cameras on a part of the ring, 18 degrees apart as in the sample."""
FOCUS = np.array([0.0, 0.0, 0.72])
"""What they look at."""
CAMERA_HEIGHTS = (1.05, 1.85)
"""Neighbours stand at these in turn."""
EVALUATED = (0, 3, 8, 11)
"""Cameras whose masks are written: the ends of the arc, and the two that are held out."""
RED = Clothes("a8443c", "c9b29a", "3c4660", "4a3324")
OCHRE = Clothes("b07a3c", "8c3c34", "3c4660", "6b4a2c")
"""Warm shirts of both, and the same trousers: colour alone does not tell them apart."""
BALL_RADIUS = 0.085
"""Scene units."""
WAY_FRAMES = 25
"""What somebody who walks to and fro needs for one way."""

Scenario = Callable[[], tuple[list[Part], int]]
"""The moving parts, and the number of frames."""


def touching() -> tuple[list[Part], int]:
    """Two walk towards each other, pass so closely that their arms run into each other, and walk on."""
    a = walk((0, -1.25, 0.3, -100), (16, -0.25, 0.24, -90), (24, 0.25, 0.2, -90), (39, 1.15, 0.45, -70))
    b = walk((0, 1.25, -0.35, 80), (16, 0.25, -0.22, 90), (24, -0.25, -0.2, 90), (39, -1.2, -0.5, 110))
    return [*make_person("person_a", a, RED, seed=3), *make_person("person_b", b, OCHRE, seed=5)], 40


def leaving() -> tuple[list[Part], int]:
    """One leaves through the wall as through a door, and comes back through another a clip later."""
    a = walk(
        (0, 0.2, -0.6, 0), (6, 0.35, 0.0, -10), (27, 1.2, 3.4, -10),
        (28, -3.4, 0.9, -100), (41, -3.4, 0.9, -100), (59, -0.9, 0.35, -110),
        absent=(28, 41),
    )  # fmt: skip
    b = walk((0, -1.0, -0.8, -90), (30, 0.5, -0.7, -80), (36, 0.6, -0.6, 60), (59, -0.2, -0.2, 70))
    return [*make_person("person_a", a, RED, seed=3), *make_person("person_b", b, OCHRE, seed=5)], 60


def pausing() -> tuple[list[Part], int]:
    """One walks, stands absolutely still from frame 18 to 32, which holds the whole third clip, and walks on."""
    a = walk((0, -1.2, -0.5, -75), (18, 0.0, -0.2, -75), (32, 0.0, -0.2, -75), (49, 1.0, 0.5, -50))
    b = walk((0, 1.1, 0.9, 90), (24, -0.6, 0.85, 90), (29, -0.8, 0.7, 190), (49, -0.9, -0.7, 190))
    return [*make_person("person_a", a, RED, seed=3), *make_person("person_b", b, OCHRE, seed=5)], 50


def throwing() -> tuple[list[Part], int]:
    """One throws a ball to the other, who catches it; both walk slowly sideways."""
    a = walk((0, -0.95, -0.7, -85), (39, -0.85, 0.45, -100))
    b = walk((0, 1.0, -0.45, 85), (39, 0.9, 0.6, 100))
    released, caught = 14, 25

    def raised_a(frame_index: int) -> float:
        return float(np.interp(frame_index, (0, 8, released, 22, 39), (60, 40, 105, 80, 30)))

    def raised_b(frame_index: int) -> float:
        return float(np.interp(frame_index, (0, 16, caught, 30, 39), (30, 60, 100, 70, 60)))

    def ball(frame_index: int) -> np.ndarray:
        if frame_index <= released:
            place = hand(a, raised_a, frame_index)
        elif frame_index >= caught:
            place = hand(b, raised_b, frame_index)
        else:
            time = (frame_index - released) / (caught - released)
            place = (1 - time) * hand(a, raised_a, released) + time * hand(b, raised_b, caught)
            place[2] += 4 * 0.3 * time * (1 - time)
        return placed(*place) @ placed(0, 0, 0, turn_deg=9.0 * frame_index)

    people = [
        *make_person("person_a", a, RED, seed=3, raised=raised_a),
        *make_person("person_b", b, OCHRE, seed=5, raised=raised_b),
    ]
    return [*people, Part("ball", meshes.sphere(BALL_RADIUS, n_around=32), _ball, ball, is_moving=True)], 40


def long() -> tuple[list[Part], int]:
    """Two walk to and fro and pass each other six times, arms into each other, over fifteen clips."""
    a, b = _to_and_fro(n_ways=6, side=1.0), _to_and_fro(n_ways=6, side=-1.0)
    return [*make_person("person_a", a, RED, seed=3), *make_person("person_b", b, OCHRE, seed=5)], 6 * WAY_FRAMES


def _to_and_fro(*, n_ways: int, side: float) -> Walk:
    """Ways along x and back, each begun with a turn; side: 1 or -1, of y = 0, and which way the first goes."""
    rows = []
    for i in range(n_ways):
        along, start = side * (-1.0) ** i, WAY_FRAMES * i
        rows += [
            (start + after, along * x, side * y, -90.0 * along)
            for after, x, y in ((3, -0.8, 0.42), (11, -0.25, 0.22), (17, 0.25, 0.22), (WAY_FRAMES, 0.8, 0.42))
        ]
    return walk(*rows)


SCENARIOS: dict[str, Scenario] = {
    "touching": touching,
    "leaving": leaving,
    "pausing": pausing,
    "throwing": throwing,
    "long": long,
}
"""By name."""


def make_object_scene(name: str, *, size: tuple[int, int] = SIZE) -> SyntheticScene:
    """A scene by name.

    Args:
        name: One of SCENARIOS.
        size: Width and height of the pictures.
    Raises:
        ValueError: There is no such scene.
    """
    if name not in SCENARIOS:
        raise ValueError(f"there is no scene called {name}; there are {', '.join(SCENARIOS)}")
    moving, n_frames = SCENARIOS[name]()
    return SyntheticScene((*_room(), *moving), _cameras(size), n_frames, CLIP_LENGTH, fps=30.0)


def object_names(scene: SyntheticScene) -> tuple[str, ...]:
    """The objects of a scene, in the order of their labels: people, whose parts count as one, and the ball."""
    return tuple(dict.fromkeys(part.name.split(".")[0] for part in scene.parts if part.is_moving))


def labels_of(part_names: Sequence[str], objects: Sequence[str]) -> np.ndarray:
    """Label of each part: 1 + number of its object, 0 for what is none. [P] uint8"""
    owners = [name.split(".")[0] for name in part_names]
    return np.array([objects.index(owner) + 1 if owner in objects else 0 for owner in owners], np.uint8)


def _room() -> list[Part]:
    (shell,) = make_room(lambda points, normals: PAINT + CONTRAST * (textures.room(points, normals) - PAINT))
    crate = meshes.box((0.56, 0.56, 0.56))
    return [shell, Part("crate", crate, textures.planks, still(placed(-0.2, 1.75, 0.28, turn_deg=28)))]


def _ball(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Orange with a few dark bands."""
    band = textures.step(np.abs(np.sin(3 * np.arctan2(points[:, 1], points[:, 0]))), 0.2, 0.2)
    return textures.mix(rgb("5a3018"), rgb("e88a2c"), band)


def _cameras(size: tuple[int, int]) -> CameraRig:
    width, height = size
    azimuths = np.radians(np.linspace(-0.5, 0.5, N_CAMERAS) * ARC_DEG - 60.0)
    poses = [
        looking_at(np.array([RING_RADIUS * np.cos(at), RING_RADIUS * np.sin(at), CAMERA_HEIGHTS[i % 2]]), FOCUS)
        for i, at in enumerate(azimuths)
    ]
    K = np.array([[FOCAL * width, 0.0, width / 2], [0.0, FOCAL * width, height / 2], [0.0, 0.0, 1.0]])
    return CameraRig(
        names=tuple(f"cam{i:02d}" for i in range(N_CAMERAS)),
        world_to_camera=np.round(np.stack(poses), 12),
        Ks=np.tile(K, (N_CAMERAS, 1, 1)),
        image_sizes=np.tile(np.array(size, dtype=np.int64), (N_CAMERAS, 1)),
    )
