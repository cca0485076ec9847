"""A whole training step on a synthetic clip, cut into its stages, and as it really runs.

Stages are timed by cutting the graph at their boundaries: what a stage yields becomes a leaf of the next one, whose
gradient is then handed back. The total is timed without cuts; it also holds what autograd adds between stages.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

from app.bench.clips import N_FRAMES, ClipRecipe, make_clip, make_truth, make_view
from app.bench.rows import IterationRow
from app.bench.timing import interleaved
from engine.model.view import render_gaussians
from engine.raster.gaussians import Gaussians
from engine.training.config import TrainConfig
from engine.training.losses import LossWorkspace, photometric_loss
from engine.training.optimizer import PhaseOptimizer, named_parameters

SIZES = {
    "2k": ClipRecipe(2_000, 5, 240, 180),
    "8k": ClipRecipe(8_000, 5, 480, 360),
    "8k k=10": ClipRecipe(8_000, 10, 480, 360),
}
STAGES = ("decode forward", "raster forward", "loss", "raster backward", "decode backward", "optimiser")


class StepRun:
    """One clip with its optimiser; frames are trained in turn, as a shuffled order would spread them."""

    def __init__(self, recipe: ClipRecipe) -> None:
        self._config = TrainConfig(gaussians_per_anchor=recipe.gaussians_per_anchor)
        self._model, self._view = make_clip(recipe), make_view(recipe)
        self._gain = nn.Parameter(torch.ones(3), requires_grad=not recipe.is_source)
        self._truth = make_truth(recipe)
        self._workspace = LossWorkspace(recipe.height, recipe.width)
        parameters = named_parameters(self._model, self._gain, self._config)
        self._optimizer = PhaseOptimizer(parameters, n_steps=10_000, config=self._config)
        self._frame = 0
        self.n_gaussians = 0

    def whole(self) -> tuple[float]:
        """One step; its milliseconds."""
        started = time.perf_counter()
        gaussians = self._decode()
        image = render_gaussians(gaussians, self._view).image[0]
        self._loss(image, gaussians).backward()
        self._optimizer.step()
        return ((time.perf_counter() - started) * 1e3,)

    def staged(self) -> tuple[float, ...]:
        """One step; the milliseconds of every stage of STAGES."""
        marks = [time.perf_counter()]

        def mark() -> None:
            marks.append(time.perf_counter())

        gaussians = self._decode()
        mark()
        drawn = Gaussians(*_leaves(gaussians.tensors()), is_frozen=gaussians.is_frozen)
        picture = render_gaussians(drawn, self._view).image[0]
        mark()
        (image,) = _leaves([picture])
        measured = Gaussians(*_leaves(drawn.tensors()))
        self._loss(image, measured).backward()
        mark()
        picture.backward(image.grad)
        mark()
        outputs, gradients = _with_gradients(gaussians, drawn, measured)
        torch.autograd.backward(outputs, gradients)
        mark()
        self._optimizer.step()
        mark()
        return tuple((end - begin) * 1e3 for begin, end in pairwise(marks))

    def _decode(self) -> Gaussians:
        self._frame = (self._frame + 1) % N_FRAMES
        gaussians = self._model.decode(self._frame / N_FRAMES)
        self.n_gaussians = len(gaussians)
        return gaussians

    def _loss(self, image: Tensor, gaussians: Gaussians) -> Tensor:
        found = photometric_loss(
            image,
            self._truth,
            ssim_weight=self._config.ssim_weight,
            gain=self._gain,
            workspace=self._workspace,
        )
        return found.loss + self._config.volume_weight * gaussians.scales.prod(1).mean()


def measure_iteration(size: str, *, is_source: bool, n_runs: int, recipe: ClipRecipe | None = None) -> IterationRow:
    """One size and kind; whole and cut steps in turn.

    Args:
        size: A name of SIZES, or any with `recipe`.
        is_source: Which kind of clip.
        n_runs: Steps that count, of each.
    """
    recipe = recipe or SIZES[size]
    if is_source:
        recipe = ClipRecipe(recipe.n_anchors, recipe.gaussians_per_anchor, recipe.width, recipe.height, is_source=True)
    run = StepRun(recipe)
    timings = interleaved({"whole": run.whole, "staged": run.staged}, n_runs, n_warm=3)
    return IterationRow(
        scene="source" if is_source else "joint",
        size=str(recipe),
        n_gaussians=run.n_gaussians,
        stages=tuple(zip(STAGES, timings["staged"], strict=True)),
        total=timings["whole"][0],
    )


def _leaves(tensors: Sequence[Tensor]) -> list[Tensor]:
    return [tensor.detach().requires_grad_(tensor.requires_grad) for tensor in tensors]


def _with_gradients(gaussians: Gaussians, drawn: Gaussians, measured: Gaussians) -> tuple[list[Tensor], list[Tensor]]:
    """Tensors of the decode that need a gradient, and the sum of what picture and volume term say."""
    outputs, gradients = [], []
    for output, first, second in zip(gaussians.tensors(), drawn.tensors(), measured.tensors(), strict=True):
        found = [leaf.grad for leaf in (first, second) if leaf.grad is not None]
        if output.requires_grad and found:
            outputs.append(output)
            gradients.append(found[0] if len(found) == 1 else found[0] + found[1])
    return outputs, gradients
