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
from torch import Tensor, nn

from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.cloud.gains import in_gauge
from engine.cloud.gate import GateTable, measure_gate
from engine.cloud.inside import frames_inside
from engine.cloud.moving_cloud import MovingCloud
from engine.cloud.range import near_plane
from engine.cloud.regions import GateRegion
from engine.cloud.static_cloud import StaticCloud
from engine.errors import NonFiniteLoss, PreparationError, ProjectError
from engine.metrics.psnr import psnr
from engine.model.clip_model import decoder_sizes, load_clip_model, read_field
from engine.model.clip_state import SCHEMA, ClipState, read_clip_state, write_clip_state
from engine.model.compact import CompactClip, compact_clip
from engine.model.view import REACH_SPACINGS, View, render_gaussians, render_model
from engine.training.active_tiles import ActivePicture, ActiveTiles
from engine.training.building import (
    add_residual,
    choose_decoder,
    drop_inherited,
    fit_field,
    inheriting_model,
    merged,
    moving_anchors,
    n_alive,
    remove_gate,
    static_model,
)
from engine.training.config import TrainConfig
from engine.training.demotion import demote
from engine.training.fused_loss import LossWorkspace
from engine.training.gating import nothing_measured, promote, with_inside, with_regions, without_static_regions
from engine.training.half_size import HalfSize
from engine.training.held_in import MEASURE_EVERY, Patience, held_in_items, steps_to_finish
from engine.training.losses import photometric_loss
from engine.training.optimizer import PhaseOptimizer, named_parameters
from engine.training.order import ErrorOrder, Order, ShuffledOrder
from engine.training.pictures import TrainingPictures, shared_image_size
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
from engine.training.stopping import gradient_not_finite, loss_not_finite
from engine.training.volume import volume_sum


