"""One small scene that tests write in every layout: cameras with lenses, pictures that tell camera and frame apart.

A layout that cannot say something (a lens, skewed centres, names) gets a scene without it: `make_scene(lens=...)`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image

from app.lab.synthetic.rigs import make_rig
from app.lab.synthetic.writing import write_video
from engine.camera.lens import Lens
from engine.capture.capture import Capture, open_capture

NAMES = ("cam1", "cam2", "cam10", "cam11")
"""In the order in which people count, which is not that of text."""
LENSES = {
    "pinhole": Lens(),
    "opencv4": Lens("opencv", (-0.12, 0.03, 0.004, -0.003)),
    "opencv5": Lens("opencv", (-0.12, 0.03, 0.004, -0.003, 0.01)),
    "fisheye": Lens("fisheye", (0.06, -0.02, 0.008, -0.001)),
    "fisheye2": Lens("fisheye", (0.06, -0.02)),
}
AGREE_PX = 0.01
"""How far a test point may be off, whatever the layout."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Cameras and frames of a made capture. A value.

    Attributes:
        names: Of the cameras.
        Ks: At `size`, pixel centres at +0.5. [C, 3, 3]
        lenses: Of each camera.
        world_to_camera: OpenCV axes. [C, 4, 4]
        size: Width and height of all frames.
        n_frames: Of every camera.
        fps: Frames per second.
    """

    names: tuple[str, ...]
    Ks: np.ndarray
    lenses: tuple[Lens, ...]
    world_to_camera: np.ndarray
    size: tuple[int, int]
    n_frames: int
    fps: float = 30.0

    def picture(self, camera_index: int, frame_index: int) -> np.ndarray:
        """A smooth picture that tells camera and frame apart. [H, W, 3] uint8"""
        width, height = self.size
        x, y = np.linspace(0, 1, width)[None, :], np.linspace(0, 1, height)[:, None]
        red = 40 + 160 * x + 0 * y
        green = 30 + 6 * frame_index + 60 * y + 0 * x
        blue = 30 + 40 * camera_index + 30 * x * y
        return np.stack([red, green, blue], axis=-1).round().astype(np.uint8)

    def project(self, camera_index: int, points: np.ndarray) -> np.ndarray:
        """Where points [N, 3] fall in the stored frames of a camera, lens included. [N, 2] pixels, centres at +0.5"""
        return projected(self.Ks[camera_index], self.lenses[camera_index], self.world_to_camera[camera_index], points)

    def write_images(self, folder: Path, camera_index: int, name: Callable[[int], str] = "{:06d}.png".format) -> None:
        """Frames of a camera as image files, named by frame index."""
        folder.mkdir(parents=True, exist_ok=True)
        for frame_index in range(self.n_frames):
            Image.fromarray(self.picture(camera_index, frame_index)).save(folder / name(frame_index), quality=95)

    def write_video(self, path: Path, camera_index: int) -> None:
        """Frames of a camera as a video."""
        path.parent.mkdir(parents=True, exist_ok=True)
        write_video(path, (self.picture(camera_index, t) for t in range(self.n_frames)), fps=self.fps)

    def named(self, names: Sequence[str]) -> Scene:
        """The same cameras under other names."""
        return replace(self, names=tuple(names))


def projected(K: np.ndarray, lens: Lens, world_to_camera: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Pixels of points [N, 3] through one camera. [N, 2]"""
    seen = points @ world_to_camera[:3, :3].T + world_to_camera[:3, 3]
    assert (seen[:, 2] > 0).all()
    return lens.distort(seen[:, :2] / seen[:, 2:]) @ K[:2, :2].T + K[:2, 2]


def make_scene(
    *,
    lens: str = "opencv5",
    names: Sequence[str] = NAMES,
    size: tuple[int, int] = (48, 32),
    n_frames: int = 4,
    is_centered: bool = False,
    is_one_focal: bool = False,
) -> Scene:
    """Cameras of a ring.

    Args:
        lens: A name of `LENSES`; every camera's own differs a little from it.
        names: As many as there are cameras.
        size: Of the frames.
        n_frames: Of every camera.
        is_centered: Principal points in the middle, for layouts that cannot say where else they are.
        is_one_focal: One focal length for all cameras and both directions, likewise.
    """
    rig = make_rig(len(names), size)
    Ks = rig.Ks.copy()
    Ks[:, 0, 2] += 0.37  # nothing that a wrong half pixel could hide behind
    Ks[:, 1, 2] -= 0.21
    Ks[:, 1, 1] *= 1.01
    if is_centered:
        Ks[:, :2, 2] = np.array(size) / 2
    if is_one_focal:
        Ks[:, 0, 0] = Ks[:, 1, 1] = Ks[0, 0, 0]
    base = LENSES[lens]
    lenses = tuple(
        Lens(base.model, tuple(value * (1 + 0.05 * row) for value in base.params)) for row in range(len(names))
    )
    return Scene(tuple(names), Ks, lenses, rig.world_to_camera.copy(), size, n_frames)


def make_points() -> np.ndarray:
    """Points in front of every camera of the ring, also far from the middle of the picture. [N, 3]"""
    return np.random.default_rng(3).uniform(-1.0, 1.0, (40, 3)) + np.array([0.0, 0.0, 0.6])


def check_reads_as(
    folder: Path,
    scene: Scene,
    *,
    similarity: np.ndarray | None = None,
    picture_error: float = 6.0,
    follow_links: bool = False,
) -> Capture:
    """Open a written capture and compare it with its scene: names, length, projections, pictures.

    Args:
        similarity: From the scene's world to the capture's, where the layout stores another world. [4, 4]
        picture_error: Mean difference of 8-bit values that pictures may have; videos are lossy.
    Returns:
        The capture, for more checks.
    """
    capture = open_capture(folder, follow_links=follow_links)
    assert capture.rig.names == scene.names
    assert capture.n_frames == scene.n_frames
    points = make_points()
    moved = points if similarity is None else points @ similarity[:3, :3].T + similarity[:3, 3]
    for row, entry in enumerate(capture.layout.cameras):
        assert entry.image_size == scene.size
        found = projected(entry.K, entry.lens, entry.world_to_camera, moved)
        assert np.abs(found - scene.project(row, points)).max() < AGREE_PX, entry.name
        for frame_index in (0, scene.n_frames - 1):
            (picture,) = entry.source.read([frame_index])
            error = np.abs(picture.astype(float) - scene.picture(row, frame_index)).mean()
            assert error < picture_error / 2, (
                entry.name,
                frame_index,
            )  # the next frame differs by 2, the next camera by 13
    return capture
