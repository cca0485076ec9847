"""The room of the sample for captures of hundreds of frames: something moves all the time, and a parcel appears late."""

from __future__ import annotations

from dataclasses import replace

from engine.synthetic.scene import SyntheticScene, make_parts, make_rig, placed, still

MOTION_FRAMES = 18
"""Frames in which the ball flies 84 degrees round the room and the sculpture turns by 80: it takes 77 to come round."""
PARCEL_AT = 0.65
"""Share of the capture after which the parcel appears. Less than half of it is left, so the background is without."""


def make_long_scene(
    *,
    size: tuple[int, int] = (160, 120),
    n_cameras: int = 12,
    n_frames: int = 300,
    clip_length: int = 10,
    fps: float = 30.0,
) -> SyntheticScene:
    """Room, furniture and cameras of the sample; the motion repeats, and the parcel appears inside a clip.

    Args:
        size: Image width and height of every camera.
        n_cameras: Cameras on the ring; two of them are held out where there are four or more.
        n_frames: Length of the capture.
        clip_length: Frames per clip of the training to come.
        fps: Frames per second.
    """
    frame_index = inside_clip(PARCEL_AT, n_frames=n_frames, clip_length=clip_length)
    parcel = still(placed(0.75, -0.7, 0.24, turn_deg=-20), from_frame=frame_index)
    parts = tuple(
        replace(part, pose=parcel) if part.name == "gift" else part for part in make_parts(clip_length=MOTION_FRAMES)
    )
    return SyntheticScene(parts, make_rig(n_cameras, size), n_frames, clip_length, fps)


def inside_clip(share: float, *, n_frames: int, clip_length: int) -> int:
    """The frame in the middle of the clip that lies at this share of the capture."""
    return int(share * n_frames) // clip_length * clip_length + clip_length // 2
