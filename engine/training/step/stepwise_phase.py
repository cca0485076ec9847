"""StepwisePhase: a phase whose steps are done one by one, by the operations of any back end.

Numbers of a step (loss, mean square, norm) stay on the device until the last of a run. Where a step is not finite, the
device leaves everything as it is from there on; after the run it is done once more to find the fault.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from engine.backends.backend import Backend
from engine.backends.phase import Fault, PhasePlan, PhaseStats
from engine.cloud.background.gains import in_gauge
from engine.model.clip_view import View, render_gaussians
from engine.model.host_array import host_array
from engine.training.optimizer.optimizer import PhaseOptimizer
from engine.training.step.active_tiles import ActivePicture, ActiveTiles
from engine.training.step.losses import photometric_loss
from engine.training.step.valid_pixels import ValidPixels
from engine.training.step.visible_anchors import Sight

MAX_BYTES = 4 << 30
"""Memory for pictures on a device that is not the host; those beyond it are copied at every step."""


class _Terms(NamedTuple):
    """The outcome of comparing a picture. loss is the sum of the terms, all scalars; image is the rendered one."""

    loss: Tensor
    photometric: Tensor
    volume: Tensor
    mean_square: Tensor
    image: Tensor
    n_gaussians: int


class StepwisePhase:
    """See engine.backends.phase.Phase.

    Args:
        plan: The phase's inputs.
        backend: The backend it is computed with.
    """

    def __init__(self, plan: PhasePlan, backend: Backend) -> None:
        self._plan, self._backend = plan, backend
        views = plan.windows.views(plan.cameras.first_views)
        self.sight = Sight(plan.model, views, reach=plan.reach, reaches=plan.reaches)
        self.valid = ValidPixels(plan.windows.cut_all(plan.is_valid), backend.device)
        has_rest = plan.has_rest and ActiveTiles.applies(plan.model)
        self.tiles = ActiveTiles(plan.model, backend=backend, valid=self.valid) if has_rest else None
        self._pictures: dict[int, tuple[Tensor, Tensor | None]] = {}
        self._n_bytes = 0
        self.optimizer = PhaseOptimizer(plan.parameters, schedule=plan.schedule, backend=backend)

    @property
    def steps_done(self) -> int:
        """See Phase."""
        return self.optimizer.steps_done

    @property
    def reaches(self) -> Mapping[str, Tensor]:
        """See Phase."""
        return self.sight.reaches

    def arrays(self) -> dict[str, np.ndarray]:
        """See Phase."""
        return self.optimizer.arrays()

    def restore(self, arrays: dict[str, np.ndarray], steps_done: int) -> None:
        """See Phase."""
        self.optimizer.restore(arrays, steps_done)

    def run(self, items: Sequence[int]) -> PhaseStats:
        """See Phase."""
        is_sound = torch.ones((), dtype=torch.bool, device=self._backend.device)
        before, numbers, n_gaussians = [], [], 0  # numbers are scalars on the device
        for item in items:
            before.append(self.optimizer.mark())
            terms, norm, is_sound = self._step(item, is_sound)
            numbers.append((terms.loss.detach(), terms.mean_square, norm))
            n_gaussians = terms.n_gaussians
        losses, squares, norms = torch.stack(
            [torch.stack(column).double() for column in zip(*numbers, strict=True)]
        ).tolist()
        n_good = next(
            (i for i, pair in enumerate(zip(losses, norms, strict=True)) if not np.isfinite(pair).all()), len(items)
        )
        fault = None
        if n_good < len(items):
            self.optimizer.go_back(before[n_good])
            fault = self._fault_of(items[n_good])
        return PhaseStats(losses[:n_good], norms[:n_good], squares[-1], n_gaussians, fault)

    def _step(self, item: int, is_sound: Tensor) -> tuple[_Terms, Tensor, Tensor]:
        """One step, which changes nothing unless all was sound so far. Returns terms, norm and whether it still is."""
        cameras, gains = self._plan.cameras, self._plan.gains
        camera_row = self._plan.pictures.place(item).camera_row
        terms = self._compare(item)
        if terms.loss.requires_grad:
            terms.loss.backward()
            cameras.take_gradient(camera_row)
        is_sound = is_sound & terms.loss.detach().isfinite()
        norm = self.optimizer.step(is_sound)
        is_sound = is_sound & norm.isfinite()
        if (gains.requires_grad or cameras.is_learning) and is_sound.item():  # settled on the host
            if gains.requires_grad:  # a step moves all cameras a little together; unseen ones stay at gain 1
                with torch.no_grad():
                    gains.copy_(torch.from_numpy(in_gauge(host_array(gains))))
            cameras.settle()
        return terms, norm, is_sound

    def _compare(self, item: int) -> _Terms:
        """Draw the picture of an item and compare it."""
        plan, backend = self._plan, self._backend
        camera_row, window, clip_time = plan.pictures.place(item)
        view, view_row = plan.windows.view(plan.cameras.view(camera_row), window), plan.windows.row(camera_row, window)
        plan.model.follow_positions()
        active = self.active_picture(view_row, view, clip_time)
        plan.cameras.watch(active.gaussians)
        image = render_gaussians(active.gaussians, view, backend=backend, tile_mask=active.tile_mask).image[0]
        (pixels, is_counted), gain = self._picture(item, view_row), plan.gains[camera_row]
        compared = photometric_loss(
            image,
            pixels,
            backend=backend,
            ssim_weight=plan.ssim_weight,
            gain=gain,
            is_counted=is_counted,
            tile_mask=active.tile_mask,
            rest=active.rest,
        )
        mean_square, volume = compared.mean_square, compared.loss.new_zeros(())
        if self.tiles is not None and pixels.dtype == torch.uint8:  # sums are kept of captured pictures alone
            mean_square = mean_square + self.tiles.square_outside(active, item, pixels, gain)
        loss = compared.loss
        if plan.volume_weight and active.n_all:
            unit, n_counted = (1.0, 1) if plan.volume_unit is None else (plan.volume_unit, active.n_all)
            volume = (plan.volume_weight / n_counted) * backend.volume_sum(active.learning.scales, unit)
            loss = loss + volume
        return _Terms(loss, compared.loss, volume, mean_square, image, active.n_all)

    def _fault_of(self, item: int) -> Fault:
        """The values not finite in a step that changed nothing: the step is done again, up to the update."""
        terms = self._compare(item)
        is_of_gradient = bool(terms.loss.isfinite())
        if is_of_gradient:
            terms.loss.backward()
        names = self.optimizer.not_finite()
        self.optimizer.clear()
        n_bad = int((~terms.image.detach().isfinite()).sum())
        values = float(terms.photometric.detach()), float(terms.volume.detach())
        return Fault(*values, n_bad, terms.image.numel(), is_of_gradient, names)

    def active_picture(self, view_row: int, view: View, clip_time: float) -> ActivePicture:
        """The parts of a window to draw and compare."""
        rows = self.sight.rows(view_row, clip_time)
        if self.tiles is not None:
            return self.tiles.split(view_row, view, clip_time, rows)
        gaussians = self._plan.model.decode(clip_time, rows)
        return ActivePicture(gaussians, gaussians, len(gaussians), self.valid.tiles_of(view_row))

    def _picture(self, item: int, view_row: int) -> tuple[Tensor, Tensor | None]:
        """Truth and pixels that count, where it is computed."""
        known = self._pictures.get(item)
        if known is None:
            truth, counted = self._plan.pictures.truth(item), self._plan.pictures.counted(item)
            is_counted = self.valid.of(view_row) if counted is None else self._tensor(counted)
            known = self._tensor(truth), is_counted
            if self._backend.device.type != "cpu" and self._n_bytes < MAX_BYTES:
                self._n_bytes += truth.nbytes + (0 if counted is None else counted.nbytes)
                self._pictures[item] = known
        return known

    def _tensor(self, array: np.ndarray) -> Tensor:
        return torch.from_numpy(array).to(self._backend.device)
