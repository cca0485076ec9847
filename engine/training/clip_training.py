"""ClipTraining: one clip from pixels to a finished ClipState, step by step.

Reference clip: "static" phase on the backgrounds, then "joint" phase on the pictures with the moving anchors added.
Source clip: one "source" phase; everything inherited is frozen, residual anchors and the clip's own field learn.
It owns model, optimiser and sampling; it has no loop, no process, no file of its own accord.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor, nn

from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.cloud.dedup import mean_neighbor_distance, residual_rows
from engine.cloud.moving_cloud import MovingCloud
from engine.cloud.range import near_plane
from engine.errors import NonFiniteLoss, PreparationError, ProjectError
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel, decoder_sizes, inherit, load_clip_model
from engine.model.clip_state import SCHEMA, ClipState, read_clip_state, write_clip_state
from engine.model.decoder import Decoder
from engine.model.field import (
    FieldShape,
    SpatioTemporalField,
    derive_cells,
    derive_log2_entries,
)
from engine.model.view import View, render_gaussians, render_model
from engine.training.config import TrainConfig
from engine.training.losses import LossWorkspace, photometric_loss
from engine.training.metrics import psnr
from engine.training.optimizer import PhaseOptimizer, named_parameters
from engine.training.pictures import (
    ShuffledOrder,
    TrainingPictures,
    shared_image_size,
    to_float,
)
from engine.training.preparation import (
    Backgrounds,
    correct_backgrounds,
    estimate_backgrounds,
    motion_masks,
    moving_cloud,
    read_backgrounds,
    static_cloud,
    write_backgrounds,
)
from engine.training.report import Progress, ReportProgress, StepStats

_REACH_SPACINGS = 4.0
"""Gaussians are expected within this many anchor spacings of their anchor when anchors are culled."""
_ALIVE_SPACINGS = 0.87
"""An inherited anchor is alive in a frame if the frame's hull surface passes within half a voxel diagonal of it."""


