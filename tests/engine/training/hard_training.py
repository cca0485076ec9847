"""Hard scenes trained for real, at tiny sizes, and what a user would see of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numba
import numpy as np
import torch

from engine.backends.table import backend_called
from engine.capture.capture import Capture
from engine.capture.clip import split_clips
from engine.clip_files.clip_state import ClipState, read_clip_state
from engine.clip_files.compact import write_compact_clip
from engine.images.psnr import psnr_of, squared_error
from engine.metrics.clips.trained_clip import TrainedClip
from engine.model.clip_view import View, render_gaussians
from engine.model.reading import load_clip_model
from engine.progress import Progress
from engine.training.clip_training import ClipTraining
from engine.training.config import TrainConfig
from engine.training.variants.variant_method import method_of
from tests.engine.training.hard_stage import HELD_OUT, N_CAMERAS, HardScene

SIZES: dict[str, Any] = {
    "static_steps": 160,
    "joint_steps": 160,
    "source_steps": 160,
    "max_static_points": 800,
    "max_moving_points": 800,
    "head_hidden": 16,
    "field_hidden": 16,
}
STATIC_ONLY = -1  # in the place of a frame


@dataclass
class Trained:
    """The clips of a scene as stored and read back, trained one after another.

    Attributes:
        states: One per clip.
        trainings: Their trainings, finished.
        said: What preparing each clip reported, by stage.
    """

    scene: HardScene
    capture: Capture
    folder: Path
    settings: dict[str, Any]
    states: list[ClipState] = field(default_factory=list)
    trainings: list[ClipTraining] = field(default_factory=list)
    said: list[dict[str, str]] = field(default_factory=list)
    _clips: dict[int, TrainedClip] = field(default_factory=dict, init=False)
    _pictures: dict[tuple[int, int], np.ndarray] = field(default_factory=dict, init=False)

    def training(self, clip_index: int, **settings: Any) -> ClipTraining:
        """A training of a clip that is not prepared yet; clip 0 is the reference."""
        said: dict[str, str] = {}

        def note(progress: Progress) -> None:
            if progress.message:
                said[progress.stage] = progress.message

        self.said.append(said)
        return ClipTraining(
            self.capture,
            split_clips(self.scene.n_frames, self.scene.clip_length)[clip_index],
            config=(config := TrainConfig(**(SIZES | self.settings | settings))),
            method=method_of(config, previous=None),
            holdout=[HELD_OUT],
            reference=self.states[0] if clip_index else None,
            seed=0,
            prep_dir=self.folder,
            report=note,
            backend=backend_called("cpu"),
        )

    def train(self, clip_index: int, **settings: Any) -> ClipState:
        """Train a clip, store it, and read it back."""
        training = self.training(clip_index, **settings)
        training.prepare()
        while not training.is_finished:
            training.step()
        path = self.folder / f"clip{clip_index}.safetensors"
        write_compact_clip(path, training.finish())
        self.trainings.append(training)
        return read_clip_state(path)

    def n_bytes(self, clip_index: int) -> int:
        """Of a stored clip."""
        return (self.folder / f"clip{clip_index}.safetensors").stat().st_size

    def truth(self, camera: int, frame: int) -> np.ndarray:
        """[H, W, 3] in 0..1"""
        return self.capture.frame(camera, frame) / 255.0

    def picture(self, camera: int, frame: int) -> np.ndarray:
        """What the window would show through a camera at a frame of the capture. [H, W, 3]"""
        if (camera, frame) not in self._pictures:
            clip_index, frame_in_clip = divmod(frame, self.scene.clip_length)
            clip_time = frame_in_clip / self.scene.clip_length
            with one_thread():
                self._pictures[camera, frame] = self._clip(clip_index).picture(self.capture.rig, camera, clip_time)
        return self._pictures[camera, frame]

    def static_picture(self, camera: int) -> np.ndarray:
        """Likewise of the reference's static anchors alone, as if nothing else had been learned."""
        if (camera, STATIC_ONLY) not in self._pictures:
            with one_thread():
                self._pictures[camera, STATIC_ONLY] = self._render_static(camera)
        return self._pictures[camera, STATIC_ONLY]

    def _render_static(self, camera: int) -> np.ndarray:
        clip, rig = self._clip(0), self.capture.rig
        width, height = (int(v) for v in rig.image_sizes[camera])
        view = View.from_arrays(
            rig.world_to_camera[camera],
            rig.Ks[camera],
            width=width,
            height=height,
            near_plane=clip.base.header.near_plane,
        )
        rows = {role: torch.zeros(0, dtype=torch.int64) for role in clip.model.roles()}
        rows["static"] = torch.arange(len(clip.model.anchor_set("static")))
        image = render_gaussians(clip.model.decode(0.0, rows), view, backend=backend_called("cpu")).image[0].numpy()
        return clip.colors.in_camera(image, rig, camera, 0.0)

    def _clip(self, clip_index: int) -> TrainedClip:
        if clip_index not in self._clips:
            model = load_clip_model(self.states[clip_index], self.states[0], backend=backend_called("cpu"))
            clip = split_clips(self.scene.n_frames, self.scene.clip_length)[clip_index]
            self._clips[clip_index] = TrainedClip(clip, model, self.states[0], self.states[clip_index].drift)
        return self._clips[clip_index]


def train_scene(scene: HardScene, folder: Path, *, n_clips: int | None = None, **settings: Any) -> Trained:
    """Train the clips of a scene in order, the first as the reference."""
    folder.mkdir(parents=True, exist_ok=True)
    trained = Trained(scene, scene.capture(), folder, settings)
    with one_thread():
        for clip_index in range(scene.n_clips if n_clips is None else n_clips):
            trained.states.append(trained.train(clip_index))
    return trained


@contextmanager
def one_thread() -> Iterator[None]:
    """Pictures this small gain nothing from a second thread, and lose where another process wants it too."""
    before = numba.get_num_threads(), torch.get_num_threads()
    numba.set_num_threads(1)
    torch.set_num_threads(1)
    try:
        yield
    finally:
        numba.set_num_threads(before[0])
        torch.set_num_threads(before[1])


def pooled_psnr(
    trained: Trained,
    frames: Sequence[int],
    chosen: Callable[[int, int], np.ndarray],
    *,
    cameras: Sequence[int] = range(N_CAMERAS),
    static_only: bool = False,
) -> float:
    """PSNR over the chosen pixels of all these pictures together, dB. chosen: (camera, frame) -> [H, W] bool"""
    errors = []
    for camera in cameras:
        for frame in frames:
            image = trained.static_picture(camera) if static_only else trained.picture(camera, frame)
            errors.append(squared_error(image, trained.truth(camera, frame))[chosen(camera, frame)])
    return psnr_of(np.concatenate(errors))
