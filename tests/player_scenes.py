"""A made scene of four clips for the player, which has everything that its layout knows, and the page of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from engine.export.player.blocks import Packer, joined
from engine.export.player.moving_rows import NamedRows
from engine.export.player.page import page_writer
from engine.export.splats import Splats

NEAR = 0.1
BACKGROUND = (18 / 255, 20 / 255, 24 / 255)
LENGTHS = (3, 4, 3, 2)
"""Frames of the clips: the first one as it is; one with hidden and further rows, and light that changes evenly; one
with light that flickers; one in which what stands still does not."""
N_FRAMES = sum(LENGTHS)
FLOOR, METERS_PER_UNIT = -1.5, 0.7
"""How far up the ground is, scene units, and the length of one."""
SIZE = (160, 120)


def made_splats(n: int, seed: int, *, center: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Splats:
    """Gaussians of many shapes around a point."""
    random = np.random.default_rng(seed)
    return Splats.from_arrays(
        means=random.normal(0.0, 0.6, (n, 3)) + center,
        quats=random.normal(0.0, 1.0, (n, 4)),
        scales=np.exp(random.uniform(-5.0, -1.5, (n, 3))),
        opacities=random.uniform(0.02, 1.0, n),
        colors=random.uniform(0.0, 1.0, (n, 3)),
    )


def still(clip: int, frame: int) -> Splats:
    """What stands still in a frame of a clip."""
    shared = made_splats(600, 1)
    match clip:
        case 0:
            return shared
        case 1:
            kept = np.flatnonzero(np.random.default_rng(2).uniform(size=len(shared)) > 0.2)
            rows = joined(shared[kept[:200]], made_splats(50, 3), shared[kept[200:]])
            return in_light(rows, 1.0 + 0.15 * frame / (LENGTHS[1] - 1))
        case 2:
            return in_light(shared, (1.0, 0.4, 0.8)[frame])
        case _:
            return made_splats(300, 4 + frame)


def moving(clip: int, frame: int) -> Splats:
    """What moves: another number of Gaussians in every frame, and none in one of them."""
    n = 0 if (clip, frame) == (2, 1) else 150 + 10 * frame + clip
    return made_splats(n, 100 + 10 * clip + frame, center=(0.3 * frame - 0.4, 0.2 * clip - 0.3, 0.0))


def places() -> list[tuple[int, int]]:
    """Clip and frame of the clip of each frame."""
    return [(clip, frame) for clip, length in enumerate(LENGTHS) for frame in range(length)]


def in_light(splats: Splats, factor: float) -> Splats:
    """As bright as the factor says."""
    return Splats(splats.means, splats.quats, splats.scales, splats.opacities, splats.colors * np.float32(factor))


def camera(index: int, *, size: tuple[int, int] = SIZE) -> tuple[np.ndarray, np.ndarray]:
    """A camera on a circle around the scene, with a principal point of its own. [4, 4], [3, 3]"""
    angle = 2.0 * math.pi * index / 5.0
    eye = 4.0 * np.array([math.sin(angle), -0.3, -math.cos(angle)])
    forward = -eye / np.linalg.norm(eye)
    right = np.cross(forward, [0.0, -1.0, 0.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, -rotation @ eye
    focal = 0.9 * size[0]
    K = np.array([[focal, 0.0, 0.53 * size[0]], [0.0, 1.02 * focal, 0.46 * size[1]], [0.0, 0.0, 1.0]])
    return matrix, K


def header(*, title: str = "A scene", names: Sequence[str] = ("a", "b", "c", "d", "e")) -> dict[str, Any]:
    """What a page knows beside the Gaussians, without clips."""
    cameras = []
    for index, name in enumerate(names):
        matrix, K = camera(index)
        lens = [K[0, 0], K[1, 1], K[0, 2], K[1, 2]]
        known = {"name": name, "width": SIZE[0], "height": SIZE[1], "K": lens, "distance": 4.0}
        cameras.append({**known, "world_to_camera": matrix.ravel().tolist()})
    home = {"world_to_camera": camera(0)[0].ravel().tolist(), "distance": 4.0, "fov_y": 0.8, "aspect": 4 / 3}
    return {
        "title": title,
        "fps": 25.0,
        "step": 1,
        "near_plane": NEAR,
        "background": list(BACKGROUND),
        "up": [0.0, -1.0, 0.0],
        "radius": 4.0,
        "stage": {"floor": FLOOR, "meters_per_unit": METERS_PER_UNIT, "is_measured": False},
        "home": home,
        "cameras": cameras,
        "clips": [],
        "folder": None,
    }


def write_page(path: Path, about: dict[str, Any], *, folder: Path | None = None, poster: bytes | None = None) -> Path:
    """The page of the made scene. folder: Where clips go instead."""
    if folder is not None:
        folder.mkdir()
        about["folder"] = folder.as_uri().rpartition("/")[2]
    packer, first = Packer(), 0
    with (
        path.open("w", encoding="utf-8", newline="\n") as stream,
        page_writer(stream, about, folder=folder, poster=poster) as writer,
    ):
        for index, length in enumerate(LENGTHS):
            block = packer.clip(
                length,
                still=lambda frame, c=index: still(c, frame),
                moving=lambda frame, c=index: NamedRows(moving(c, frame), np.arange(len(moving(c, frame)))),
            )
            place = {"clip_index": index, "name": f"clip{index}", "first": first, "frame_index": first}
            about["clips"].append({**place, **block.description})
            writer.block(f"clip{index}", block)
            first += length
        assert packer.shared is not None
        about["shared"] = packer.shared.description
        writer.block("shared", packer.shared)
    return path
