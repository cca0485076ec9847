"""Writes the sample capture: one H.264 file per camera and cameras.json; ground truth on request.

Byte-stable: the same versions on the same kind of processor give the same files. Colours are converted to YUV here,
not by swscale, and x264 runs single-threaded with fixed settings and without time stamps in the container. A new
Embree (Open3D) or x264 version, or a processor with other vector units, may change a ray at a triangle edge in its
last bit and with it a few bytes; the pictures stay the same to the eye and to every test.
"""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from app.lab.synthetic.raycast import SceneCamera, make_truth
from app.lab.synthetic.scene import SAMPLE_CAMERAS, SyntheticScene, make_scene
from engine.storage.files import atomic_path

logger = logging.getLogger(__name__)

CRF = 8
"""x264 quality: about 44 dB against the rendered pictures in a few MB for the whole sample."""
KEY_FRAME_EVERY = 10
"""Short groups of pictures, so that scrubbing decodes at most nine frames too many."""


def write_capture(
    out_dir: Path | str,
    *,
    size: tuple[int, int] = (320, 240),
    n_cameras: int = SAMPLE_CAMERAS,
    n_frames: int = 30,
    clip_length: int = 10,
    fps: float = 30.0,
    supersampling: int = 3,
    truth_dir: Path | str | None = None,
    report: Callable[[str], None] = logger.info,
) -> SyntheticScene:
    """Render the sample scene and write it as a capture in the `sample` layout.

    Args:
        out_dir: Made if missing; files of the same name are replaced, each at once.
        size: Image width and height.
        n_cameras: Cameras on the ring.
        n_frames: Length.
        clip_length: Frames per clip; a part appears with clip 1.
        fps: Frames per second.
        supersampling: Rays along each side of a pixel.
        truth_dir: Also write depth and part indices of every picture there.
        report: Gets one line per camera.
    Returns:
        The scene, for `make_truth` and `SceneCamera`.
    Raises:
        ValueError: A number is below 1.
    """
    scene = make_scene(size=size, n_cameras=n_cameras, n_frames=n_frames, clip_length=clip_length, fps=fps)
    write_scene(out_dir, scene, supersampling=supersampling, truth_dir=truth_dir, report=report)
    return scene


def write_scene(
    out_dir: Path | str,
    scene: SyntheticScene,
    *,
    supersampling: int = 3,
    truth_dir: Path | str | None = None,
    report: Callable[[str], None] = logger.info,
) -> None:
    """Render any scene and write it as a capture in the `sample` layout. Arguments as in `write_capture`."""
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    for camera_index, name in enumerate(scene.rig.names):
        camera = SceneCamera(scene, camera_index, supersampling=supersampling)
        path = out / f"{name}.mp4"
        write_video(path, (camera.image(frame_index) for frame_index in range(scene.n_frames)), fps=scene.fps)
        if truth_dir is not None:
            write_truth(scene, camera_index, Path(truth_dir) / name)
        report(f"{name}: {scene.n_frames} frames, {path.stat().st_size / 1000:.0f} kB")
    write_json(out / "cameras.json", cameras_document(scene))


def cameras_document(scene: SyntheticScene) -> dict[str, Any]:
    """The content of cameras.json."""
    rig = scene.rig
    return {
        "schema": 1,
        "fps": scene.fps,
        "n_frames": scene.n_frames,
        "default_holdout": list(scene.default_holdout),
        "cameras": [
            {
                "name": name,
                "file": f"{name}.mp4",
                "width": int(rig.image_sizes[i, 0]),
                "height": int(rig.image_sizes[i, 1]),
                "K": rig.Ks[i].tolist(),
                "world_to_camera": rig.world_to_camera[i].tolist(),
            }
            for i, name in enumerate(rig.names)
        ],
    }


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write JSON with each innermost list on one line, replacing the file at once."""
    text = json.dumps(document, indent=1)
    text = re.sub(r"\[\s+([^\[\]{}]*?)\s+\]", lambda row: "[" + re.sub(r",\s+", ", ", row[1]) + "]", text)
    with atomic_path(path) as partial:
        partial.write_text(text + "\n", encoding="utf-8")


def write_truth(scene: SyntheticScene, camera_index: int, folder: Path) -> None:
    """Write <frame>.npz with `depths` and `part_indices`, and parts.json with the part names, into this folder."""
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "parts.json", {"parts": [part.name for part in scene.parts]})
    for frame_index in range(scene.n_frames):
        truth = make_truth(scene, camera_index, frame_index)
        with atomic_path(folder / f"{frame_index:06d}.npz") as partial:
            np.savez_compressed(partial, depths=truth.depths, part_indices=truth.part_indices)


def write_video(path: Path, frames: Iterable[np.ndarray], *, fps: float, crf: int = CRF) -> None:
    """Encode pictures as H.264 yuv444p in mp4, replacing the file at once.

    Args:
        path: The .mp4 file.
        frames: Pictures of one size, [H, W, 3] uint8 RGB.
        fps: Frames per second.
        crf: x264 quality, lower is better.
    """
    rate = Fraction(fps).limit_denominator(1001)
    options = {"movflags": "+faststart", "fflags": "+bitexact"}
    with atomic_path(path) as partial, av.open(str(partial), "w", format="mp4", options=options) as container:
        stream: Any = None
        for index, frame in enumerate(frames):
            if stream is None:
                stream = _add_stream(container, rate, frame.shape[1], frame.shape[0], crf)
            picture = av.VideoFrame.from_ndarray(to_yuv444(frame), format="yuv444p")
            picture.pts = index
            picture.time_base = 1 / rate
            container.mux(stream.encode(picture))
        if stream is not None:
            container.mux(stream.encode())


def _add_stream(container: Any, rate: Fraction, width: int, height: int, crf: int) -> Any:
    stream = container.add_stream("libx264", rate=rate)
    stream.width, stream.height, stream.pix_fmt = width, height, "yuv444p"
    stream.options = {
        "crf": str(crf),
        "preset": "slow",
        "threads": "1",
        "g": str(KEY_FRAME_EVERY),
        "x264-params": f"keyint={KEY_FRAME_EVERY}:min-keyint={KEY_FRAME_EVERY}:scenecut=0:threads=1:bframes=0",
        "flags": "+bitexact",
    }
    context = stream.codec_context
    context.time_base = 1 / rate
    context.color_range = 1  # limited range, BT.601 matrix: what to_yuv444 computes
    context.colorspace = context.color_primaries = context.color_trc = 6
    return stream


def to_yuv444(image: np.ndarray) -> np.ndarray:
    """BT.601 limited-range YUV. Chroma keeps full resolution: halving it would cost 18 dB on these saturated edges.

    Args:
        image: [H, W, 3] uint8 RGB
    Returns:
        Planes Y, U, V, as PyAV takes them. [3, H, W] uint8
    """
    red, green, blue = np.moveaxis(image.astype(np.float64), -1, 0)
    luma = 0.299 * red + 0.587 * green + 0.114 * blue
    blueness, redness = (blue - luma) / 1.772, (red - luma) / 1.402  # each -127.5..127.5
    planes = np.stack([luma * (219 / 255) + 16, blueness * (224 / 255) + 128, redness * (224 / 255) + 128])
    return np.floor(planes + 0.5).astype(np.uint8)
