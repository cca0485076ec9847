"""ClipTraining: one clip from pixels to a finished ClipState, step by step.

Reference clip: "static" phase on the backgrounds, then "joint" phase on the pictures with the moving anchors added,
then "moving" phase, in which these and the field learn on alone, as in a source clip.
Source clip: one "source" phase; everything inherited is frozen, residual anchors and the clip's own field learn.
It owns model, optimiser and sampling; it has no loop, no process, and opens no files itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from engine.backends.backend import Backend
from engine.backends.phase import ItemPlace, PhasePlan
from engine.camera.depth_range import near_plane
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.capture.exclusions import NOTHING_EXCLUDED, exclusion_key
from engine.clip_files.anchor_record import AnchorRecord
from engine.clip_files.array_names import CORRECTIONS, DECODER, GAINS, LOG_DRIFT, VIGNETTING
from engine.clip_files.clip_header import SCHEMA, ClipHeader, Place
from engine.clip_files.clip_state import ClipState, fingerprint_of
from engine.clip_files.compact import CompactClip, compact_clip
from engine.errors import PreparationError, ProjectError
from engine.gate.regions import GateRegion
from engine.images.psnr import psnr
from engine.model.camera_colors import CameraColors
from engine.model.clip_model import ClipModel, decoder_shape
from engine.model.clip_view import REACH_SPACINGS, reaches_of, render_model
from engine.model.host_array import host_array
from engine.model.reading import load_clip_model
from engine.progress import Progress, ReportProgress, StepStats
from engine.training.checkpoint import Checkpoint, damaged_checkpoint, name_of, read_checkpoint, write_checkpoint
from engine.training.config import TrainConfig
from engine.training.optimizer.optimizer import named_parameters, schedule_of
from engine.training.phases import phase_at, phases_of
from engine.training.preparation.clip_field import n_alive
from engine.training.preparation.clip_preparation import ClipColors, ClipParts, ClipPreparation
from engine.training.preparation.cloud_preparation import Backgrounds
from engine.training.preparation.drift import no_drift
from engine.training.preparation.method import Method
from engine.training.preparation.training_pictures import TrainingPictures
from engine.training.preparation.unseen_anchors import continue_unseen
from engine.training.step.nonfinite import not_finite
from engine.training.step.order import ShuffledOrder
from engine.training.step.stepwise_phase import StepwisePhase
from engine.training.step.training_cameras import TrainingCameras
from engine.training.step.visible_anchors import camera_views
from engine.training.windows import Windows

_SEED_STEP = 1_000_003
"""Between clips that are trained independently; far more than the seeds that people try."""


class ClipTraining:
    """Trains one clip. See the module docstring.

    Args:
        capture: The capture at working resolution.
        clip: Frames to train on.
        config: All numbers.
        method: All decisions.
        backend: The backend it is computed with.
        holdout: Camera indices never looked at in training.
        reference: Finished reference clip for a source clip, None to train the reference clip itself, or a clip that
            shares nothing.
        previous: The clip before, finished, for a method that continues from it.
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
        method: Method,
        backend: Backend,
        holdout: Sequence[int],
        reference: ClipState | None,
        seed: int,
        prep_dir: Path,
        report: ReportProgress,
        previous: ClipState | None = None,
        regions: Sequence[GateRegion] = (),
    ) -> None:
        self.capture, self.clip, self.config, self.method = capture, clip, config, method
        self.reference, self.previous, self.backend = reference, previous, backend
        self._base = method.base(reference, previous)
        self.regions = tuple(regions)
        self._shared: tuple[Backgrounds, str] | None = None
        self.holdout = sorted(set(holdout) - set(capture.excluded_cameras))
        self.camera_indices = _training_cameras(capture, self.holdout, self._base)
        if len(self.camera_indices) < 2:
            raise PreparationError(
                f"Only {len(self.camera_indices)} of {len(capture.rig)} cameras are left for training; two are needed.",
                hint="Hold out fewer cameras, or exclude fewer.",
                path=capture.path,
            )
        self.seed = seed if self._base is not None else seed_of(config, clip, seed)
        self.prep_dir, self.report = Path(prep_dir), report
        self.rig = capture.rig.subset(self.camera_indices)
        self.near_plane = float(near_plane(self.rig)) if self._base is None else self._base.header.near_plane
        self.windows = Windows(*capture.picture_size)
        self.phases = phases_of(
            config,
            n_cameras=len(self.camera_indices),
            n_frames=clip.n_frames,
            n_windows=len(self.windows),
            is_source=self._base is not None,
        )
        self.steps_done = 0
        self._generator = torch.Generator().manual_seed(self.seed)
        self._views = camera_views(capture.rig, near_plane=self.near_plane)
        self._cameras = TrainingCameras(
            self.rig,
            near_plane=self.near_plane,
            start=None if self._base is None else self._base.corrections,
            is_learning=config.refine_cameras == "on" and self._base is None,
            like=torch.zeros((), dtype=backend.dtype, device=backend.device),
        )
        self._preparation = ClipPreparation(
            capture,
            clip,
            config.of_windows(len(self.windows)),
            method,
            backend=backend,
            camera_indices=self.camera_indices,
            cameras=self._cameras,
            base=self._base,
            previous=previous,
            regions=self.regions,
            seed=self.seed,
            generator=self._generator,
            prep_dir=self.prep_dir,
            report=report,
        )
        self._items: list[int] = []
        self._stage = ""
        self._trained: ClipModel | None = None
        """The model before it took over the values that are stored."""

    # ---------------------------------------------------------------- progress

    @property
    def n_steps(self) -> int:
        """Steps of all phases together."""
        return sum(n for _, n in self.phases)

    @property
    def is_finished(self) -> bool:
        """Whether every step was done."""
        return self.steps_done >= self.n_steps

    # ---------------------------------------------------------------- preparation

    def prepare(self) -> None:
        """Load pictures and build the inputs of the first phase.

        Raises:
            PreparationError, CaptureError: Clouds cannot be built or pictures cannot be read.
        """
        torch.manual_seed(self.seed)
        self.pictures = self._preparation.read_pictures()
        if self._base is None and self.config.cloud == "frames":
            self._take(self._preparation.whole_parts(self.pictures))
        elif self._base is None:
            self._take(self._preparation.static_parts(self.pictures))
        else:
            self._take(self._preparation.source_parts(self._base, self.pictures))
        self._start_phase(0, 0)

    def _add_moving(self) -> None:
        """Between the phases of a reference clip: corrected backgrounds, motion, moving anchors, field."""
        parts = ClipParts(
            self.model, self.gains, self.drift, self.backgrounds, self.spacing, vignetting=self.vignetting
        )
        self._take(self._preparation.with_motion(parts, self.pictures))
        if not any(self.model.anchor_set(role).is_dynamic for role in self.model.roles()):
            self.phases = [phase for phase in self.phases if phase[0] != "moving"]

    def _settle_still_parts(self) -> None:
        """Between the phases of a reference clip: still parts have learned, and what no pixel showed follows them."""
        squares = self._phase.arrays().get("optimizer.sets.static.features.exp_avg_sq")
        n_changed = 0 if squares is None else continue_unseen(self.model, "static", squares)
        self._say("Finishing the static scene", f"{n_changed:,} anchors that no camera sees look like their neighbours")

    def _take(self, parts: ClipParts) -> None:
        self.model, self.gains, self.drift, self.backgrounds = parts.model, parts.gains, parts.drift, parts.backgrounds
        self.spacing, self.moving_spacing = parts.spacing, parts.moving_spacing
        self._reasons, self._coverage, self.vignetting = parts.reasons, parts.coverage, parts.vignetting

    def _say(self, stage: str, message: str) -> None:
        self.report(Progress(stage, 1.0, message))

    # ---------------------------------------------------------------- steps

    def _start_phase(self, index: int, steps_in_phase: int, reaches: dict[str, Tensor] | None = None) -> None:
        name, n_steps = self.phases[index]
        if name == "moving":
            self.model.freeze_still_parts(learns_heads=self.config.learns_moving_heads)
            self._cameras.freeze()
        has_gains = bool((self.gains != 1.0).any())  # all 1 where the cameras do not differ: nothing to learn
        self.gains.requires_grad_(self.reference is None and has_gains and name != "moving")
        self._learn_positions()
        parameters = named_parameters(
            self.model,
            self.gains,
            self.config,
            self._cameras.pixels,
            extent=self.rig.extent,
            spacing=self.moving_spacing or self.spacing,
        )
        ratios = self.method.final_ratios(parameters, self.config)
        is_over = self.method.inherits_schedule and self._base is not None
        plan = PhasePlan(
            model=self.model,
            gains=self.gains,
            cameras=self._cameras,
            pictures=self,
            windows=self.windows,
            is_valid=self.pictures.is_valid,
            parameters={name: parameter for name, (parameter, _) in parameters.items()},
            schedule=schedule_of(parameters, self.config, n_steps=n_steps, final_ratios=ratios, is_over=is_over),
            reach=REACH_SPACINGS * self.spacing,
            reaches=reaches,
            has_rest=name in ("source", "moving") and self.method.has_active_tiles and not self.gains.requires_grad,
            ssim_weight=self.config.ssim_weight,
            volume_weight=self.config.volume_weight,
            volume_unit=self.spacing if self.config.volume == "mean" else None,
        )
        self._phase = self.backend.phase(plan) or StepwisePhase(plan, self.backend)
        self._phase.restore({}, steps_in_phase)
        self._phase_index, self._stage = index, name
        self._items = self._items_of(name)
        self._order = ShuffledOrder(len(self._items), seed=self.seed + index)
        if not parameters:  # nothing to learn, as in a source clip in which nothing moves
            self._say("Nothing to learn", f"Nothing moves in this clip: 0 steps instead of {n_steps}")
            self.phases[index] = (name, steps_in_phase)

    def _learn_positions(self) -> None:
        """Positions of learning anchors are parameters from here on, if they learn at all."""
        if self.config.position_lr:
            for role in self.model.roles():
                self.model.anchor_set(role).learn_positions()

    def _items_of(self, phase: str) -> list[int]:
        """Numbers of the items a phase draws: windows of cameras, or of pictures camera by camera; without wholly
        excluded ones."""
        if phase == "static":
            out = self.capture.excluded_cameras
            return self._windows_of([row for row, camera in enumerate(self.camera_indices) if camera not in out])
        n_frames = self.clip.n_frames
        usable = [one for one in range(len(self.pictures)) if self.pictures.is_usable(*divmod(one, n_frames))]
        items = self._windows_of(usable)
        if len(self.windows) > 1 and phase in ("source", "moving"):
            items = self._with_motion(items) or items
        if not items:
            raise PreparationError(
                f"Every picture of clip {self.clip.clip_index} is excluded from training.",
                hint="Remove some exclusions, or leave the clip untrained.",
            )
        return items

    def _windows_of(self, pictures: Sequence[int]) -> list[int]:
        """The items that are windows of these pictures, but for those of which the camera sees nothing."""
        n, valid = len(self.windows), self.pictures.is_valid
        items = [picture * n + window for picture in pictures for window in range(n)]
        if valid is None or n == 1:
            return items
        is_seen = [[bool(self.windows.cut(flags, window).any()) for window in range(n)] for flags in valid]
        places = [self.place(item) for item in items]
        return [item for item, at in zip(items, places, strict=True) if is_seen[at.camera_row][at.window]]

    def _with_motion(self, items: Sequence[int]) -> list[int]:
        """Those in which something that learns may be seen: nothing can be learned from the other windows."""
        dynamic = [role for role in self.model.roles() if self.model.anchor_set(role).is_dynamic]
        reaches = {role: reaches_of(self.model.anchor_set(role), REACH_SPACINGS * self.spacing) for role in dynamic}
        views = self.windows.views(self._cameras.first_views)
        found = []
        for item in items:
            camera_row, window, clip_time = self.place(item)
            view = views[self.windows.row(camera_row, window)]
            for role in dynamic:
                alive = self.model.alive(role, clip_time)
                positions = self.model.positions(role, clip_time).detach()[alive]
                if view.sees(positions, reach=reaches[role][alive]).any():
                    found.append(item)
                    break
        return found

    def step(self, n: int = 1) -> StepStats:
        """Steps of one phase, each of which draws a picture, renders it, compares, and updates.

        Args:
            n: How many; fewer where the phase ends.
        Raises:
            NonFiniteLoss: The loss or a gradient is not finite; names it. The model is as it was before that step.
        """
        index, done = phase_at(self.phases, self.steps_done)
        if index != self._phase_index:
            if self.phases[index][0] == "joint":
                self._add_moving()
            else:
                self._settle_still_parts()
            self._start_phase(index, 0)
        order = self._order.state() if n > 1 else {}
        items = [self._items[self._order.draw()] for _ in range(min(n, self.phases[index][1] - done))]
        stats = self._phase.run(items)
        n_done = len(stats.losses)
        self.steps_done += n_done
        if stats.fault is not None:
            if n_done + 1 < len(items):  # the items drawn for the steps behind are drawn again
                self._order.restore(order)
                items = [self._items[self._order.draw()] for _ in range(n_done + 1)]
            where = f"step {self.steps_done + 1}, camera {self.rig.names[self.place(items[n_done]).camera_row]}"
            raise not_finite(stats.fault, where=where, config=self.config)
        valid, (camera_row, window, _) = self.pictures.is_valid, self.place(items[-1])
        share = 1.0 if valid is None else float(self.windows.cut(valid[camera_row], window).mean())
        norms, limit = stats.gradient_norms, self.config.max_gradient_norm
        return StepStats(
            step=self.steps_done,
            n_steps=self.n_steps,
            loss=sum(stats.losses) / n_done,
            train_psnr=-10.0 * float(np.log10(max(stats.mean_square / share, 1e-10))),
            n_gaussians=stats.n_gaussians,
            stage=self._stage,
            gradient_norms=tuple(norms),
            n_clipped=sum(0.0 < limit < norm for norm in norms),
        )

    # ---------------------------------------------------------------- inputs of a phase

    def place(self, item: int) -> ItemPlace:
        """See PhasePictures."""
        picture, window = divmod(item, len(self.windows))
        if self._stage == "static":
            return ItemPlace(picture, window, 0.0)
        camera_row, frame = divmod(picture, self.clip.n_frames)
        return ItemPlace(camera_row, window, frame / self.clip.clip_length)

    def truth(self, item: int) -> np.ndarray:
        """See PhasePictures."""
        picture, window = divmod(item, len(self.windows))
        if self._stage == "static":
            return self.windows.cut(self.backgrounds.images[picture], window)
        return self.windows.cut(self.pictures.picture(*divmod(picture, self.clip.n_frames)), window)

    def counted(self, item: int) -> np.ndarray | None:
        """See PhasePictures."""
        picture, window = divmod(item, len(self.windows))
        if self._stage == "static":
            return self.windows.cut(self.backgrounds.is_stable[picture], window)  # unstable pixels do not count
        if self.capture.exclusions == NOTHING_EXCLUDED:
            return None
        valid = self.pictures.valid_in(*divmod(picture, self.clip.n_frames))
        return None if valid is None else self.windows.cut(valid, window)

    def _tensor(self, array: np.ndarray) -> Tensor:
        return torch.from_numpy(array).to(self.backend.device)

    # ---------------------------------------------------------------- results

    def held_out_psnr(self, *, n_pictures: int = 3) -> float:
        """Mean PSNR of a few held-out pictures in raw colours, dB; NaN without held-out cameras."""
        gains = host_array(self.gains)
        colors = CameraColors(self.rig.names, gains, self.drift, self.clip.clip_length, self.vignetting)
        values = []
        for i, camera in enumerate(self.holdout[:n_pictures]):
            frame = self.clip.start + (i * self.clip.n_frames) // max(len(self.holdout[:n_pictures]), 1)
            if not self.capture.is_usable(camera, frame):
                continue
            clip_time = self.clip.clip_time(frame)
            image = render_model(self.model, self._views[camera], clip_time, reach=REACH_SPACINGS * self.spacing)
            shown = colors.in_camera(host_array(image), self.capture.rig, camera, clip_time)
            values.append(psnr(shown, self.capture.frame(camera, frame) / 255.0, self.capture.valid_in(camera, frame)))
        return float(np.mean(values)) if values else float("nan")

    def state(self) -> ClipState:
        """Snapshot of everything the clip owns. Copies, so that training can continue."""
        return self._state_of(self.model)

    def _state_of(self, model: ClipModel) -> ClipState:
        arrays = model.own_arrays()
        for role, codes in self._reasons.items():
            arrays |= AnchorRecord(reasons=codes).arrays(role)
        if self.reference is None:
            arrays[GAINS] = host_array(self.gains).copy()
            if self.vignetting is not None:
                arrays[VIGNETTING] = self.vignetting.copy()
            if self._cameras.corrections is not None:
                arrays[CORRECTIONS] = self._cameras.corrections
        if (self.drift != 1.0).any():
            arrays[LOG_DRIFT] = np.log(self.drift)
        header = ClipHeader(
            schema=SCHEMA,
            role="reference" if self.reference is None else "source",
            clip_index=self.clip.clip_index,
            clip_length=self.clip.clip_length,
            n_frames=self.clip.n_frames,
            start=self.clip.start,
            step=self.steps_done,
            n_steps=self.n_steps,
            seed=self.seed,
            config=self.config.difference(),
            camera_names=list(self.rig.names),
            near_plane=self.near_plane,
            spacing=self.spacing,
            moving_spacing=self.moving_spacing,
            n_anchors={role: len(model.anchor_set(role)) for role in model.roles()},
            n_alive=n_alive(model),
            coverage=self._coverage,
            decoder=decoder_shape(model.decoder),
            field=None if model.field is None else model.field.shape,
            fingerprint=fingerprint_of(arrays),
            exclusions=exclusion_key(self.capture.exclusions, (self.clip.start, self.clip.stop)),
            reference_fingerprint=None if self.reference is None else self.reference.header.fingerprint,
            previous_fingerprint=None if self.previous is None else self.previous.header.fingerprint,
        )
        return ClipState(arrays, header)

    def finish(self) -> CompactClip:
        """The trained clip as it is stored. The model takes over its values: later measurements are of those.

        A checkpoint that is written later still holds the model as trained.

        Raises:
            NonFiniteLoss: An array holds numbers that are not finite.
            DiskError: The backgrounds that source clips share could not be kept; nothing has changed.
        """
        last = self.phases[self._phase_index][0]
        if last == "joint" and not self.model.anchor_set("static").is_dynamic:  # nothing moves
            self._settle_still_parts()
        if self._base is None and last != "static":
            self._preparation.keep_backgrounds(self.model, self.gains, self.backgrounds)
        state = self.state()
        self._trained = self.model
        self.model.follow_positions()
        entries = None if self.method.keeps_unread_entries else self.model.entries_in_use()
        compact = compact_clip(state, entries, is_exact=self.config.storage == "exact")
        self.model = load_clip_model(compact.state, self.reference, backend=self.backend, is_learning=True)
        return compact

    def measured_colors(self) -> ClipColors:
        """The exposure of the cameras and the light in a clip that inherits, as its preparation measures them.

        Raises:
            PreparationError, CaptureError: Pictures cannot be read, or the backgrounds cannot be made.
        """
        assert self._base is not None
        return self._preparation.measured_colors(self._base, self._preparation.read_pictures())

    def take_up(
        self,
        state: ClipState,
        pictures: TrainingPictures,
        chosen: Sequence[int],
        *,
        n_steps: int,
        learning: tuple[str, ...] = ("",),
    ) -> None:
        """Continue from a finished clip instead of `prepare`: some steps more, on pictures that the caller chooses.

        For a clip that inherits from another one. Settings give the rates, which fall over these steps.

        Args:
            state: The clip, based on the same reference.
            pictures: To compare with, in the exposure of the reference clip; their truth may be any picture.
            chosen: The pictures drawn in a pass: camera row * frames of the clip + frame in the clip.
            n_steps: How many steps.
            learning: Prefixes of the names of parameters that learn, as the model names them.
        Raises:
            ProjectError: The state is incomplete, or is not of this reference.
        """
        assert self._base is not None
        base, header = self._base, state.header
        gains = torch.from_numpy(base.arrays[GAINS].copy()).to(self.backend.device, self.backend.dtype)
        drift = state.drift
        self.pictures = pictures
        self._take(
            ClipParts(
                load_clip_model(state, self.reference, backend=self.backend, is_learning=True),
                nn.Parameter(gains, requires_grad=False),
                no_drift(pictures) if drift is None else drift,
                Backgrounds.none(),
                header.spacing,
                moving_spacing=header.moving_spacing,
                reasons=_reasons_in(state),
                coverage=header.coverage,
                vignetting=base.vignetting,
            )
        )
        self._learn_positions()
        # heads of all parts learn with whatever does and are stored from now on; those of what moves learn if named
        prefixes = learning if self.model.still_decoder is not None else (DECODER, *learning)
        for name, parameter in self.model.named_parameters():
            if not name.startswith(prefixes):
                parameter.requires_grad = False
        self.phases, self.steps_done = [("source", n_steps)], 0
        self._start_phase(0, 0)
        usable = set(self._items)
        self._items = [item for item in self._windows_of(chosen) if item in usable] or self._items
        self._order = ShuffledOrder(len(self._items), seed=self.seed)

    def write_checkpoint(self, path: Path | str) -> None:
        """State, optimiser, order of pictures and random state: enough to continue exactly."""
        index, in_phase = phase_at(self.phases, self.steps_done)
        place = Place(
            phase_index=self._phase_index,
            steps_in_phase=in_phase if index == self._phase_index else self.phases[self._phase_index][1],
            phases=self.phases,
            order=self._order.state(),
            generator=self._generator.get_state().tolist(),
        )
        state = self._state_of(self._trained or self.model)
        state = ClipState(state.arrays | self._phase.arrays(), state.header)
        reaches = {role: host_array(reach) for role, reach in self._phase.reaches.items()}
        gains = host_array(self.gains).copy()
        shared = self._name_of_shared()
        backgrounds = None if shared else self.backgrounds
        write_checkpoint(path, Checkpoint(state, gains, backgrounds, place, reaches, self._cameras.kept, shared))

    def _name_of_shared(self) -> str:
        """The name of the backgrounds that the reference clip has left, if they are this source clip's as they are;
        else empty. Looked up once: they are read from a disk that others may use, too."""
        if self._base is None:
            return ""
        if self._shared is None or self._shared[0] is not self.backgrounds:
            found = self._preparation.shared_backgrounds()
            is_shared = found is not None and found.equals(self.backgrounds)
            self._shared = (self.backgrounds, name_of(self.backgrounds) if is_shared else "")
        return self._shared[1]

    def restore_checkpoint(self, path: Path | str) -> None:
        """Continue from a checkpoint instead of `prepare`.

        Raises:
            ProjectError: The checkpoint is damaged or belongs to another clip, reference or set of cameras.
        """
        frames = (self.clip.start, self.clip.n_frames, self.clip.clip_length)
        kept = read_checkpoint(path, frames=frames, camera_names=self.rig.names, seed=self.seed)
        backgrounds = kept.backgrounds
        if backgrounds is None:
            backgrounds = self._preparation.shared_backgrounds()
            if backgrounds is None or name_of(backgrounds) != kept.shared:
                raise ProjectError("The backgrounds that the checkpoint was made with are gone.", path=path)
        self.pictures = self._preparation.read_pictures()
        try:
            self._go_on(kept, backgrounds)
        except ProjectError as error:  # a rebuilt state knows no file
            raise ProjectError(error.message, hint=error.hint, path=error.path or path) from error
        except (
            ArithmeticError,
            AssertionError,
            AttributeError,
            LookupError,
            RuntimeError,
            TypeError,
            ValueError,
        ) as error:
            raise damaged_checkpoint(error, path) from error

    def _go_on(self, kept: Checkpoint, backgrounds: Backgrounds) -> None:
        width, height = self.capture.picture_size
        if backgrounds.images.shape != (len(self.rig), height, width, 3) or kept.gains.shape != (len(self.rig), 3):
            found = f"{backgrounds.images.shape} and {kept.gains.shape}"
            raise ValueError(f"backgrounds and gains are {found}, not of {len(self.rig)} cameras of {width}x{height}")
        header, place = kept.state.header, kept.place
        drift = kept.state.drift
        if drift is None:
            drift = np.ones((len(self.rig), self.clip.n_frames, 3), np.float32)
        vignetting = (kept.state if self._base is None else self._base).vignetting
        removed = [(drift, None), (None, vignetting)]  # one after the other, as preparations do: to the bit
        for drifts, lenses in removed if self._base is None else reversed(removed):
            self.pictures.remove(drifts, lenses)
        self._cameras.restore(kept.cameras)
        parts = ClipParts(
            load_clip_model(kept.state, self.reference, backend=self.backend, is_learning=True),
            nn.Parameter(torch.from_numpy(kept.gains).to(self.backend.device, self.backend.dtype)),
            drift,
            backgrounds,
            header.spacing,
            moving_spacing=header.moving_spacing,
            reasons=_reasons_in(kept.state),
            coverage=header.coverage,
            vignetting=vignetting,
        )
        self._take(parts)
        if self._base is not None and not self.method.learns_heads:  # stored, since they are not the reference clip's
            self.model.decoder.requires_grad_(requires_grad=False)
        self.phases = list(place.phases)
        self.steps_done = header.step
        reaches = {role: self._tensor(reach) for role, reach in kept.reaches.items()}
        self._start_phase(place.phase_index, place.steps_in_phase, reaches)
        self._phase.restore(kept.state.arrays, place.steps_in_phase)
        self._order.restore(place.order)
        self._generator.set_state(torch.tensor(place.generator, dtype=torch.uint8))


def seed_of(config: TrainConfig, clip: Clip, seed: int) -> int:
    """The seed of a clip that inherits nothing: independent ones have one each, so that they share no start either.

    Args:
        seed: Of the project, and of its first clip.
    """
    return seed + _SEED_STEP * clip.clip_index if config.independent else seed


def _training_cameras(capture: Capture, holdout: Sequence[int], base: ClipState | None) -> list[int]:
    """Rows of the rig that a clip is trained with. One that continues from another clip has that one's cameras: of one
    that was excluded since, no picture is usable."""
    cameras = capture.training_cameras(holdout)
    if base is None or capture.exclusions == NOTHING_EXCLUDED:
        return cameras
    rows = {name: row for row, name in enumerate(capture.rig.names)}
    of_base = [rows.get(name) for name in base.header.camera_names]
    known = [row for row in of_base if row is not None and row not in holdout]
    return known if len(known) == len(of_base) else cameras


def _reasons_in(state: ClipState) -> dict[str, np.ndarray]:
    """The gate's reasons, by role, as a clip stores them."""
    return {role: record.reasons for role, record in state.anchors.items() if record.reasons is not None}
