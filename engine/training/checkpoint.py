"""Checkpoints: a clip's state with all that its training needs to go on exactly, bit for bit.

A checkpoint is a clip file like any other. Beside the state it holds the moments of the optimiser, the gains, the
backgrounds as they are by now, and in its header where the training stands.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from engine.errors import ProjectError
from engine.model.clip_state import ClipState, read_clip_state, write_clip_state
from engine.training.preparation import Backgrounds


@dataclass(frozen=True, slots=True)
class Place:
    """Where a training stands. A value; JSON-able field by field.

    Attributes:
        phase_index: Phase that was begun last.
        steps_in_phase: Steps done in it.
        phases: Name and number of steps of every phase, as cut short by now.
        order: State of the order in which pictures are drawn.
        schedule: Where the present fall of the rates began; None in files of earlier versions.
        patience: State of the early stop; None without one.
        generator: State of the training's random numbers.
    """

    phase_index: int
    steps_in_phase: int
    phases: list[tuple[str, int]]
    order: dict
    schedule: list[float] | None
    patience: dict | None
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
    """Write a checkpoint, atomically."""
    place, backgrounds = checkpoint.place, checkpoint.backgrounds
    arrays = dict(checkpoint.state.arrays)
    arrays["resume.gains"] = checkpoint.gains
    arrays["resume.backgrounds"] = backgrounds.images
    arrays["resume.is_stable"] = np.packbits(backgrounds.is_stable, axis=-1)
    resume = {name: getattr(place, name) for name in Place.__dataclass_fields__}
    write_clip_state(path, ClipState(arrays, checkpoint.state.header | {"resume": json.dumps(resume)}))


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
    resume = json.loads(kept.header["resume"])
    images = kept.arrays["resume.backgrounds"]
    stable = np.unpackbits(kept.arrays["resume.is_stable"], axis=-1, count=images.shape[2]).astype(bool)
    place = Place(
        phase_index=resume["phase_index"],
        steps_in_phase=resume["steps_in_phase"],
        phases=[(name, n) for name, n in resume["phases"]],
        order=resume["order"],
        schedule=resume.get("schedule"),
        patience=resume.get("patience"),
        generator=resume["generator"],
    )
    return Checkpoint(kept, kept.arrays["resume.gains"].copy(), Backgrounds(images, stable), place)
