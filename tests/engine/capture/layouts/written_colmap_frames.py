"""Writes the shared scene with a COLMAP folder per frame."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

from tests.engine.capture.layouts.scene import Scene
from tests.engine.capture.layouts.written_colmap import MODEL_OF, write_model


def write(
    folder: Path,
    scene: Scene,
    *,
    lens: str,
    frame: str = "frame{:06d}",
    inner: str = "images",
    model: str = "frame000000/sparse/0",
    first: int = 0,
) -> None:
    """The scene as frames.

    Args:
        lens: What the scene was made with.
        frame: Name of the folder of a frame.
        inner: Where in it the images lie; empty for the folder itself.
        model: Where the model lies.
        first: Number of the first frame.
    """
    write_model(folder / model, scene, MODEL_OF[lens], image_name="{}.png".format)
    for t in range(scene.n_frames):
        place = folder / frame.format(t + first) / inner
        place.mkdir(parents=True, exist_ok=True)
        for row, name in enumerate(scene.names):
            Image.fromarray(scene.picture(row, t)).save(place / f"{name}.png")
