"""Recordings with known offsets: balls on uneven ways in front of still walls, painted in a moment."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from app.lab.synthetic.rigs import looking_at
from engine.camera.projection import to_camera
from engine.camera.rig import CameraRig
from engine.synchronisation.recording import Recording

SIZE = (160, 120)
FPS = 30.0


class Pictures:
    """Pictures in memory as a source."""

    path = Path("pictures")

    def __init__(self, frames: np.ndarray) -> None:
        self.frames = frames
        self.n_frames = len(frames)

    def read(self, frame_indices: Sequence[int]) -> Iterator[np.ndarray]:
        """[H, W, 3] uint8 each."""
        for frame_index in frame_indices:
            yield self.frames[frame_index]

    def close(self) -> None:
        """Nothing is open."""


def ring(n_cameras: int) -> CameraRig:
    """Cameras around the middle, at two heights."""
    poses = []
    for row in range(n_cameras):
        angle = 2 * np.pi * row / n_cameras
        center = np.array([2.7 * np.cos(angle), 2.7 * np.sin(angle), (1.0, 1.8)[row % 2]])
        poses.append(looking_at(center, np.array([0, 0, 0.7])))
    K = np.array([[125.0, 0, SIZE[0] / 2], [0, 125.0, SIZE[1] / 2], [0, 0, 1]])
    return CameraRig(
        tuple(f"cam{row:02d}" for row in range(n_cameras)),
        np.stack(poses),
        np.tile(K, (n_cameras, 1, 1)),
        np.tile(np.array(SIZE, dtype=np.int64), (n_cameras, 1)),
    )


def ball_centers(time_s: float, n_balls: int, seed: int) -> np.ndarray:
    """Where the balls are. [B, 3]"""
    generator = np.random.default_rng(seed)
    rates, phases = generator.uniform(0.15, 0.9, (2, n_balls, 3, 4)) * np.array([1.0, 7.0])[:, None, None, None]
    sizes = generator.uniform(0.2, 1.0, (n_balls, 3, 4))
    sizes /= sizes.sum(axis=-1, keepdims=True)
    ways = (sizes * np.sin(2 * np.pi * rates * time_s + phases)).sum(axis=-1)
    return ways * np.array([0.9, 0.9, 0.5]) + np.array([0, 0, 0.8])


def paint(rig: CameraRig, camera: int, time_s: float, wall: np.ndarray, n_balls: int = 3, seed: int = 0) -> np.ndarray:
    """What a camera sees. [H, W, 3] uint8"""
    picture = wall.copy()
    centers = to_camera(ball_centers(time_s, n_balls, seed), rig.world_to_camera[camera])
    colors = np.random.default_rng(seed + 1).uniform(0, 255, (n_balls, 3))
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    for ball in np.argsort(-centers[:, 2]):
        position, K = centers[ball], rig.Ks[camera]
        if position[2] > 0.3:
            u, v = K[0, 0] * position[0] / position[2] + K[0, 2], K[1, 1] * position[1] / position[2] + K[1, 2]
            share = np.clip(0.16 * K[0, 0] / position[2] - np.hypot(x - u, y - v) + 0.5, 0, 1)[..., None]
            picture = picture * (1 - share) + colors[ball] * share
    return picture


def made_recordings(
    rig: CameraRig,
    offsets_frames: Sequence[float] | np.ndarray,
    n_frames: int = 60,
    *,
    noise: float = 2.0,
    seed: int = 0,
) -> list[Recording]:
    """One recording per camera; its own frame = common frame + offset. Cameras differ in brightness."""
    recordings = []
    for camera, offset in enumerate(offsets_frames):
        generator = np.random.default_rng(1000 + camera)
        wall = np.kron(generator.uniform(20, 230, (SIZE[1] // 8, SIZE[0] // 8, 3)), np.ones((8, 8, 1)))
        gain = generator.uniform(0.75, 1.0)
        frames = np.stack(
            [
                paint(rig, camera, (frame - offset) / FPS, wall, seed=seed) * gain
                + generator.normal(0, noise, wall.shape)
                for frame in range(n_frames)
            ]
        )
        source = Pictures(np.clip(frames, 0, 255).astype(np.uint8))
        recordings.append(Recording(rig.names[camera], source, np.arange(n_frames) / FPS))
    return recordings


def write_sound_video(
    path: Path, sound: np.ndarray, *, rate: int = 48_000, codec: str = "aac", n_frames: int = 5, **tags: str
) -> None:
    """A video with a few black pictures and this sound, [S] -1..1; with tags."""
    with av.open(str(path), "w") as container:
        container.metadata.update(tags)
        stream: Any = container.add_stream("libx264", rate=30, options={"threads": "1"})
        stream.width, stream.height, stream.pix_fmt = 32, 32, "yuv420p"
        if "timecode" in tags:
            stream.metadata["timecode"] = tags["timecode"]
        track: Any = container.add_stream(codec, rate=rate) if len(sound) else None
        for index in range(n_frames):
            picture = av.VideoFrame.from_ndarray(np.zeros((32, 32, 3), np.uint8), format="rgb24")
            picture.pts, picture.time_base = index, Fraction(1, 30)
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
        if track is not None:
            for start in range(0, len(sound) - 1023, 1024):
                samples = (sound[start : start + 1024] * 30_000).astype(np.int16)[None]
                frame = av.AudioFrame.from_ndarray(np.ascontiguousarray(samples), format="s16", layout="mono")
                frame.sample_rate, frame.pts, frame.time_base = rate, start, Fraction(1, rate)
                container.mux(track.encode(frame))
            container.mux(track.encode())
