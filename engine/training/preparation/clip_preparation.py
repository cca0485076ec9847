"""The start of a clip's training: its pictures, and model, gains and backgrounds made of them.

Reference clip: `static_parts` before its first phase, `with_motion` between the phases, when the static anchors have
been trained. Source clip: `source_parts` does all of it at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from engine.backends.backend import Backend
from engine.capture.came_along import came_along
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.capture.exclusions import exclusion_key
from engine.clip_files.clip_header import ClipHeader, Coverage
from engine.clip_files.clip_state import ClipState, fingerprint_of
from engine.cloud.background.exposure import Exposure
from engine.cloud.background.motion_masks import MotionMasks
from engine.cloud.kept_results import Keep
from engine.cloud.motion.moving_cloud import MovingCloud
from engine.cloud.stereo.frames_cloud import FramesCloud
from engine.cloud.stereo.static_cloud import StaticCloud
from engine.errors import PreparationError, ProjectError
from engine.gate.regions import GateRegion
from engine.model.clip_model import ClipModel
from engine.model.clip_view import View, render_gaussians
from engine.model.host_array import host_array
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
    blank,
    correct_backgrounds,
    estimate_backgrounds,
    filled_from_render,
    frames_cloud,
    key_of_corrected,
    motion_masks,
    moving_cloud,
    read_backgrounds,
    stable_in_clip,
    static_cloud,
    without_vignetting,
    write_backgrounds,
)
from engine.training.preparation.drift import exposures_in, exposures_of, no_drift, remove_drift
from engine.training.preparation.gating import without_static_regions
from engine.training.preparation.kept_clouds import kept_cloud
from engine.training.preparation.light import brightness_in, measure_light
from engine.training.preparation.method import Method
from engine.training.preparation.stages import Stages
from engine.training.preparation.training_pictures import TrainingPictures
from engine.training.step.training_cameras import TrainingCameras

_HEADS_SEED_STEP = 7_919
"""From the seed of a clip to that of its new heads."""


@dataclass(frozen=True, slots=True)
class ClipParts:
    """A clip as it is prepared. Model and gains learn in place; the rest are values.

    Attributes:
        model: Everything that is visible in the clip.
        gains: Of the training cameras. [C, 3] float32
        drift: Exposure of each training camera in each frame against the reference clip's. [C, M, 3] float32
        backgrounds: The training cameras' pictures when nothing moves, without vignetting.
        spacing: Distance between static anchors, scene units.
        moving_spacing: Likewise of moving ones; None as long as nothing has moved.
        reasons: Of the gate, by role; empty without a decision.
        coverage: How many moving points of a source clip have an anchor near them; None for a reference clip.
        vignetting: Of the lenses, taken out of pictures and backgrounds; None where they have none. [C, 2] float32
    """

    model: ClipModel
    gains: nn.Parameter
    drift: np.ndarray
    backgrounds: Backgrounds
    spacing: float
    moving_spacing: float | None = None
    reasons: dict[str, np.ndarray] = field(default_factory=dict)
    coverage: Coverage | None = None
    vignetting: np.ndarray | None = None


@dataclass(frozen=True, slots=True)
class ClipColors:
    """How a source clip's cameras and the light on it differ from the reference clip's.

    Attributes:
        drift: Exposure of each training camera in each frame. [C, M, 3] float32
        light: Log brightness of the reference clip's static anchors at the start and the end of the clip; None where
            it is as in the reference clip, or where they are not inherited as they are. [A, 2] float32
    """

    drift: np.ndarray
    light: np.ndarray | None


class ClipPreparation:
    """Prepares one clip. See the module docstring.

    Args:
        capture: The capture at working resolution.
        clip: Frames to prepare.
        config: All numbers.
        method: All decisions.
        backend: The backend the model is made for and drawn with.
        camera_indices: Training cameras, in capture numbering.
        cameras: The same, as they are by now.
        base: The clip to inherit from; None for a reference clip.
        previous: The clip before, finished, for a method that continues from it.
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
        cameras: TrainingCameras,
        base: ClipState | None,
        previous: ClipState | None,
        regions: Sequence[GateRegion],
        seed: int,
        generator: torch.Generator,
        prep_dir: Path,
        report: ReportProgress,
    ) -> None:
        self._capture, self._clip, self._config, self._method = capture, clip, config, method
        self._camera_indices, self._cameras = list(camera_indices), cameras
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
        pictures = TrainingPictures(self._capture, self._clip, self._camera_indices, self._prep_dir)
        view = self._cameras.first_views[0]
        size_mb = len(pictures) * view.width * view.height * 3 / 1e6
        self._say("Reading pictures", f"{len(pictures)} pictures, {size_mb:.0f} MB")
        return pictures

    def static_parts(self, pictures: TrainingPictures) -> ClipParts:
        """A reference clip before its motion is known: static anchors and a fresh decoder. Removes the pictures' drift
        and vignetting.

        Raises:
            PreparationError: No static point was found.
        """
        drift, exposures = self._without_drift(pictures)
        backgrounds = self._estimated(self._clip, exposures)
        cloud = self._static_cloud(backgrounds, self._stages.keep)
        gains, vignetting = self._gains(cloud.gains), cloud.vignetting if cloud.vignetting.any() else None
        if vignetting is not None:
            pictures.remove(None, vignetting)
            backgrounds = without_vignetting(backgrounds, vignetting, self._cameras.rig)
        model = static_model(cloud, self._clip, self._config, self._backend, self._generator)
        self._say(
            "Building the static cloud", f"{len(cloud.points):,} static anchors, {cloud.spacing:.3g} scene units apart"
        )
        return ClipParts(model, gains, drift, backgrounds, float(cloud.spacing), vignetting=vignetting)

    def whole_parts(self, pictures: TrainingPictures) -> ClipParts:
        """A reference clip with cloud=frames, complete: one cloud, and all of it changes. Removes the pictures' drift.

        Raises:
            PreparationError: No point was found.
        """
        drift, exposures = self._without_drift(pictures)
        backgrounds = self._estimated(self._clip, exposures) if self._config.needs_backgrounds else blank(pictures)
        cloud = self._frames_cloud(pictures, drift)
        sizes = np.full(len(cloud.points), cloud.spacing, np.float32)
        lenses = np.zeros((len(cloud.gains), 2), np.float32)
        static = StaticCloud(cloud.points, cloud.colors, sizes, cloud.gains, cloud.spacing, lenses)
        model = static_model(static, self._clip, self._config, self._backend, self._generator)
        parts = ClipParts(model, self._gains(cloud.gains), drift, backgrounds, cloud.spacing)
        return replace(parts, reasons=self._make_dynamic(parts, cloud.spacing))

    def with_motion(self, parts: ClipParts, pictures: TrainingPictures) -> ClipParts:
        """A reference clip whose static anchors were trained, with corrected backgrounds and moving parts."""
        keep = self._keep_after(parts.model, parts.gains, parts.backgrounds)
        backgrounds = self._corrected(parts.backgrounds, parts.model, parts.gains, pictures, keep)
        parts = replace(parts, backgrounds=backgrounds)
        masks = self._motion_masks(parts, pictures)
        cloud, moving_spacing = self._moving_cloud(parts, pictures, masks)
        parts = replace(parts, backgrounds=stable_in_clip(backgrounds, pictures, masks))
        if len(cloud.points):
            parts.model.add_set("moving", moving_anchors(cloud, np.ones(len(cloud.points), bool), self._config))
        self._say("Carving what moves", f"{len(cloud.points):,} moving anchors")
        reasons = self._make_dynamic(parts, self._field_spacing(parts, cloud))
        return replace(parts, moving_spacing=moving_spacing, reasons=reasons)

    def source_parts(self, reference: ClipState, pictures: TrainingPictures) -> ClipParts:
        """A clip that starts from another trained clip. Removes the pictures' drift and vignetting.

        Raises:
            PreparationError: It needs its own static cloud and no static point was found.
            ProjectError: The reference was trained with other cameras, or the field before cannot continue.
        """
        parts = self._inherited_parts(reference, pictures)
        model, moving_spacing = parts.model, None
        if self._config.cloud == "frames":
            gains = host_array(parts.gains)
            found = self._frames_cloud(pictures, parts.drift, spacing=parts.spacing, gains=gains)
            everywhere = np.ones((len(found.points), self._clip.n_frames), bool)
            cloud = MovingCloud(found.points, found.colors, everywhere, found.spacing)
        else:
            cloud, moving_spacing = self._moving_cloud(parts, pictures, self._motion_masks(parts, pictures))
        covering = self._method.covering(model)
        coverage = add_residual(model, cloud, self._config, self._method.choose_residual, covering)
        self._method.adapt(model, self._config)
        self._say("Comparing with the reference", coverage.text)
        reasons = self._make_dynamic(parts, self._field_spacing(parts, cloud))
        return replace(parts, moving_spacing=moving_spacing, reasons=reasons, coverage=coverage)

    def measured_colors(self, reference: ClipState, pictures: TrainingPictures) -> ClipColors:
        """The colours that `source_parts` measures of a clip, without the parts it builds. Removes the pictures' drift
        and vignetting.

        Raises:
            ProjectError: The reference was trained with other cameras.
        """
        parts = self._inherited_parts(reference, pictures)
        return ClipColors(parts.drift, None if parts.model.light is None else host_array(parts.model.light))

    def _inherited_parts(self, reference: ClipState, pictures: TrainingPictures) -> ClipParts:
        """A clip that starts from another trained clip, before its moving parts are known."""
        gains = self._gains(reference.arrays["gains"].copy(), is_learning=False)
        if reference.header.camera_names != list(self._cameras.rig.names):
            raise ProjectError(
                "The training cameras differ from those of the reference clip.",
                hint="Use the same hold-out for every clip of a project.",
            )
        model = inheriting_model(reference, self._clip, self._backend, learns=self._method.learns_inherited)
        self._say("Taking over the reference", self._method.words(self._config))
        if reference.vignetting is not None:
            pictures.remove(None, reference.vignetting)
        backgrounds = blank(pictures)
        if self._config.needs_backgrounds:
            kept = read_backgrounds(self._prep_dir, self._key_of_corrected())
            backgrounds = kept or self._backgrounds_of(reference, model, gains)
        exposures = exposures_in(backgrounds.images) if self._has_drift else None
        drift = no_drift(pictures) if exposures is None else remove_drift(pictures, exposures, self._report)
        # other random starts than those of the reference clip, and of other clips
        self._method.choose_decoder(model, seed=self._seed + _HEADS_SEED_STEP * (1 + self._clip.clip_index))
        if self._method.builds_static and self._config.cloud == "frames":
            model.replace_sets({})  # everything comes from the clip's own cloud
        elif self._method.builds_static:
            own = self._static_cloud(backgrounds, self._keep_after(model, gains, backgrounds))
            model.replace_sets({"static": static_anchors(own, self._config)})
            self._say("Building the static cloud", f"{len(own.points):,} static anchors of the clip's own")
        parts = ClipParts(model, gains, drift, backgrounds, reference.header.spacing, vignetting=reference.vignetting)
        if not self._method.has_light:
            return parts
        plain = range(reference.header.start, reference.header.start + reference.header.n_frames)
        measure_light(
            model,
            pictures,
            self._cameras.rig,
            backgrounds,
            exposures,
            self._report,
            plain=plain,
            is_looking_ahead=self._config.backgrounds == "capture",
        )
        return parts

    def keep_backgrounds(self, model: ClipModel, gains: nn.Parameter, backgrounds: Backgrounds) -> None:
        """Keep a trained reference clip's backgrounds for source clips, unless they are kept already.

        Raises:
            DiskError: The disk refused.
        """
        if not self._config.needs_backgrounds:
            return
        is_valid = self._capture.valid_of(self._camera_indices)
        backgrounds = filled_from_render(backgrounds, self._render_static(model, gains), is_valid)
        key = self._key_of_corrected()
        kept = read_backgrounds(self._prep_dir, key)
        if kept is None or not kept.equals(backgrounds):
            write_backgrounds(self._prep_dir, backgrounds, key)

    def shared_backgrounds(self) -> Backgrounds | None:
        """The backgrounds that the reference clip has left for source clips; None where there are none."""
        return read_backgrounds(self._prep_dir, self._key_of_corrected())

    # ---------------------------------------------------------------- the kept parts of an attempt

    def _key(self) -> dict[str, Any]:
        """The inputs a preparation depends on, apart from those `_keep_after` adds."""

        def named(state: ClipState | None) -> str | None:
            return None if state is None else state.header.fingerprint

        excluded = exclusion_key(self._capture.exclusions, (0, self._capture.n_frames))
        return {
            "capture": self._capture.part_key,
            "size": [int(side) for side in self._cameras.rig.image_sizes[0]],
            "cameras": list(self._cameras.rig.names),
            "came_along": came_along(self._capture.layout),
            "frames": [self._clip.start, self._clip.n_frames, self._clip.clip_length],
            "config": self._config.difference(),
            "regions": [region.as_dict() for region in self._regions],
            "base": named(self._base),
            "previous": named(self._previous),
            "seed": self._seed,
            **({"excluded": excluded} if excluded else {}),
        }

    def _keep_after(self, model: ClipModel, gains: nn.Parameter, backgrounds: Backgrounds) -> Keep:
        """Keeps pieces that follow from a model as it is now, the gains and the backgrounds."""
        arrays = model.own_arrays() | {"gains": host_array(gains), "backgrounds": backgrounds.images}
        name = fingerprint_of(arrays)
        return lambda piece, work: self._stages.keep(f"{name} {piece}", work)

    def _gains(self, values: np.ndarray, *, is_learning: bool = True) -> nn.Parameter:
        tensor = torch.from_numpy(values).to(self._backend.device, self._backend.dtype)
        return nn.Parameter(tensor, requires_grad=is_learning)

    # ---------------------------------------------------------------- still parts

    @property
    def _has_drift(self) -> bool:
        return self._config.color != "off"

    def _without_drift(self, pictures: TrainingPictures) -> tuple[np.ndarray, list[Exposure] | None]:
        """Drift within a reference clip, which its pictures lose, and its exposures; None where they do not count."""
        if not self._has_drift:
            return no_drift(pictures), None
        exposures = exposures_of(pictures)
        return remove_drift(pictures, exposures, self._report), exposures

    def _estimated(self, clip: Clip, exposures: Sequence[Exposure] | None) -> Backgrounds:
        """Backgrounds as they are needed for a reference clip."""
        cameras, keep = self._camera_indices, self._stages.keep
        return estimate_backgrounds(self._capture, clip, cameras, exposures, self._config, self._report, keep)

    def _frames_cloud(
        self,
        pictures: TrainingPictures,
        drift: np.ndarray,
        *,
        spacing: float | None = None,
        gains: np.ndarray | None = None,
    ) -> FramesCloud:
        """The cloud of all frames of the clip, kept or new.

        Args:
            drift: The drift taken out of the pictures.
            spacing, gains: Of the reference clip; None for a reference clip.
        """
        rig, config, keep = self._cameras.rig, self._config, self._stages.keep

        def build() -> FramesCloud:
            return frames_cloud(pictures, rig, config, self._report, spacing=spacing, gains=gains, keep=keep)

        names = ("capture", "size", "cameras", "came_along", "frames", "excluded")
        of_clip = {name: value for name, value in self._key().items() if name in names}
        key = of_clip | {
            "poses": fingerprint_of({"poses": rig.world_to_camera, "Ks": rig.Ks}),
            "at_most": [config.max_static_points, config.max_moving_points],
            "color": config.color,
            **({"drift": fingerprint_of({"drift": drift})} if (drift != 1.0).any() else {}),
            "spacing": spacing,
            "gains": None if gains is None else gains.tolist(),
        }
        cloud = kept_cloud(self._prep_dir, self._clip.start, key, build)
        self._say("Building the cloud", f"{len(cloud.points):,} points, {cloud.spacing:.3g} scene units apart")
        return cloud

    def _backgrounds_of(self, reference: ClipState, model: ClipModel, gains: nn.Parameter) -> Backgrounds:
        """The files the reference clip left behind, made anew from its pictures where gone."""
        clip = _clip_of(reference.header)
        pictures = TrainingPictures(self._capture, clip, self._camera_indices, self._prep_dir)
        _, exposures = self._without_drift(pictures)
        estimated = self._estimated(clip, exposures)
        if reference.vignetting is not None:
            pictures.remove(None, reference.vignetting)
            estimated = without_vignetting(estimated, reference.vignetting, self._cameras.rig)
        keep = self._keep_after(model, gains, estimated)
        backgrounds = self._corrected(estimated, model, gains, pictures, keep)
        seen = stable_in_clip(backgrounds, pictures, motion_masks(pictures, backgrounds, None, self._report))
        return filled_from_render(seen, self._render_static(model, gains), pictures.is_valid)

    def _corrected(
        self,
        backgrounds: Backgrounds,
        model: ClipModel,
        gains: nn.Parameter,
        pictures: TrainingPictures,
        keep: Keep,
    ) -> Backgrounds:
        return correct_backgrounds(backgrounds, pictures, self._render_static(model, gains), self._report, keep)

    def _render_static(self, model: ClipModel, gains: nn.Parameter) -> Callable[[int], np.ndarray]:
        """Camera row to the static anchors alone in that camera's colours. [H, W, 3] float32 in 0..1"""
        return lambda camera_row: _render_static(model, self._cameras.view(camera_row), gains[camera_row])

    def _key_of_corrected(self) -> dict:
        header = None if self._base is None else self._base.header
        clip = self._clip if header is None else _clip_of(header)
        return key_of_corrected(self._capture, clip, self._camera_indices, self._config)

    def _static_cloud(self, backgrounds: Backgrounds, keep: Keep) -> StaticCloud:
        is_valid = self._capture.valid_of(self._camera_indices)
        layout = self._capture.layout
        cloud = static_cloud(backgrounds, self._cameras.rig, is_valid, self._config, self._report, keep, layout)
        if len(cloud.points) == 0:
            raise PreparationError(
                "No static point was found by any two cameras.",
                hint="Check the calibration: poses must be world to camera, in OpenCV axes.",
                path=self._capture.path,
            )
        return cloud

    # ---------------------------------------------------------------- moving parts

    def _motion_masks(self, parts: ClipParts, pictures: TrainingPictures) -> MotionMasks:
        """The moving pixels of each picture."""
        keep = self._keep_after(parts.model, parts.gains, parts.backgrounds)
        brightness = brightness_in(parts.model, self._cameras.views) if parts.model.has_light else None
        return motion_masks(pictures, parts.backgrounds, brightness, self._report, keep)

    def _moving_cloud(
        self, parts: ClipParts, pictures: TrainingPictures, masks: MotionMasks
    ) -> tuple[MovingCloud, float | None]:
        """The moving points, and the spacing of moving anchors."""
        static_points = host_array(parts.model.anchor_set("static").positions)
        keep = self._keep_after(parts.model, parts.gains, parts.backgrounds)
        gains = host_array(parts.gains)
        voxel_size = None if self._base is None else self._base.header.moving_spacing
        cloud = moving_cloud(
            pictures,
            masks,
            self._cameras.rig,
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

    def _field_spacing(self, parts: ClipParts, cloud: MovingCloud) -> float:
        has_promoted = {"promoted", "replacing"} & set(parts.model.roles())
        return parts.spacing if has_promoted and len(cloud.points) == 0 else float(cloud.spacing)

    def _make_dynamic(self, parts: ClipParts, spacing: float) -> dict[str, np.ndarray]:
        """Last step: the gate and the field. Returns the reasons of the gate.

        Args:
            spacing: Distance between anchors that change, scene units.
        """
        model, config = parts.model, self._config
        reasons, said = self._method.gate(model, self._regions, is_source=self._base is not None)
        if said:
            self._say("Deciding what is static", said)
        made = self._method.attach_field(
            model, self._clip, config, spacing=spacing, previous=self._previous, generator=self._generator
        )
        self._say("Sizing the field", made)
        return reasons

    def _say(self, stage: str, message: str) -> None:
        self._report(Progress(stage, 1.0, message))


def _clip_of(header: ClipHeader) -> Clip:
    return Clip(header.clip_index, header.start, header.n_frames, header.clip_length)


def _render_static(model: ClipModel, view: View, gain: torch.Tensor) -> np.ndarray:
    """The static anchors alone, in the camera's own colours. [H, W, 3] float32 in 0..1"""
    rows = {role: torch.zeros(0, dtype=torch.int64, device=model.backend.device) for role in model.roles()}
    rows["static"] = torch.arange(len(model.anchor_set("static")), device=model.backend.device)
    with torch.no_grad():
        image = render_gaussians(model.decode(0.0, rows), view, backend=model.backend).image[0]
        return host_array(image * gain)
