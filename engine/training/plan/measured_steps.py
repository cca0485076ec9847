"""Seconds of a training step on this machine, measured: a few real ones on a synthetic clip of the expected sizes."""

from __future__ import annotations

import statistics
import time

import torch
from torch import nn

from engine.backends.backend import Backend
from engine.model.clip_view import render_gaussians
from engine.training.optimizer.optimizer import PhaseOptimizer, named_parameters, schedule_of
from engine.training.plan.plan import StepSizes
from engine.training.plan.synthetic_clip import N_FRAMES, ClipRecipe, make_clip, make_truth, make_view
from engine.training.step.active_tiles import ActivePicture, ActiveTiles
from engine.training.step.losses import photometric_loss

N_WARM, N_STEPS = 10, 40
MOTION_SHARE = 0.4
"""Share of width and height: moving parts are mostly in the middle of a picture, so source clips draw part of it."""


def measured_step_s(sizes: StepSizes, phase: str, backend: Backend) -> float:
    """Seconds of a step of a phase, the lower quartile of N_STEPS, on the threads of the kernels.

    A quartile, as the median of a second or two says more about other load right now than about minutes of
    training.

    Args:
        sizes: Of the clip.
        phase: As engine.training.phases calls it.
        backend: The backend they are computed with.
    """
    run = _Steps(sizes, phase, backend)
    times_s = []
    for _ in range(N_WARM + N_STEPS):
        started_s = time.perf_counter()
        run.step()
        times_s.append(time.perf_counter() - started_s)
    return statistics.quantiles(times_s[N_WARM:], n=4)[0]


class _Steps:
    """Steps as engine.training.clip_training does them, without a capture, checks and statistics."""

    def __init__(self, sizes: StepSizes, phase: str, backend: Backend) -> None:
        config, is_source = sizes.config, phase in ("source", "moving")  # still parts are frozen in both
        recipe = ClipRecipe(
            n_anchors=sizes.n_static + (0 if phase == "static" else sizes.n_moving),
            gaussians_per_anchor=config.gaussians_per_anchor,
            width=sizes.width,
            height=sizes.height,
            is_source=is_source,
            n_static=sizes.n_static,
            motion_share=MOTION_SHARE,
        )
        self._backend = backend
        self._config, self._model = config, make_clip(recipe, config=config, backend=self._backend)
        self._view, self._truth = make_view(recipe), torch.from_numpy(make_truth(recipe))
        self._gain = nn.Parameter(torch.ones(3, dtype=self._backend.dtype), requires_grad=not is_source)
        self._rows = {role: torch.arange(len(self._model.anchor_set(role))) for role in self._model.roles()}
        has_tiles = is_source and ActiveTiles.applies(self._model)
        self._tiles = ActiveTiles(self._model, backend=self._backend) if has_tiles else None
        parameters = named_parameters(self._model, self._gain, config)
        schedule, learning = schedule_of(parameters, config, n_steps=10_000), {n: p for n, (p, _) in parameters.items()}
        self._optimizer = PhaseOptimizer(learning, schedule=schedule, backend=self._backend)
        self._frame = 0

    def step(self) -> None:
        """Draw, compare, update."""
        self._frame = (self._frame + 1) % N_FRAMES
        clip_time = self._frame / N_FRAMES
        if self._tiles is not None:
            active = self._tiles.split(0, self._view, clip_time, self._rows)
        else:
            gaussians = self._model.decode(clip_time, self._rows)
            active = ActivePicture(gaussians, gaussians, len(gaussians))
        compared = photometric_loss(
            render_gaussians(active.gaussians, self._view, tile_mask=active.tile_mask, backend=self._backend).image[0],
            self._truth,
            ssim_weight=self._config.ssim_weight,
            gain=self._gain,
            tile_mask=active.tile_mask,
            rest=active.rest,
            backend=self._backend,
        )
        (compared.loss + self._config.volume_weight * active.learning.scales.prod(1).mean()).backward()
        self._optimizer.step()
