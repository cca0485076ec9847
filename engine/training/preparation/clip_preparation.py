"""What a clip's training starts from: its pictures, and made of them model, gains and backgrounds.

Reference clip: `static_parts` before its first phase, `with_motion` between the phases, when the static anchors have
been trained. Source clip: `source_parts` does all of it at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from engine.backends.backend import Backend
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.clip_files.clip_header import Coverage
from engine.clip_files.clip_state import ClipState, fingerprint_of
from engine.clip_files.roles import STATIC
from engine.cloud.background.exposure import Exposure
from engine.cloud.background.light import WINDOW_FRAMES, AnchorLight, joined
from engine.cloud.keeping import Keep
from engine.cloud.motion.moving_cloud import MovingCloud
from engine.cloud.stereo.static_cloud import StaticCloud
from engine.errors import DiskError, PreparationError, ProjectError
from engine.gate.regions import GateRegion
from engine.model.clip_model import ClipModel
from engine.model.clip_view import View, render_gaussians
from engine.model.host_array import host_array
from engine.parallel import map_ordered
from engine.progress import Progress, ReportProgress
from engine.training.config import TrainConfig
from engine.training.preparation.building import (
    add_residual,
    inheriting_model,
    moving_anchors,
    static_anchors,
    static_model,
)
from engine.training.preparation.cloud_preparation import (
    Backgrounds,
    correct_backgrounds,
    estimate_backgrounds,
    key_of_corrected,
    motion_masks,
    moving_cloud,
    read_backgrounds,
    seen_still,
    static_cloud,
    write_backgrounds,
)
from engine.training.preparation.gating import without_static_regions
from engine.training.preparation.method import Method
from engine.training.preparation.stages import Stages
from engine.training.preparation.training_pictures import TrainingPictures

_DARK = 0.03
"""Sum over RGB of a render below which no brightness is told."""


@dataclass(frozen=True, slots=True)
class ClipParts:
    """A clip as it is prepared. Model and gains learn in place; the rest are values.

    Attributes:
        model: Everything that is visible in the clip.
        gains: Of the training cameras. [C, 3] float32
        drift: Exposure of each training camera in each frame against the reference clip's. [C, M, 3] float32
        backgrounds: What the training cameras see when nothing moves.
        spacing: Distance between static anchors, scene units.
        moving_spacing: Likewise of moving ones; None as long as nothing has moved.
        reasons: Of the gate, by role; empty without a decision.
        coverage: How much of what moves in a source clip has an anchor near it; None for a reference clip.
    """

    model: ClipModel
    gains: nn.Parameter
    drift: np.ndarray
    backgrounds: Backgrounds
    spacing: float
    moving_spacing: float | None = None
    reasons: dict[str, np.ndarray] = field(default_factory=dict)
    coverage: Coverage | None = None


class ClipPreparation:
    """Prepares one clip. See the module docstring.

    Args:
        capture: The capture at working resolution.
        clip: Frames to prepare.
        config: All numbers.
        method: All decisions.
        backend: What the model is made for and drawn with.
        camera_indices: Training cameras, in capture numbering.
        views: Of these cameras.
        base: What the clip inherits from; None for a reference clip.
        previous: The clip before, finished, for a method that goes on from it.
        regions: Where the user overrules the gate.
        seed: Of new decoder heads.
        generator: Draws all other initial values.
        prep_dir: Folder that keeps backgrounds between clips, and finished pieces of this preparation.
        report: Receives progress.
    """

    def __init__(
        self,
        capture: Capture,
        clip: Clip,
        config: TrainConfig,
        method: Method,
        *,
        backend: Backend,
        camera_indices: Sequence[int],
        views: Sequence[View],
        base: ClipState | None,
        previous: ClipState | None,
        regions: Sequence[GateRegion],
        seed: int,
        generator: torch.Generator,
        prep_dir: Path,
        report: ReportProgress,
    ) -> None:
        self._capture, self._clip, self._config, self._method = capture, clip, config, method
        self._camera_indices, self._views = list(camera_indices), list(views)
        self._rig = capture.rig.subset(self._camera_indices)
        self._base, self._previous, self._regions = base, previous, tuple(regions)
        self._seed, self._generator = seed, generator
        self._backend, self._prep_dir, self._report = backend, prep_dir, report
        self._stages = Stages(prep_dir, clip.clip_index, self._key(), report)

    def read_pictures(self) -> TrainingPictures:
        """The clip's pictures of the training cameras, as the cameras took them.

        Raises:
            CaptureError: They cannot be read.
        """
        self._report(Progress("Reading pictures", 0.0))
        pictures = TrainingPictures(self._capture, self._clip, self._camera_indices)
        view = self._views[0]
        size_mb = len(pictures) * view.width * view.height * 3 / 1e6
        self._say("Reading pictures", f"{len(pictures)} pictures, {size_mb:.0f} MB")
        return pictures

    def static_parts(self, pictures: TrainingPictures) -> ClipParts:
        """A reference clip before its motion is known: static anchors and a fresh decoder. Removes the pictures' drift.

        Raises:
            PreparationError: No static point was found.
        """
        exposures = self._exposures_of(map(pictures.of_camera, range(len(self._rig))))
        drift = self._remove_drift(pictures, exposures)
        backgrounds = self._estimated(exposures)
        cloud = self._static_cloud(backgrounds, self._stages.keep)
        gains = self._gains(cloud.gains)
        model = static_model(cloud, self._clip, self._config, self._backend, self._generator)
        self._say("Building the static cloud", f"{len(cloud.points)} static anchors, spacing {cloud.spacing:.4g}")
        return ClipParts(model, gains, drift, backgrounds, float(cloud.spacing))

    def with_motion(self, parts: ClipParts, pictures: TrainingPictures) -> ClipParts:
        """A reference clip whose static anchors were trained, with corrected backgrounds and what moves."""
        keep = self._keep_after(parts.model, parts.gains, parts.backgrounds)
        backgrounds = self._corrected(parts.backgrounds, parts.model, parts.gains, pictures, keep)
        parts = replace(parts, backgrounds=backgrounds)
        masks = self._motion_masks(parts, pictures)
        cloud, moving_spacing = self._moving_cloud(parts, pictures, masks)
        parts = replace(parts, backgrounds=seen_still(backgrounds, pictures, masks))
        try:
            self.keep_backgrounds(parts.backgrounds)
        except DiskError as error:  # clips after this one need them, this one does not: tried again at its end
            self._say("Checking backgrounds", f"{error.message} Tried again when the clip is finished")
        if len(cloud.points):
            parts.model.add_set("moving", moving_anchors(cloud, np.ones(len(cloud.points), bool), self._config))
        self._say("Carving what moves", f"{len(cloud.points)} moving anchors")
        reasons = self._make_dynamic(parts, cloud)
        return replace(parts, moving_spacing=moving_spacing, reasons=reasons)

    def source_parts(self, reference: ClipState, pictures: TrainingPictures) -> ClipParts:
        """A clip that takes over what another one has learned. Removes the pictures' drift.

        Raises:
            PreparationError: It needs a static cloud of its own and no static point was found.
            ProjectError: The reference was trained with other cameras, or the field before cannot go on.
        """
        gains = self._gains(reference.arrays["gains"].copy(), is_learning=False)
        if reference.header.camera_names != list(self._rig.names):
            raise ProjectError(
                "The training cameras differ from those of the reference clip.",
                hint="Use the same hold-out for every clip of a project.",
            )
        model = inheriting_model(reference, self._clip, self._backend, learns=self._method.learns_inherited)
        self._say("Taking over the reference", self._method.words(self._config))
        backgrounds = read_backgrounds(self._prep_dir, self._key_of_corrected())
        if backgrounds is None:
            backgrounds = self._backgrounds_of(reference, model, gains)
        drift = self._remove_drift(pictures, [Exposure.of_background(image) for image in backgrounds.images])
        self._method.choose_decoder(model, seed=self._seed)
        if self._method.builds_static:
            own = self._static_cloud(backgrounds, self._keep_after(model, gains, backgrounds))
            model.replace_sets({"static": static_anchors(own, self._config)})
            self._say("Building the static cloud", f"{len(own.points)} static anchors of the clip's own")
        parts = ClipParts(model, gains, drift, backgrounds, reference.header.spacing)
        self._measure_light(parts, pictures)
        cloud, moving_spacing = self._moving_cloud(parts, pictures, self._motion_masks(parts, pictures))
        coverage = add_residual(model, cloud, self._config, self._method.choose_residual)
        self._method.adapt(model, self._config)
        self._say("Comparing with the reference", coverage.text)
        reasons = self._make_dynamic(parts, cloud)
        return replace(parts, moving_spacing=moving_spacing, reasons=reasons, coverage=coverage)

    def keep_backgrounds(self, backgrounds: Backgrounds) -> None:
        """Keep a reference clip's corrected backgrounds for source clips, unless they are kept already.

        Raises:
            DiskError: The disk refused.
        """
        key = self._key_of_corrected()
        kept = read_backgrounds(self._prep_dir, key)
        if kept is None or not kept.equals(backgrounds):
            write_backgrounds(self._prep_dir, backgrounds, key)

    # ---------------------------------------------------------------- what is kept of an attempt

    def _key(self) -> dict[str, Any]:
        """What a preparation depends on, apart from what `_keep_after` adds."""

        def named(state: ClipState | None) -> str | None:
            return None if state is None else state.header.fingerprint

        return {
            "capture": self._capture.fingerprint,
            "size": [int(side) for side in self._rig.image_sizes[0]],
            "cameras": list(self._rig.names),
            "frames": [self._clip.start, self._clip.n_frames, self._clip.clip_length],
            "config": self._config.difference(),
            "regions": [region.as_dict() for region in self._regions],
            "base": named(self._base),
            "previous": named(self._previous),
            "seed": self._seed,
        }

    def _keep_after(self, model: ClipModel, gains: nn.Parameter, backgrounds: Backgrounds) -> Keep:
        """Keeps what follows from a model as it is now, the gains and the backgrounds."""
        arrays = model.own_arrays() | {"gains": host_array(gains), "backgrounds": backgrounds.images}
        name = fingerprint_of(arrays)
        return lambda piece, work: self._stages.keep(f"{name} {piece}", work)

    def _gains(self, values: np.ndarray, *, is_learning: bool = True) -> nn.Parameter:
        tensor = torch.from_numpy(values).to(self._backend.device, self._backend.dtype)
        return nn.Parameter(tensor, requires_grad=is_learning)

    # ---------------------------------------------------------------- exposure

    @property
    def _has_drift(self) -> bool:
        return self._config.color != "off"

    def _exposures_of(self, frames_of_cameras: Iterable[np.ndarray]) -> list[Exposure]:
        return map_ordered(Exposure.of_frames, frames_of_cameras)

    def _remove_drift(self, pictures: TrainingPictures, exposures: Sequence[Exposure]) -> np.ndarray:
        """Brings the pictures into the exposure of the reference clip; gives the gains that they had against it."""
        n_cameras = len(self._rig)
        if not self._has_drift:
            return np.ones((n_cameras, pictures.clip.n_frames, 3), np.float32)

        def gains_of(row: int) -> np.ndarray:
            return exposures[row].gains_of(pictures.of_camera(row))

        drift = np.stack(map_ordered(gains_of, range(n_cameras)))
        pictures.remove_drift(drift)
        means = drift.mean((1, 2)) - 1.0
        said = f"{100 * means.min():+.1f} to {100 * means.max():+.1f} % against the reference clip"
        n_changed = int((drift != 1.0).any((1, 2)).sum())
        self._say("Measuring exposure", f"{said}, {n_changed} of {n_cameras} cameras" if n_changed else "as it was")
        return drift

    # ---------------------------------------------------------------- light

    def _measure_light(self, parts: ClipParts, pictures: TrainingPictures) -> None:
        """Gives a model whose static anchors never change the light on them at the start and the end of the clip."""
        model = parts.model
        if not model.is_constant(STATIC):
            return
        points = host_array(model.anchor_set(STATIC).positions).astype(np.float64)
        exposures = [Exposure.of_background(image) for image in parts.backgrounds.images]
        measure = AnchorLight(points, self._rig, parts.backgrounds.images)

        def light_in(first: int, stop: int) -> np.ndarray:
            return measure.at(self._frames_in(range(first, stop), pictures, exposures))

        start, stop = self._clip.start, self._clip.stop
        first, last = light_in(start, start + WINDOW_FRAMES), light_in(stop - WINDOW_FRAMES, stop)
        before = light_in(start - WINDOW_FRAMES, start) if start > 0 else first
        after = light_in(stop, stop + WINDOW_FRAMES) if stop < self._capture.n_frames else last
        logs = np.stack([joined(before, first, own=first), joined(last, after, own=last)], axis=1)
        share = 100 * (logs != 0).any(1).mean()
        if share:
            model.light = torch.from_numpy(logs)
        self._say("Measuring light", f"on {share:.1f} % of the static anchors other than in the reference clip")

    def _frames_in(
        self, frames: range, pictures: TrainingPictures, exposures: Sequence[Exposure]
    ) -> Callable[[int], list[np.ndarray]]:
        """Camera row to its pictures of some frames, as far as the capture has them, in the backgrounds' exposure."""
        clip = self._clip.frame_indices()
        inside = [index for index in frames if index in clip]
        outside = [index for index in frames if index not in clip and 0 <= index < self._capture.n_frames]

        def frames_of(row: int) -> list[np.ndarray]:
            own = [pictures.picture(row, index - self._clip.start) for index in inside]
            if not outside:
                return own
            others = self._capture.frames_of(self._camera_indices[row], outside)
            return [*own, *(exposures[row].applied_to(others) if self._has_drift else others)]

        return frames_of

    # ---------------------------------------------------------------- what does not move

    def _estimated(self, exposures: Sequence[Exposure]) -> Backgrounds:
        keep = self._stages.keep
        known = exposures if self._has_drift else [None] * len(exposures)
        return estimate_backgrounds(self._capture, self._camera_indices, known, self._config, self._report, keep)

    def _backgrounds_of(self, reference: ClipState, model: ClipModel, gains: nn.Parameter) -> Backgrounds:
        """What the reference clip left behind, made anew from its pictures where it is gone."""
        header = reference.header
        clip = Clip(header.clip_index, header.start, header.n_frames, header.clip_length)
        pictures = TrainingPictures(self._capture, clip, self._camera_indices)
        exposures = self._exposures_of(map(pictures.of_camera, range(len(self._rig))))
        drift = self._remove_drift(pictures, exposures)
        estimated = self._estimated(exposures)
        keep = self._keep_after(model, gains, estimated)
        backgrounds = self._corrected(estimated, model, gains, pictures, keep)
        parts = ClipParts(model, gains, drift, backgrounds, header.spacing)
        return seen_still(backgrounds, pictures, self._motion_masks(parts, pictures))

    def _corrected(
        self,
        backgrounds: Backgrounds,
        model: ClipModel,
        gains: nn.Parameter,
        pictures: TrainingPictures,
        keep: Keep,
    ) -> Backgrounds:
        def render(camera_row: int) -> np.ndarray:
            return _render_static(model, self._views[camera_row], gains[camera_row])

        return correct_backgrounds(backgrounds, pictures, render, self._report, keep)

    def _key_of_corrected(self) -> dict:
        return key_of_corrected(self._capture, self._camera_indices, self._config)

    def _static_cloud(self, backgrounds: Backgrounds, keep: Keep) -> StaticCloud:
        cloud = static_cloud(backgrounds, self._rig, self._config, self._report, keep)
        if len(cloud.points) == 0:
            raise PreparationError(
                "No static point was found by any two cameras.",
                hint="Check the calibration: poses must be world to camera, in OpenCV axes.",
                path=self._capture.path,
            )
        return cloud

    # ---------------------------------------------------------------- what moves

    def _motion_masks(self, parts: ClipParts, pictures: TrainingPictures) -> np.ndarray:
        """What moves in each picture. [M, C, H, W] bool"""
        keep = self._keep_after(parts.model, parts.gains, parts.backgrounds)
        brightness = self._brightness(parts.model) if parts.model.has_light else None
        return motion_masks(pictures, parts.backgrounds, brightness, self._report, keep)

    def _brightness(self, model: ClipModel) -> Callable[[int, int], np.ndarray]:
        """(camera row, frame in clip) -> by which factor light changes what stands still there. [H, W, 1]"""

        def at_ends(row: int) -> np.ndarray:
            return np.stack([_light_in(model, self._views[row], clip_time) for clip_time in (0.0, end)])

        end = self._clip.n_frames / self._clip.clip_length
        ends = [at_ends(row) for row in range(len(self._rig))]

        def brightness(row: int, frame_in_clip: int) -> np.ndarray:
            weights = model.light_weights(frame_in_clip / self._clip.clip_length)
            return np.tensordot(np.array(weights, np.float32), ends[row], 1)

        return brightness

    def _moving_cloud(
        self, parts: ClipParts, pictures: TrainingPictures, masks: np.ndarray
    ) -> tuple[MovingCloud, float | None]:
        """What moves, and the spacing of moving anchors."""
        static_points = host_array(parts.model.anchor_set("static").positions)
        keep = self._keep_after(parts.model, parts.gains, parts.backgrounds)
        gains = host_array(parts.gains)
        voxel_size = None if self._base is None else self._base.header.moving_spacing
        cloud = moving_cloud(
            pictures,
            masks,
            self._rig,
            gains,
            static_points,
            self._config,
            self._report,
            voxel_size=voxel_size,
            keep=keep,
        )
        moving_spacing = float(cloud.spacing) if len(cloud.points) else voxel_size
        if self._method.obeys_regions:
            cloud = without_static_regions(cloud, self._regions)
        return cloud, moving_spacing

    def _make_dynamic(self, parts: ClipParts, cloud: MovingCloud) -> dict[str, np.ndarray]:
        """Last step: the gate and the field. Returns the reasons of the gate."""
        model, config = parts.model, self._config
        reasons, said = self._method.gate(model, self._regions, is_source=self._base is not None)
        if said:
            self._say("Deciding what is static", said)
        has_promoted = {"promoted", "replacing"} & set(model.roles())
        spacing = parts.spacing if has_promoted and len(cloud.points) == 0 else float(cloud.spacing)
        made = self._method.attach_field(
            model, self._clip, config, spacing=spacing, previous=self._previous, generator=self._generator
        )
        self._say("Sizing the field", made)
        return reasons

    def _say(self, stage: str, message: str) -> None:
        self._report(Progress(stage, 1.0, message))


def _light_in(model: ClipModel, view: View, clip_time: float) -> np.ndarray:
    """By which factor light changes what a view sees of the static anchors. [H, W, 1] float32"""
    with torch.no_grad():
        plain, lit = (
            host_array(render_gaussians(gaussians, view, backend=model.backend).image[0]).sum(-1, keepdims=True)
            for gaussians in (model.constant_gaussians(STATIC), model.lit_gaussians(STATIC, clip_time))
        )
    return np.where(plain > _DARK, lit / np.maximum(plain, _DARK), 1.0).astype(np.float32)


def _render_static(model: ClipModel, view: View, gain: torch.Tensor) -> np.ndarray:
    """The static anchors alone, in the camera's own colours. [H, W, 3] float32 in 0..1"""
    rows = {role: torch.zeros(0, dtype=torch.int64, device=model.backend.device) for role in model.roles()}
    rows["static"] = torch.arange(len(model.anchor_set("static")), device=model.backend.device)
    with torch.no_grad():
        image = render_gaussians(model.decode(0.0, rows), view, backend=model.backend).image[0]
        return host_array(image * gain)