class ClipTraining:
    """Trains one clip. See the module docstring.

    Args:
        capture: The capture at working resolution.
        clip: Frames to train on.
        config: All numbers.
        holdout: Camera indices never looked at in training.
        reference: Finished reference clip for a source clip, None to train the reference clip itself.
        seed: Fixes initial values and the order of pictures.
        prep_dir: Folder that keeps backgrounds between clips.
        report: Receives progress of the preparation stages.
    """

    def __init__(
        self,
        capture: Capture,
        clip: Clip,
        *,
        config: TrainConfig,
        holdout: Sequence[int],
        reference: ClipState | None,
        seed: int,
        prep_dir: Path,
        report: ReportProgress,
    ) -> None:
        self.capture, self.clip, self.config, self.reference = (
            capture,
            clip,
            config,
            reference,
        )
        self.holdout = sorted(set(holdout))
        self.camera_indices = [c for c in range(len(capture.rig)) if c not in self.holdout]
        if len(self.camera_indices) < 2:
            raise PreparationError(
                f"Only {len(self.camera_indices)} of {len(capture.rig)} cameras are left for training; two are needed.",
                hint="Hold out fewer cameras.",
                path=capture.path,
            )
        self.seed, self.prep_dir, self.report = seed, Path(prep_dir), report
        self.width, self.height = shared_image_size(capture)
        self.rig = capture.rig.subset(self.camera_indices)
        self.near_plane = float(near_plane(self.rig)) if reference is None else reference.header["near_plane"]
        n_pictures = len(self.camera_indices) * clip.n_frames
        if reference is None:
            self.phases = [
                ("static", config.n_static_steps(len(self.camera_indices))),
                ("joint", config.n_joint_steps(n_pictures)),
            ]
        else:
            self.phases = [("source", config.n_source_steps(n_pictures))]
        self.steps_done = 0
        self.moving_spacing: float | None = None
        self._generator = torch.Generator().manual_seed(seed)
        self._views = [self._view(camera) for camera in range(len(capture.rig))]
        self._workspace = LossWorkspace(self.height, self.width)
        self._static_sight: dict[tuple[str, int], Tensor] = {}
        self._metrics: dict[str, float] = {}

    # ---------------------------------------------------------------- where we are

    @property
    def n_steps(self) -> int:
        """Steps of all phases together."""
        return sum(n for _, n in self.phases)

    @property
    def is_finished(self) -> bool:
        """Whether every step was done."""
        return self.steps_done >= self.n_steps

    def _phase_at(self, step: int) -> tuple[int, int]:
        """Phase index and steps done inside it."""
        for index, (_, n) in enumerate(self.phases):
            if step < n or index == len(self.phases) - 1:
                return index, step
            step -= n
        raise AssertionError("a training has at least one phase")

    # ---------------------------------------------------------------- preparation

    def prepare(self) -> None:
        """Load pictures and build what the first phase needs.

        Raises:
            PreparationError, CaptureError: Clouds cannot be built or pictures cannot be read.
        """
        torch.manual_seed(self.seed)
        self._load_pictures()
        if self.reference is None:
            self._prepare_static()
        else:
            self._prepare_source(self.reference)
        self._start_phase(0, 0)

    def _load_pictures(self) -> None:
        self.report(Progress("Reading pictures", 0.0))
        self.pictures = TrainingPictures(self.capture, self.clip, self.camera_indices)
        size_mb = len(self.pictures) * self.width * self.height * 3 / 1e6
        self.report(
            Progress(
                "Reading pictures",
                1.0,
                f"{len(self.pictures)} pictures, {size_mb:.0f} MB",
            )
        )

    def _background_key(self, *, is_corrected: bool) -> dict:
        return {
            "capture": self.capture.fingerprint,
            "cameras": list(self.rig.names),
            "size": [self.width, self.height],
            "frames": self.config.background_frames,
            "is_corrected": is_corrected,
        }

    def _prepare_static(self) -> None:
        self.backgrounds = estimate_backgrounds(self.capture, self.camera_indices, self.config, self.report)
        cloud = static_cloud(self.backgrounds, self.rig, self.config, self.report)
        if len(cloud.points) == 0:
            raise PreparationError(
                "No static point was found by any two cameras.",
                hint="Check the calibration: poses must be world to camera, in OpenCV axes.",
                path=self.capture.path,
            )
        self.spacing = float(cloud.spacing)
        self.gains = nn.Parameter(torch.from_numpy(cloud.gains).float())
        anchors = AnchorSet.from_cloud(
            torch.from_numpy(cloud.points),
            torch.from_numpy(cloud.colors),
            spacing=self.spacing,
            feature_dim=self.config.static_feature_dim,
            presence=None,
        )
        decoder = Decoder(
            static_dim=self.config.static_feature_dim,
            dynamic_dim=self.config.dynamic_feature_dim,
            gaussians_per_anchor=self.config.gaussians_per_anchor,
            hidden=self.config.head_hidden,
            generator=self._generator,
        )
        self.model = self._new_model({"static": anchors}, decoder)
        self.report(
            Progress(
                "Building the static cloud",
                1.0,
                f"{len(anchors)} static anchors, spacing {self.spacing:.4g}",
            )
        )

    def _new_model(self, sets: dict[str, AnchorSet], decoder: Decoder) -> ClipModel:
        return ClipModel(
            sets=sets,
            decoder=decoder,
            field=None,
            clip_length=self.clip.clip_length,
            n_frames=self.clip.n_frames,
        )

    def _find_motion(self, *, static_points: np.ndarray) -> MovingCloud:
        masks = motion_masks(self.pictures, self.backgrounds, self.report)
        gains = self.gains.detach().numpy()
        voxel_size = None if self.reference is None else self.reference.header["moving_spacing"]
        cloud = moving_cloud(
            self.pictures, masks, self.rig, gains, static_points, self.config, self.report, voxel_size=voxel_size
        )
        self.moving_spacing = float(cloud.spacing) if len(cloud.points) else voxel_size
        return cloud

    def _add_moving(self) -> None:
        """Between the phases of a reference clip: corrected backgrounds, motion, moving anchors, field."""
        self.backgrounds = correct_backgrounds(self.backgrounds, self.pictures, self._render_static, self.report)
        write_backgrounds(self.prep_dir, self.backgrounds, self._background_key(is_corrected=True))
        cloud = self._find_motion(static_points=self.model.anchor_set("static").positions.numpy())
        if len(cloud.points):
            self.model.add_set(
                "moving",
                self._anchors_on(cloud.points, cloud.colors, cloud.presence, cloud.spacing),
            )
        self._ungate()
        self._attach_field(cloud.spacing)
        self.report(Progress("Carving what moves", 1.0, f"{len(cloud.points)} moving anchors"))

    def _anchors_on(
        self,
        points: np.ndarray,
        colors: np.ndarray,
        presence: np.ndarray,
        spacing: float,
    ) -> AnchorSet:
        return AnchorSet.from_cloud(
            torch.from_numpy(points),
            torch.from_numpy(colors),
            spacing=spacing,
            feature_dim=self.config.static_feature_dim,
            presence=torch.from_numpy(presence),
        )

    def _ungate(self) -> None:
        """gate=off, the published method: every anchor has a dynamic feature at every time."""
        if self.config.gate == "off":
            for role in self.model.roles():
                anchors = self.model.anchor_set(role)
                anchors.presence = torch.ones(len(anchors), self.clip.n_frames, dtype=torch.bool)

    def _attach_field(self, spacing: float) -> None:
        """A fresh field over the dynamic anchors that are alive in this clip; none when nothing moves."""
        parts, n_alive = [], 0
        for role in self.model.roles():
            anchors = self.model.anchor_set(role)
            if anchors.presence is not None:
                parts.append(anchors.positions[anchors.presence.any(1)])
                n_alive += int(anchors.presence.sum(0).max())
        positions = torch.cat(parts) if parts else torch.zeros(0, 3)
        if len(positions) == 0:
            return
        # percentiles, so that one stray point does not stretch the grid; beyond them positions clamp to the border
        lower, upper = (
            positions.quantile(0.005, dim=0),
            positions.quantile(0.995, dim=0),
        )
        side = max(float((upper - lower).max()), 4 * spacing) + 2 * spacing
        log2_entries = self.config.field_log2_entries or derive_log2_entries(n_alive)
        shape = FieldShape(
            n_knots=self.clip.n_frames,
            cells=derive_cells(
                side=side,
                spacing=spacing,
                base=self.config.field_base_cells,
                growth=self.config.field_growth,
                max_levels=self.config.field_max_levels,
            ),
            n_entries=2**log2_entries,
            channels=self.config.field_channels,
            hidden=self.config.field_hidden,
            feature_dim=self.config.dynamic_feature_dim,
            bounds_min=tuple((lower - spacing).tolist()),
            side=side,
        )
        self.model.attach_field(SpatioTemporalField(shape, self._generator))
        self.report(
            Progress(
                "Sizing the field",
                1.0,
                f"{len(shape.cells)} levels up to {shape.cells[-1]} cells (anchors {spacing:.3g} apart), "
                f"2^{log2_entries} entries ({n_alive} anchors alive)",
            )
        )

    def _prepare_source(self, reference: ClipState) -> None:
        self.spacing = reference.header["spacing"]
        self.gains = nn.Parameter(torch.from_numpy(reference.arrays["gains"].copy()), requires_grad=False)
        if list(reference.header["camera_names"]) != list(self.rig.names):
            raise ProjectError(
                "The training cameras differ from those of the reference clip.",
                hint="Use the same hold-out for every clip of a project.",
            )
        placeholder = {
            role: torch.zeros(
                len(reference.arrays[f"sets.{role}.positions"]),
                self.clip.n_frames,
                dtype=torch.bool,
            )
            for role in ("static", "moving")
            if f"sets.{role}.presence" in reference.arrays
        }
        sets, decoder = inherit(reference, placeholder)
        self.model = self._new_model(sets, decoder)
        known = read_backgrounds(self.prep_dir, self._background_key(is_corrected=True))
        if known is None:
            raw = estimate_backgrounds(self.capture, self.camera_indices, self.config, self.report)
            known = correct_backgrounds(raw, self.pictures, self._render_static, self.report)
        self.backgrounds = known
        cloud = self._find_motion(static_points=self.model.anchor_set("static").positions.numpy())
        self._inherit_motion(cloud)
        self._ungate()
        self._attach_field(cloud.spacing)

    def _inherit_motion(self, cloud: MovingCloud) -> None:
        """Split the clip's moving points into those the reference covers and residual anchors."""
        is_new = np.ones(len(cloud.points), bool)
        if "moving" in self.model.roles() and len(cloud.points):
            moving = self.model.anchor_set("moving")
            centers = moving.positions.numpy()
            is_new = residual_rows(cloud.points, centers, mean_neighbor_distance(centers, k=3))
            presence = np.zeros((len(centers), self.clip.n_frames), bool)
            for frame in range(self.clip.n_frames):
                surface = cloud.points[cloud.presence[:, frame]]
                if len(surface):
                    distance, _ = KDTree(surface).query(centers, distance_upper_bound=_ALIVE_SPACINGS * cloud.spacing)
                    presence[:, frame] = np.isfinite(distance)
            moving.presence = torch.from_numpy(presence)
        n_new, n_all = int(is_new.sum()), len(cloud.points)
        if n_new:
            residual = self._anchors_on(
                cloud.points[is_new],
                cloud.colors[is_new],
                cloud.presence[is_new],
                cloud.spacing,
            )
            self._start_like_neighbors(residual)
            self.model.add_set("residual", residual)
        share = 100 * n_new / max(n_all, 1)
        self.report(
            Progress(
                "Comparing with the reference",
                1.0,
                f"{n_new} of {n_all} moving points ({share:.0f} %) lie outside the inherited anchors: residual anchors",
            )
        )

    def _start_like_neighbors(self, residual: AnchorSet) -> None:
        """Residual anchors begin with the look of the nearest inherited moving anchor: frozen heads know it."""
        if "moving" not in self.model.roles():
            return
        moving = self.model.anchor_set("moving")
        _, nearest = KDTree(moving.positions.numpy()).query(residual.positions.numpy())
        with torch.no_grad():
            rows = torch.from_numpy(nearest)
            residual.features.copy_(moving.features[rows])
            residual.log_offset_scales.copy_(moving.log_offset_scales[rows])
            residual.log_base_scales.copy_(moving.log_base_scales[rows])

    # ---------------------------------------------------------------- steps

    def _start_phase(self, index: int, steps_in_phase: int) -> None:
        name, n_steps = self.phases[index]
        self.gains.requires_grad_(self.reference is None)
        parameters = named_parameters(self.model, self.gains, self.config)
        self._optimizer = PhaseOptimizer(parameters, n_steps=n_steps, config=self.config)
        self._optimizer.steps_done = steps_in_phase
        n_items = len(self.camera_indices) if name == "static" else len(self.pictures)
        self._order = ShuffledOrder(n_items, seed=self.seed + index)
        self._phase_index = index
        if not parameters:  # nothing to learn, as in a source clip in which nothing moves
            self.phases[index] = (name, steps_in_phase)

    def step(self) -> StepStats:
        """Draw a picture, render it, compare, update.

        Raises:
            NonFiniteLoss: The loss or a gradient is not finite; the model is as it was before this step.
        """
        index, _ = self._phase_at(self.steps_done)
        if index != self._phase_index:
            self._add_moving()
            self._start_phase(index, 0)
        stage = self.phases[index][0]
        item = self._order.draw()
        if stage == "static":
            camera_row, clip_time = item, 0.0
            truth = to_float(self.backgrounds.images[camera_row])
        else:
            camera_row, frame = divmod(item, self.clip.n_frames)
            clip_time = frame / self.clip.clip_length
            truth = self.pictures.truth(camera_row, frame)
        view = self._views[self.camera_indices[camera_row]]
        gaussians = self.model.decode(clip_time, self._rows(camera_row, clip_time))
        image = render_gaussians(gaussians, view).image[0] * self.gains[camera_row]
        if stage == "static":  # unstable pixels count as right: no loss, no gradient
            image = torch.where(
                torch.from_numpy(self.backgrounds.is_stable[camera_row])[..., None],
                image,
                truth,
            )
        loss = photometric_loss(image, truth, ssim_weight=self.config.ssim_weight, workspace=self._workspace)
        if self.config.volume_weight and len(gaussians):
            volume = (gaussians.scales / self.spacing).prod(1).mean()
            loss = loss + self.config.volume_weight * volume
        value = float(loss.detach())
        where = f"step {self.steps_done + 1}, camera {self.rig.names[camera_row]}"
        if not np.isfinite(value):
            raise NonFiniteLoss(
                f"The loss became {value} at {where}.",
                hint="The last good state was kept.",
            )
        if loss.requires_grad:
            loss.backward()
        try:
            self._optimizer.step()
        except NonFiniteLoss as error:
            raise NonFiniteLoss(f"{error.message} ({where})", hint="The last good state was kept.") from error
        self.steps_done += 1
        mean_square = float(torch.mean((image.detach() - truth) ** 2))
        return StepStats(
            step=self.steps_done,
            n_steps=self.n_steps,
            loss=value,
            train_psnr=-10.0 * float(np.log10(max(mean_square, 1e-10))),
            n_gaussians=len(gaussians),
            stage=stage,
        )

    def _rows(self, camera_row: int, clip_time: float) -> dict[str, Tensor]:
        """Rows to decode for a training view; what a camera can see of fixed anchors never changes."""
        rows = {}
        for role in self.model.roles():
            key = (role, camera_row)
            if key not in self._static_sight:
                view = self._views[self.camera_indices[camera_row]]
                positions = self.model.anchor_set(role).positions
                self._static_sight[key] = view.sees(positions, reach=self._reach)
            is_seen = self._static_sight[key]
            presence = self.model.anchor_set(role).presence
            if presence is not None:
                frames = [knot for knot, _ in self.model.knots(clip_time)]
                is_seen = is_seen & presence[:, frames].any(1)
            rows[role] = is_seen.nonzero()[:, 0]
        return rows

    @property
    def _reach(self) -> float:
        return _REACH_SPACINGS * self.spacing

    def _view(self, camera: int) -> View:
        rig = self.capture.rig
        return View.from_arrays(
            rig.world_to_camera[camera],
            rig.Ks[camera],
            width=self.width,
            height=self.height,
            near_plane=self.near_plane,
        )

    def _render_static(self, camera_row: int) -> np.ndarray:
        """The static anchors alone, in the camera's own colours. [H, W, 3] float32 in 0..1"""
        view = self._views[self.camera_indices[camera_row]]
        rows = {role: torch.zeros(0, dtype=torch.int64) for role in self.model.roles()}
        rows["static"] = torch.arange(len(self.model.anchor_set("static")))
        with torch.no_grad():
            image = render_gaussians(self.model.decode(0.0, rows), view).image[0]
            return (image * self.gains[camera_row]).numpy()

    # ---------------------------------------------------------------- what came of it

    def held_out_psnr(self, *, n_pictures: int = 3) -> float:
        """Mean PSNR of a few held-out pictures in raw colours, dB; NaN without held-out cameras."""
        values = []
        for i, camera in enumerate(self.holdout[:n_pictures]):
            frame = self.clip.start + (i * self.clip.n_frames) // max(len(self.holdout[:n_pictures]), 1)
            image = render_model(
                self.model,
                self._views[camera],
                self.clip.clip_time(frame),
                reach=self._reach,
            )
            values.append(psnr(image.numpy(), self.capture.frame(camera, frame) / 255.0))
        return float(np.mean(values)) if values else float("nan")

    def state(self) -> ClipState:
        """Snapshot of everything the clip owns. Copies, so that training can go on."""
        arrays = self.model.own_arrays()
        header = {
            "schema": SCHEMA,
            "role": "reference" if self.reference is None else "source",
            "clip_index": self.clip.clip_index,
            "clip_length": self.clip.clip_length,
            "n_frames": self.clip.n_frames,
            "start": self.clip.start,
            "step": self.steps_done,
            "n_steps": self.n_steps,
            "seed": self.seed,
            "config": self.config.difference(),
            "camera_names": list(self.rig.names),
            "near_plane": self.near_plane,
            "spacing": self.spacing,
            "moving_spacing": self.moving_spacing,
            "decoder": decoder_sizes(self.model.decoder),
            "field": None if self.model.field is None else self.model.field.shape.as_dict(),
            "metrics": dict(self._metrics),
        }
        if self.reference is None:
            arrays["gains"] = self.gains.detach().numpy().copy()
        else:
            header["reference_fingerprint"] = self.reference.header["fingerprint"]
        state = ClipState(arrays, header)
        header["fingerprint"] = state.fingerprint
        return state

    def write_checkpoint(self, path: Path | str) -> None:
        """State, optimiser, order of pictures and random state: enough to go on exactly."""
        state = self.state()
        index, in_phase = self._phase_at(self.steps_done)
        resume = {
            "phase_index": self._phase_index,
            "steps_in_phase": in_phase if index == self._phase_index else self.phases[self._phase_index][1],
            "phases": self.phases,
            "order": self._order.state(),
            "generator": self._generator.get_state().numpy().tolist(),
        }
        arrays = state.arrays | self._optimizer.arrays()
        arrays["resume.gains"] = self.gains.detach().numpy().copy()
        arrays["resume.backgrounds"] = self.backgrounds.images
        arrays["resume.is_stable"] = np.packbits(self.backgrounds.is_stable, axis=-1)
        write_clip_state(path, ClipState(arrays, state.header | {"resume": json.dumps(resume)}))

    def restore_checkpoint(self, path: Path | str) -> None:
        """Go on from a checkpoint instead of `prepare`.

        Raises:
            ProjectError: The checkpoint is damaged or belongs to another clip, reference or set of cameras.
        """
        kept = read_clip_state(path)
        expected = {
            "clip_index": self.clip.clip_index,
            "camera_names": list(self.rig.names),
            "seed": self.seed,
        }
        for key, value in expected.items():
            if kept.header.get(key) != value:
                raise ProjectError(
                    f"The checkpoint has {key} {kept.header.get(key)}, the training {value}.",
                    hint="Train the clip again.",
                    path=path,
                )
        self._load_pictures()
        resume = json.loads(kept.header["resume"])
        self.spacing, self.moving_spacing = kept.header["spacing"], kept.header["moving_spacing"]
        self.model = load_clip_model(kept, self.reference)
        self.gains = nn.Parameter(torch.from_numpy(kept.arrays["resume.gains"].copy()))
        images = kept.arrays["resume.backgrounds"]
        stable = np.unpackbits(kept.arrays["resume.is_stable"], axis=-1, count=images.shape[2]).astype(bool)
        self.backgrounds = Backgrounds(images, stable)
        self.phases = [(name, n) for name, n in resume["phases"]]
        self.steps_done = kept.header["step"]
        self._start_phase(resume["phase_index"], resume["steps_in_phase"])
        self._optimizer.restore(kept.arrays, resume["steps_in_phase"])
        self._order.restore(resume["order"])
        self._generator.set_state(torch.tensor(resume["generator"], dtype=torch.uint8))
