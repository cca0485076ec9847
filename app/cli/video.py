"""Pictures to a video file, or to a folder of PNG files. A video appears under its name only when it is complete."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import av
import av.error
import numpy as np
from PIL import Image

from engine.errors import ProjectError
from engine.storage.files import atomic_path

CRF = "16"
"""Quality of H.264: visually lossless for most eyes."""


def write_video(path: Path, images: Iterable[np.ndarray], *, fps: float) -> int:
    """Encode pictures as H.264 in MP4; odd sizes are padded by repeating the last row or column.

    Args:
        images: [H, W, 3] uint8 RGB, all of one size, at least one.
        fps: Frames per second.
    Returns:
        Number of pictures written.
    Raises:
        ProjectError: The disk or the encoder refused.
    """
    n_images = 0
    try:
        with atomic_path(path) as partial, av.open(str(partial), "w", format="mp4") as container:
            stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
            stream.pix_fmt = "yuv420p"
            stream.options = {"crf": CRF, "preset": "medium"}
            for image in images:
                padded = np.pad(image, ((0, image.shape[0] % 2), (0, image.shape[1] % 2), (0, 0)), mode="edge")
                if n_images == 0:
                    stream.width, stream.height = padded.shape[1], padded.shape[0]
                for packet in stream.encode(av.VideoFrame.from_ndarray(padded, format="rgb24")):
                    container.mux(packet)
                n_images += 1
            for packet in stream.encode():
                container.mux(packet)
    except (OSError, av.error.FFmpegError) as error:
        raise ProjectError(
            f"The video could not be written ({error.strerror or error}).",
            hint="Check the folder and the free space.",
            path=path,
        ) from error
    return n_images


def write_pictures(folder: Path, images: Iterable[tuple[int, np.ndarray]]) -> int:
    """Write frame_000012.png and so on. Pictures that are there already are replaced one by one.

    Raises:
        ProjectError: The disk refused.
    """
    n_images = 0
    try:
        for frame_index, image in images:
            with atomic_path(folder / f"frame_{frame_index:06d}.png") as partial:
                Image.fromarray(image).save(partial, format="PNG")
            n_images += 1
    except OSError as error:
        raise ProjectError(
            f"A picture could not be written ({error.strerror or error}).",
            hint="Check the folder and the free space.",
            path=folder,
        ) from error
    return n_images
