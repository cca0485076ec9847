"""Checkpoints: a clip's state with all that its training needs to go on exactly, bit for bit.

A checkpoint is a clip file like any other. Beside the state it holds the moments of the optimiser, the gains, the
backgrounds as they are by now, and in its header where the training stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from engine.errors import ProjectError
from engine.storage.json_files import parse_object
from engine.training.preparation.cloud_preparation import Backgrounds


@dataclass(frozen=True, slots=True)
class Place:
    """Where a training stands. A value; JSON-able field by field.

    Attributes:
        phase_index: Phase that was begun last.
        steps_in_phase: Steps done in it.
        phases: Name and number of steps of every phase; none of a phase that had nothing to learn.
        order: State of the order in which pictures are drawn.
        generator: State of the training's random numbers.
    """

    phase_index: int
    steps_in_phase: int
    phases: list[tuple[str, int]]
    order: dict
    generator: list[int]


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """What a checkpoint file holds. A value.

    Attributes:
        state: The clip, with the optimiser's arrays beside its own.
        gains: Of the training cameras, learned so far. [C, 3] float32
        backgrounds: Of the training cameras.
        place: Where the training stands.
    """

    state: ClipState
    gains: np.ndarray
    backgrounds: Backgrounds
    place: Place


def write_checkpoint(path: Path | str, checkpoint: Checkpoint) -> None:
    """Write a checkpoint, atomically and so that it outlives a power cut.

    Raises:
        DiskError: The disk refused.
    """
    place, backgrounds = checkpoint.place, checkpoint.backgrounds
    arrays = dict(checkpoint.state.arrays)
    arrays["resume.gains"] = checkpoint.gains
    arrays["resume.backgrounds"] = backgrounds.images
    arrays["resume.is_stable"] = np.packbits(backgrounds.is_stable, axis=-1)
    resume = {name: getattr(place, name) for name in Place.__dataclass_fields__}
    write_clip_state(path, ClipState(arrays, checkpoint.state.header | {"resume": resume}), is_durable=True)


def read_checkpoint(path: Path | str, expected: Mapping[str, Any]) -> Checkpoint:
    """Inverse of `write_checkpoint`.

    Args:
        path: The file.
        expected: Entries that its header must have: clip_index, camera_names, seed.
    Raises:
        ProjectError: The file is damaged, or an entry differs.
    """
    kept = read_clip_state(path)
    for key, value in expected.items():
        if kept.header.get(key) != value:
            raise ProjectError(
                f"The checkpoint has {key} {kept.header.get(key)}, the training {value}.",
                hint="Train the clip again.",
                path=path,
            )
    try:
        resume = kept.header["resume"]
        place = _place(parse_object(resume) if isinstance(resume, str) else resume)  # a text in earlier versions
        gains, images, packed = (kept.arrays[f"resume.{name}"] for name in ("gains", "backgrounds", "is_stable"))
        if images.ndim != 4 or packed.ndim != 3 or (gains.ndim, gains.dtype) != (2, np.float32):
            raise ValueError(f"gains {gains.shape}, backgrounds {images.shape}, stable pixels {packed.shape}")
        stable = np.unpackbits(packed, axis=-1, count=images.shape[2]).astype(bool)
        if images.dtype != np.uint8 or images.shape[:3] != stable.shape or len(gains) != len(images):
            raise ValueError(f"gains {gains.shape}, backgrounds {images.shape}, stable pixels {stable.shape}")
    except (KeyError, TypeError, ValueError) as error:
        raise damaged_checkpoint(error, path) from error
    floats = {name: array for name, array in kept.arrays.items() if np.issubdtype(array.dtype, np.floating)}
    odd = [name for name, array in floats.items() if not np.isfinite(array).all()]
    if odd:  # training on from here could only fail again
        raise damaged_checkpoint(ValueError(f"{odd[0]} holds numbers that are not finite"), path)
    return Checkpoint(kept, gains.copy(), Backgrounds(images, stable), place)


def damaged_checkpoint(error: Exception, path: Path | str) -> ProjectError:
    """What to raise when the content of a checkpoint cannot be used."""
    reason = f"no entry {error}" if isinstance(error, KeyError) else str(error)
    return ProjectError(f"The checkpoint is damaged or does not fit its clip ({reason}).", path=path)


def _place(resume: Any) -> Place:
    """Where a training stood, as the header has it.

    Raises:
        KeyError, TypeError, ValueError: An entry is missing or of the wrong kind.
    """
    phases = [(name, n) for name, n in resume["phases"]]
    counts = [resume["phase_index"], resume["steps_in_phase"], *(n for _, n in phases), *resume["generator"]]
    if not all(type(n) is int and n >= 0 for n in counts) or not all(type(name) is str for name, _ in phases):
        raise ValueError("phases, steps or random numbers are not counts")
    if resume["phase_index"] >= len(phases) or not isinstance(resume["order"], dict):
        raise ValueError(f"phase {resume['phase_index']} of {len(phases)}, or an order of pictures that is none")
    return Place(
        phase_index=resume["phase_index"],
        steps_in_phase=resume["steps_in_phase"],
        phases=phases,
        order=resume["order"],
        generator=resume["generator"],
    )