class ClipTraining:
    """Trains one clip. See the module docstring.

    Args:
        capture: The capture at working resolution.
        clip: Frames to train on.
        config: All numbers.
        holdout: Camera indices never looked at in training.
        reference: Finished reference clip for a source clip, None to train the reference clip itself, or a clip that
            shares nothing.
        previous: The clip before, finished: its field goes on with field=continue, all of it with start=previous.
        seed: Fixes initial values and the order of pictures.
        prep_dir: Folder that keeps backgrounds between clips.
        report: Receives progress of the preparation stages.
        regions: Where the user overrules the gate; later ones overrule earlier ones.
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
        previous: ClipState | None = None,
        regions: Sequence[GateRegion] = (),
    ) -> None:
        self.previous = previous
        is_streaming = reference is None and previous is not None and config.start == "previous"
        # what a clip begins with: the reference it inherits from, or the clip before when it goes on from there
        self._base = merged(previous) if is_streaming and previous is not None else reference
        self._given_config = config
        if is_streaming:  # everything that a source clip can take over, and all of it learns
            config = config.going_on()
        self.capture, self.clip, self.config, self.reference = (capture, clip, config, reference)
        self.regions = tuple(regions)
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
        self.near_plane = float(near_plane(self.rig)) if self._base is None else self._base.header["near_plane"]
        n_pictures = len(self.camera_indices) * clip.n_frames
        if self._base is None:
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
        self._sight: dict[tuple[str, int], Tensor] = {}  # rows of static sets, flags of dynamic ones
        self._tiles: ActiveTiles | None = None
        self._reasons: dict[str, np.ndarray] = {}
        self._coverage: dict[str, int | float | str] | None = None
        self._n_inside = np.zeros(0, np.int64)  # frames of each static anchor inside a hull
        n_cameras = len(self.camera_indices)
        self._held_in = held_in_items(n_cameras, clip.n_frames, seed) if config.patience else []
        self._patience: Patience | None = None

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
        if self._base is None:
            self._prepare_static()
        else:
            self._prepare_source(self._base)
        self._start_phase(0, 0)

    def _load_pictures(self) -> None:
        self.report(Progress("Reading pictures", 0.0))
        self.pictures = TrainingPictures(self.capture, self.clip, self.camera_indices)
        size_mb = len(self.pictures) * self.width * self.height * 3 / 1e6
        self._say("Reading pictures", f"{len(self.pictures)} pictures, {size_mb:.0f} MB")

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
        cloud = self._static_cloud()
        self.spacing = float(cloud.spacing)
        self.gains = nn.Parameter(torch.from_numpy(cloud.gains).float())
        self.model = static_model(cloud, self.clip, self.config, self._generator)
        self._say("Building the static cloud", f"{len(cloud.points)} static anchors, spacing {self.spacing:.4g}")

    def _static_cloud(self) -> StaticCloud:
        cloud = static_cloud(self.backgrounds, self.rig, self.config, self.report)
        if len(cloud.points) == 0:
            raise PreparationError(
                "No static point was found by any two cameras.",
                hint="Check the calibration: poses must be world to camera, in OpenCV axes.",
                path=self.capture.path,
            )
        return cloud

    def _say(self, stage: str, message: str) -> None:
        self.report(Progress(stage, 1.0, message))

    def _find_motion(self) -> MovingCloud:
        static_points = self.model.anchor_set("static").positions.numpy()
        masks = motion_masks(self.pictures, self.backgrounds, self.report)
        if self.config.gate == "images":
            self._n_inside = frames_inside(static_points, masks, self.rig)
        gains = self.gains.detach().numpy()
        voxel_size = None if self._base is None else self._base.header["moving_spacing"]
        cloud = moving_cloud(
            self.pictures, masks, self.rig, gains, static_points, self.config, self.report, voxel_size=voxel_size
        )
        self.moving_spacing = float(cloud.spacing) if len(cloud.points) else voxel_size
        return without_static_regions(cloud, self.regions) if self.config.gate != "off" else cloud

    def _add_moving(self) -> None:
        """Between the phases of a reference clip: corrected backgrounds, motion, moving anchors, field."""
        self.backgrounds = correct_backgrounds(self.backgrounds, self.pictures, self._render_static, self.report)
        write_backgrounds(self.prep_dir, self.backgrounds, self._background_key(is_corrected=True))
        cloud = self._find_motion()
        if len(cloud.points):
            self.model.add_set("moving", moving_anchors(cloud, np.ones(len(cloud.points), bool), self.config))
        self._say("Carving what moves", f"{len(cloud.points)} moving anchors")
        self._make_dynamic(cloud)

    def _decide(self, cloud: MovingCloud) -> None:
        """Static anchors that change in this clip get a dynamic feature; which, by config.gate and the regions."""
        static = self.model.anchor_set("static")
        is_measured = self.config.gate == "images"
        if static.is_dynamic or not (is_measured or self.regions):
            return  # already, where the reference has no gate
        table = self._measure(cloud) if is_measured else nothing_measured(len(static))
        table = with_regions(table, static.positions.numpy(), self.regions)
        is_source = self._base is not None
        self._reasons = {"gate.static": table.reasons}
        if not is_source or static.is_trainable:  # otherwise the inherited set keeps its rows, of which some are hidden
            role = "replacing" if is_source else "promoted"
            self._reasons = {"gate.static": table.reasons[~table.is_dynamic]}
            self._reasons |= {f"gate.{role}": table.reasons[table.is_dynamic]} if table.is_dynamic.any() else {}
        promote(self.model, table.is_dynamic, is_source=is_source)
        self._say("Deciding what is static", table.summary())

    def _measure(self, cloud: MovingCloud) -> GateTable:
        table = measure_gate(
            self.pictures.raw,
            self.clip.n_frames,
            self.backgrounds.images,
            self.rig,
            self.model.anchor_set("static").positions.numpy(),
            spacing=self.spacing,
            moving_points=cloud.points,
            presence=cloud.presence,
            moving_spacing=float(cloud.spacing),
        )
        return with_inside(table, self._n_inside, self.clip.n_frames)

    def _make_dynamic(self, cloud: MovingCloud) -> None:
        """Last step of preparation: the gate and the field."""
        if self.config.gate == "off":
            remove_gate(self.model)
        else:
            self._decide(cloud)
        if self.config.gate == "static":
            remove_gate(self.model, in_time_only=True)
        if self.config.field == "continue" and self.previous is not None and self.previous.header["field"]:
            field, index = read_field(self.previous), self.previous.header["clip_index"]
            if field.shape.n_knots < self.clip.n_frames:
                raise ProjectError(
                    f"The field of clip {index} has {field.shape.n_knots} frames, clip {self.clip.clip_index} has "
                    f"{self.clip.n_frames}, so it cannot go on there.",
                    hint="Take a clip of full length as reference, or field=per_clip.",
                )
            self.model.attach_field(field)
            self._say("Sizing the field", f"the field of clip {index} goes on")
            return
        has_promoted = {"promoted", "replacing"} & set(self.model.roles())
        spacing = self.spacing if has_promoted and len(cloud.points) == 0 else float(cloud.spacing)
        made = fit_field(self.model, spacing=spacing, config=self.config, generator=self._generator)
        self._say("Sizing the field", made)

    def _prepare_source(self, reference: ClipState) -> None:
        self.spacing = reference.header["spacing"]
        self.gains = nn.Parameter(torch.from_numpy(reference.arrays["gains"].copy()), requires_grad=False)
        if list(reference.header["camera_names"]) != list(self.rig.names):
            raise ProjectError(
                "The training cameras differ from those of the reference clip.",
                hint="Use the same hold-out for every clip of a project.",
            )
        self.model, said = inheriting_model(reference, self.clip, self.config)
        self._say("Taking over the reference", said)
        known = read_backgrounds(self.prep_dir, self._background_key(is_corrected=True))
        if known is None:
            raw = estimate_backgrounds(self.capture, self.camera_indices, self.config, self.report)
            known = correct_backgrounds(raw, self.pictures, self._render_static, self.report)
        self.backgrounds = known
        choose_decoder(self.model, self.config, seed=self.seed)
        if self.config.inherit == "off":
            own = self._static_cloud()
            drop_inherited(self.model, own, self.config)
            self._say("Building the static cloud", f"{len(own.points)} static anchors of the clip's own")
        cloud = self._find_motion()
        coverage = add_residual(self.model, cloud, self.config)
        self._coverage = coverage.as_dict()
        self._say("Comparing with the reference", coverage.text)
        self._make_dynamic(cloud)

    # ---------------------------------------------------------------- steps

    def _start_phase(self, index: int, steps_in_phase: int) -> None:
        name, n_steps = self.phases[index]
        has_gains = bool((self.gains != 1.0).any())  # all 1 where the cameras do not differ: nothing to learn
        self.gains.requires_grad_(self.reference is None and has_gains)
        parameters = named_parameters(self.model, self.gains, self.config)
        self._optimizer = PhaseOptimizer(parameters, n_steps=n_steps, config=self.config)
        self._optimizer.steps_done = steps_in_phase
        is_static = name == "static"
        kept_out = set() if is_static else set(self._held_in)
        n_all = len(self.camera_indices) if is_static else len(self.pictures)
        self._items = [item for item in range(n_all) if item not in kept_out]
        self._patience = Patience(self.config.patience) if kept_out else None
        is_by_error = name == "source" and self.config.sampling == "error"
        self._order: Order = (ErrorOrder if is_by_error else ShuffledOrder)(len(self._items), seed=self.seed + index)
        self._phase_index = index
        self._sight = {}  # a set may have become dynamic
        self._set_size(is_half=steps_in_phase < self.config.n_coarse_steps(n_steps))
        if not parameters:  # nothing to learn, as in a source clip in which nothing moves
            self._say("Nothing to learn", f"Nothing moves in this clip: no steps instead of {n_steps}")
            self.phases[index] = (name, steps_in_phase)

    def _set_size(self, *, is_half: bool) -> None:
        """Pictures are drawn and compared at this size from here on; `config.coarse_share`."""
        self._half = HalfSize(self.capture.rig, near_plane=self.near_plane) if is_half else None
        is_source = self.phases[self._phase_index][0] == "source"
        has_rest = is_source and self.config.tiles == "active" and not self.gains.requires_grad
        self._tiles = ActiveTiles(self.model) if has_rest and ActiveTiles.applies(self.model) else None

    def step(self) -> StepStats:
        """Draw a picture, render it, compare, update.

        Raises:
            NonFiniteLoss: The loss or a gradient is not finite; names it. The model is as it was before this step.
        """
        index, in_phase = self._phase_at(self.steps_done)
        if index != self._phase_index:
            self._add_moving()
            self._start_phase(index, 0)
        stage, n_steps = self.phases[index]
        if self._half is not None and in_phase >= self.config.n_coarse_steps(n_steps):
            self._set_size(is_half=False)
        drawn, weight = self._order.draw()
        item = self._items[drawn]
        if stage == "static":
            camera_row, clip_time = item, 0.0
            truth, is_counted = self.backgrounds.images[camera_row], self.backgrounds.is_stable[camera_row]
        else:
            camera_row, frame = divmod(item, self.clip.n_frames)
            clip_time = frame / self.clip.clip_length
            truth, is_counted = self.pictures.raw(camera_row, frame), None
        views, workspace = self._views, self._workspace
        if self._half is not None:
            views, workspace = self._half.views, self._half.workspace
            truth, is_counted = self._half.truth(item, truth, is_counted)
        view = views[self.camera_indices[camera_row]]
        active = self._active_picture(camera_row, view, clip_time)
        image = render_gaussians(active.gaussians, view, tile_mask=active.tile_mask).image[0]
        compared = photometric_loss(
            image,
            truth,
            ssim_weight=self.config.ssim_weight,
            gain=self.gains[camera_row],
            is_counted=is_counted,  # unstable pixels of a background do not
            tile_mask=active.tile_mask,
            rest=active.rest,
            workspace=workspace,
        )
        loss, mean_square, volume = compared.loss, compared.mean_square, torch.zeros(())
        if self._tiles is not None:
            mean_square += self._tiles.square_outside(active, item, truth, self.gains[camera_row])
        if self.config.volume_weight and active.n_all:
            volume = (self.config.volume_weight / active.n_all) * volume_sum(active.learning.scales, self.spacing)
            loss = loss + volume
        value = float(loss.detach())
        where = f"step {self.steps_done + 1}, camera {self.rig.names[camera_row]}"
        if not np.isfinite(value):
            terms = {"photometric": float(compared.loss.detach()), "volume": float(volume.detach())}
            raise loss_not_finite(image=image.detach(), **terms, where=where, config=self.config)
        self._order.saw(drawn, value)
        if loss.requires_grad:
            (loss if weight == 1.0 else loss * weight).backward()
        try:
            gradient_norm = self._optimizer.step()
        except NonFiniteLoss as error:
            raise gradient_not_finite(error, where=where, config=self.config) from error
        if self.gains.requires_grad:  # a step moves all cameras a little together; what is unseen stays at gain 1
            self.gains.detach().numpy()[:] = in_gauge(self.gains.detach().numpy())
        self.steps_done += 1
        self._look_for_stall()
        return StepStats(
            step=self.steps_done,
            n_steps=self.n_steps,
            loss=value,
            train_psnr=-10.0 * float(np.log10(max(mean_square, 1e-10))),
            n_gaussians=active.n_all,
            stage=stage,
            gradient_norm=gradient_norm,
            is_clipped=self._optimizer.clips(gradient_norm),
        )

    def _look_for_stall(self) -> None:
        """Now and then, see whether the pictures kept out of training still gain; else cut the phase short."""
        name, n_steps = self.phases[self._phase_index]
        done = self._optimizer.steps_done
        if self._patience is None or self._half is not None or done % MEASURE_EVERY or done >= n_steps:
            return
        if not self._patience.saw(self.held_in_psnr()):
            return
        n_left = steps_to_finish(done, n_steps)
        if n_left < n_steps - done:
            self._optimizer.finish_within(n_left)
            self.phases[self._phase_index] = (name, done + n_left)
            gained = f"{len(self._held_in)} pictures kept out of training stay at {self._patience.best:.2f} dB"
            self._say("Early stop", f"{gained}: {n_left} steps to the end instead of {n_steps - done}")

    def held_in_psnr(self) -> float:
        """Mean PSNR of the pictures of training cameras that are kept out of training, dB; NaN without patience."""
        values = []
        for item in self._held_in:
            camera_row, frame = divmod(item, self.clip.n_frames)
            clip_time = frame / self.clip.clip_length
            view = self._views[self.camera_indices[camera_row]]
            with torch.no_grad():
                gaussians = self.model.decode(clip_time, self._rows(camera_row, clip_time))
                image = render_gaussians(gaussians, view).image[0] * self.gains[camera_row]
            values.append(psnr(image.numpy(), self.pictures.raw(camera_row, frame) / 255.0))
        return float(np.mean(values)) if values else float("nan")

    def _active_picture(self, camera_row: int, view: View, clip_time: float) -> ActivePicture:
        rows = self._rows(camera_row, clip_time)
        if self._tiles is not None:
            return self._tiles.split(camera_row, view, clip_time, rows)
        gaussians = self.model.decode(clip_time, rows)
        return ActivePicture(gaussians, gaussians, len(gaussians))

    def _rows(self, camera_row: int, clip_time: float) -> dict[str, Tensor]:
        """Rows to decode for a training view; what a camera can see of fixed anchors never changes."""
        rows = {}
        for role in self.model.roles():
            key, anchors = (role, camera_row), self.model.anchor_set(role)
            if key not in self._sight:
                view = self._views[self.camera_indices[camera_row]]
                is_seen = view.sees(anchors.positions, reach=self._reach)
                self._sight[key] = is_seen if anchors.is_dynamic else is_seen.nonzero()[:, 0]
            rows[role] = self._sight[key]
            if anchors.presence is not None:
                is_seen = np.zeros(len(anchors), bool)  # by numpy: torch would wake its threads for it
                for knot, _ in self.model.knots(clip_time):
                    is_seen |= anchors.presence.numpy()[:, knot]
                is_seen &= self._sight[key].numpy()
                rows[role] = torch.from_numpy(is_seen.nonzero()[0])
        return rows

    @property
    def _reach(self) -> float:
        return REACH_SPACINGS * self.spacing

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
            image = render_model(self.model, self._views[camera], self.clip.clip_time(frame), reach=self._reach)
            values.append(psnr(image.numpy(), self.capture.frame(camera, frame) / 255.0))
        return float(np.mean(values)) if values else float("nan")

    def state(self) -> ClipState:
        """Snapshot of everything the clip owns. Copies, so that training can go on."""
        arrays = self.model.own_arrays() | self._reasons
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
            "config": self._given_config.difference(),
            "camera_names": list(self.rig.names),
            "near_plane": self.near_plane,
            "spacing": self.spacing,
            "moving_spacing": self.moving_spacing,
            "n_anchors": {role: len(self.model.anchor_set(role)) for role in self.model.roles()},
            "n_alive": n_alive(self.model),
            "coverage": self._coverage,
            "decoder": decoder_sizes(self.model.decoder),
            "field": None if self.model.field is None else self.model.field.shape.as_dict(),
        }
        if self.reference is None:
            arrays["gains"] = self.gains.detach().numpy().copy()
        else:
            header["reference_fingerprint"] = self.reference.header["fingerprint"]
        if self.previous is not None:
            header["previous_fingerprint"] = self.previous.header["fingerprint"]
        state = ClipState(arrays, header)
        header["fingerprint"] = state.fingerprint
        return state

    def finish(self) -> CompactClip:
        """The trained clip as it is stored. The model takes its values over: what is measured from here on is that.

        Raises:
            NonFiniteLoss: An array holds numbers that are not finite.
        """
        state = self.state()
        # another clip's field may show this one where fields go on: what it would show nobody knows yet
        if self.config.gate == "images" and self.config.field != "continue":
            views = [self._views[camera] for camera in self.camera_indices]
            state, said = demote(state, self.reference, views, reach=self._reach)
            self._say("Leaving out what is not needed", said)
            self._reasons = {name: array for name, array in state.arrays.items() if name.startswith("gate.")}
            self.model = load_clip_model(state, self.reference, is_learning=True)
        # a field that goes on in the next clip, and may show this one then, keeps entries that only others read
        entries = None if self.config.field == "continue" else self.model.entries_in_use()
        compact = compact_clip(state, entries)
        self.model = load_clip_model(compact.state, self.reference, is_learning=True)
        return compact

    def write_checkpoint(self, path: Path | str) -> None:
        """State, optimiser, order of pictures and random state: enough to go on exactly."""
        state = self.state()
        index, in_phase = self._phase_at(self.steps_done)
        resume = {
            "phase_index": self._phase_index,
            "steps_in_phase": in_phase if index == self._phase_index else self.phases[self._phase_index][1],
            "phases": self.phases,
            "order": self._order.state(),
            "schedule": self._optimizer.schedule,
            "patience": None if self._patience is None else self._patience.state(),
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
        self._coverage = kept.header.get("coverage")
        self.model = load_clip_model(kept, self.reference, is_learning=True)
        self.gains = nn.Parameter(torch.from_numpy(kept.arrays["resume.gains"].copy()))
        images = kept.arrays["resume.backgrounds"]
        stable = np.unpackbits(kept.arrays["resume.is_stable"], axis=-1, count=images.shape[2]).astype(bool)
        self.backgrounds = Backgrounds(images, stable)
        self.phases = [(name, n) for name, n in resume["phases"]]
        self.steps_done = kept.header["step"]
        self._reasons = {name: array for name, array in kept.arrays.items() if name.startswith("gate.")}
        self._start_phase(resume["phase_index"], resume["steps_in_phase"])
        self._optimizer.restore(kept.arrays, resume["steps_in_phase"])
        self._optimizer.schedule = resume.get("schedule", self._optimizer.schedule)
        self._order.restore(resume["order"])
        if self._patience is not None and resume.get("patience"):
            self._patience.restore(resume["patience"])
        self._generator.set_state(torch.tensor(resume["generator"], dtype=torch.uint8))
