"""Writes the shared scene in the multipleview layout of 4DGaussians."""

from __future__ import annotations

from pathlib import Path

from tests.engine.capture.layouts.scene import Scene
from tests.engine.capture.layouts.written_colmap import MODEL_OF, write_model

NAMES = ("cam01", "cam02", "cam09", "cam10")
"""As the layout demands."""


def write(folder: Path, scene: Scene, *, lens: str) -> None:
    """The scene, whose cameras are called cam01 and so on. lens: what it was made with."""
    write_model(
        folder / "sparse_", scene, MODEL_OF[lens], image_name=lambda name: f"image{int(name.removeprefix('cam'))}.jpg"
    )
    for row, name in enumerate(scene.names):
        scene.write_images(folder / name, row, lambda t: f"frame_{t + 1:05d}.jpg")
    (folder / "poses_bounds_multipleview.npy").write_bytes(b"not read")
