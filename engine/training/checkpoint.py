"""Checkpoints: a clip's state with all that its training needs to continue exactly, bit for bit.

A checkpoint is a clip file like any other. Besides the state it holds the moments of the optimiser, the gains,
the present backgrounds, and in its header the place that the training has reached. Backgrounds that the reference clip
has left for all source clips are only named: they would be most of the file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from engine.clip_files.clip_header import Place
from engine.clip_files.clip_state import ClipState, fingerprint_of, read_clip_state, write_clip_state
from engine.errors import ProjectError
from engine.training.preparation.cloud_preparation import Backgrounds

_REACH = "resume.reach."
_SHARED = "resume.shared"


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """The content of a checkpoint file. A value.

    Attributes:
        state: The clip, with the optimiser's arrays next to its own.
        gains: Of the training cameras, learned so far. [C, 3] float32
        backgrounds: Of the training cameras; None where they are only named.
        place: The place that the training has reached.
        reaches: The reach expected of each anchor's Gaussians when the phase began, scene units, by role; none in
            checkpoints of earlier versions. [A] float32 each. With the motion that sets began with, see
            engine.training.step.visible_anchors.Sight.
        cameras: The learned corrections of their poses and focal lengths; None where these do not learn. [C, 7] float32
        shared: Names the backgrounds that lie elsewhere, see `name_of`; empty where the file holds them.
    """

    state: ClipState
    gains: np.ndarray
    backgrounds: Backgrounds | None
    place: Place
    reaches: Mapping[str, np.ndarray] = field(default_factory=dict)
    cameras: np.ndarray | None = None
    shared: str = ""


def name_of(backgrounds: Backgrounds) -> str:
    """A name of what backgrounds contain."""
    return fingerprint_of({"images": backgrounds.images, "is_stable": backgrounds.is_stable})


def write_checkpoint(path: Path | str, checkpoint: Checkpoint) -> None:
    """Write a checkpoint, atomically and so that it outlives a power cut.

    Raises:
        DiskError: The disk refused.
    """
    backgrounds = checkpoint.backgrounds
    arrays = dict(checkpoint.state.arrays)
    arrays["resume.gains"] = checkpoint.gains
    if checkpoint.cameras is not None:
        arrays["resume.cameras"] = checkpoint.cameras
    if backgrounds is None:
        arrays[_SHARED] = np.frombuffer(bytes.fromhex(checkpoint.shared), np.uint8)
    else:
        arrays["resume.backgrounds"] = backgrounds.images
        arrays["resume.is_stable"] = np.packbits(backgrounds.is_stable, axis=-1)
    arrays |= {f"{_REACH}{role}": reach for role, reach in checkpoint.reaches.items()}
    header = replace(checkpoint.state.header, resume=checkpoint.place)
    write_clip_state(path, ClipState(arrays, header), is_durable=True)


def read_checkpoint(
    path: Path | str, *, frames: tuple[int, int, int], camera_names: Sequence[str], seed: int
) -> Checkpoint:
    """Inverse of `write_checkpoint`.

    Args:
        path: The file.
        frames: First frame, number of frames and clip_length of the clip that continues.
        camera_names, seed: Of its training.
    Raises:
        ProjectError: The file is damaged, or of another training.
    """
    kept = read_clip_state(path)
    start, n_frames, clip_length = frames
    of_clip = (("start", start), ("n_frames", n_frames), ("clip_length", clip_length))
    for name, value in (*of_clip, ("camera_names", list(camera_names)), ("seed", seed)):
        if getattr(kept.header, name) != value:
            raise ProjectError(
                f"The checkpoint has {name} {getattr(kept.header, name)}, the training has {value}.",
                hint="Train the clip again.",
                path=path,
            )
    place = kept.header.resume
    if place is None:
        raise damaged_checkpoint(KeyError("resume"), path)
    try:
        gains, shared = kept.arrays["resume.gains"], kept.arrays.get(_SHARED)
        if (gains.ndim, gains.dtype) != (2, np.float32):
            raise ValueError(f"gains {gains.shape}")
        backgrounds = None if shared is not None else _backgrounds_in(kept.arrays, len(gains))
    except (KeyError, TypeError, ValueError) as error:
        raise damaged_checkpoint(error, path) from error
    floats = {name: array for name, array in kept.arrays.items() if np.issubdtype(array.dtype, np.floating)}
    odd = [name for name, array in floats.items() if not np.isfinite(array).all()]
    if odd:  # continuing from here could only fail again
        raise damaged_checkpoint(ValueError(f"{odd[0]} holds numbers that are not finite"), path)
    reaches = {name.removeprefix(_REACH): array.copy() for name, array in floats.items() if name.startswith(_REACH)}
    cameras = kept.arrays.get("resume.cameras")
    name = "" if shared is None else shared.tobytes().hex()
    return Checkpoint(kept, gains.copy(), backgrounds, place, reaches, cameras, name)


def _backgrounds_in(arrays: Mapping[str, np.ndarray], n_cameras: int) -> Backgrounds:
    images, packed = arrays["resume.backgrounds"], arrays["resume.is_stable"]
    if images.ndim != 4 or packed.ndim != 3:
        raise ValueError(f"backgrounds {images.shape}, stable pixels {packed.shape}")
    stable = np.unpackbits(packed, axis=-1, count=images.shape[2]).astype(bool)
    if images.dtype != np.uint8 or images.shape[:3] != stable.shape or n_cameras != len(images):
        raise ValueError(f"{n_cameras} gains, backgrounds {images.shape}, stable pixels {stable.shape}")
    return Backgrounds(images, stable)


def damaged_checkpoint(error: Exception, path: Path | str) -> ProjectError:
    """The error to raise when the content of a checkpoint cannot be used."""
    reason = f"no entry {error}" if isinstance(error, KeyError) else str(error)
    return ProjectError(f"The checkpoint is damaged or does not fit its clip ({reason}).", path=path)
