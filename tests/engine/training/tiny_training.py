"""Trainings of a second or less on the sample: eight cameras of 80x60, clips of four frames, a few steps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from engine.assets import asset_path
from engine.backends.table import backend_called
from engine.capture.capture import Capture, open_capture
from engine.capture.clip import Clip, split_clips
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from engine.metrics.clips.trained_clip import TrainedClip
from engine.model.reading import load_clip_model
from engine.training.clip_training import ClipTraining
from engine.training.config import TrainConfig
from engine.training.step.stepwise_phase import StepwisePhase
from engine.training.variants.variant_method import method_of
from tests.built_once import BuiltOnce

CLIP_LENGTH = 4
N_CAMERAS = 8
SIZES: dict[str, Any] = {
    "static_steps": 12,
    "joint_steps": 12,
    "source_steps": 6,
    "max_static_points": 500,
    "max_moving_points": 300,
    "background_frames": 8,
    "head_hidden": 16,
    "field_hidden": 16,
}


@dataclass(frozen=True)
class Tiny:
    """The capture, its clips, a folder for what clips share, and the trained reference clip 0.

    Attributes:
        prep_dir: Holds what the reference left there; tests that train another reference bring a folder of their own.
    """

    capture: Capture
    clips: list[Clip]
    holdout: list[int]
    prep_dir: Path
    reference: ClipState

    def training(self, clip_index: int, *, is_source: bool = True, **arguments: Any) -> ClipTraining:
        """A training of a clip. Settings of TrainConfig and arguments of ClipTraining by name."""
        names = {"reference", "previous", "prep_dir", "seed", "report", "clip", "regions", "backend"}
        given = {name: arguments.pop(name) for name in names & arguments.keys()}
        given.setdefault("reference", self.reference if is_source else None)
        given.setdefault("clip", self.clips[clip_index])
        return make_training(self.capture, self.holdout, **({"prep_dir": self.prep_dir} | given), **arguments)

    def prepared(self, clip_index: int, **arguments: Any) -> ClipTraining:
        """Likewise, prepared."""
        training = self.training(clip_index, **arguments)
        training.prepare()
        return training

    def trained(self, clip_index: int, **arguments: Any) -> ClipState:
        """Likewise, trained to the end."""
        return finish(self.prepared(clip_index, **arguments))


def make_training(capture: Capture, holdout: list[int], *, clip: Clip, **arguments: Any) -> ClipTraining:
    """A training with the sizes of this module; settings of TrainConfig by name."""
    given: dict[str, Any] = {"seed": 0, "report": lambda _: None, "previous": None, "backend": backend_called("cpu")}
    for name in ("reference", "previous", "prep_dir", "seed", "report", "regions", "backend"):
        if name in arguments:
            given[name] = arguments.pop(name)
    config = TrainConfig(**(SIZES | arguments))
    method = method_of(config, previous=given["previous"])
    return ClipTraining(capture, clip, config=config, method=method, holdout=holdout, **given)


def make_tiny(folder: Path, built_once: BuiltOnce, *, scale: float = 0.25) -> Tiny:
    """The sample, at a part of its size, with its first clip trained as the reference.

    Args:
        folder: An empty one, for the reference and what clips share.
    """
    capture = open_capture(asset_path("sample"), scale=scale)
    others = [camera for camera in range(len(capture.rig)) if camera % 5 in (1, 3, 4)]
    holdout = others[: len(capture.rig) - N_CAMERAS]
    clips = split_clips(capture.n_frames, CLIP_LENGTH)

    def train(folder: Path) -> None:
        training = make_training(capture, holdout, clip=clips[0], reference=None, prep_dir=folder / "prep")
        training.prepare()
        write_clip_state(folder / "reference.safetensors", finish(training))
        training.finish()  # keeps the backgrounds

    built_once.copy(f"tiny-{scale}", folder, train, sources=["tests/engine/training/tiny_training.py"])
    return Tiny(capture, clips, holdout, folder / "prep", read_clip_state(folder / "reference.safetensors"))


def finish(training: ClipTraining) -> ClipState:
    """Step to the end."""
    while not training.is_finished:
        training.step()
    return training.state()


def stepwise(training: ClipTraining) -> StepwisePhase:
    """The phase that a training is in, as it is done by single operations."""
    assert isinstance(training._phase, StepwisePhase)
    return training._phase


def take_steps(training: ClipTraining, n: int) -> ClipTraining:
    """Step n times."""
    for _ in range(n):
        training.step()
    return training


def picture(tiny: Tiny, state: ClipState, reference: ClipState | None, *, frame: int = 1) -> np.ndarray:
    """What a training camera sees of a saved clip, by frame in the clip. [H, W, 3] float32"""
    model = load_clip_model(state, reference, backend=backend_called("cpu"))
    base = state if reference is None or state.is_reference else reference
    return _picture(tiny, TrainedClip(tiny.clips[state.header.clip_index], model, base, state.drift), frame)


def live_picture(tiny: Tiny, training: ClipTraining, *, frame: int = 1) -> np.ndarray:
    """Likewise of the model that a training holds, before anything is saved."""
    base = training.state() if training.reference is None else training.reference
    with torch.no_grad():
        return _picture(tiny, TrainedClip(training.clip, training.model, base, training.drift), frame)


def _picture(tiny: Tiny, clip: TrainedClip, frame: int) -> np.ndarray:
    camera = next(c for c in range(len(tiny.capture.rig)) if c not in tiny.holdout)
    return clip.picture(tiny.capture.rig, camera, frame / clip.clip.clip_length)


def same_arrays(first: dict[str, np.ndarray], second: dict[str, np.ndarray]) -> bool:
    """Whether names and bits are the same."""
    return first.keys() == second.keys() and all(np.array_equal(first[name], second[name]) for name in first)
