"""One training step on a synthetic clip: whole, cut into its stages, or with its values kept to find errors.

Stages are timed by cutting the graph at their boundaries: a stage's output becomes a leaf of the next one, whose
gradient is then handed back. The whole step is timed without cuts; it includes autograd's work between stages.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import torch
from torch import Tensor, nn

from app.lab.bench.compared import FAST
from engine.backends.backend import Backend
from engine.model.clip_view import View, render_gaussians
from engine.raster.gaussians import Gaussians
from engine.training.config import TrainConfig
from engine.training.optimizer.optimizer import PhaseOptimizer, named_parameters, schedule_of
from engine.training.plan.synthetic_clip import N_FRAMES, ClipRecipe, make_clip, make_truth, make_view
from engine.training.step.losses import photometric_loss

STAGES = ("decode forward", "raster forward", "loss", "raster backward", "decode backward", "optimiser")


@dataclass(frozen=True, slots=True)
class StepWindow:
    """The part of the picture that a step draws and compares, pixels."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class StepOutcome:
    """The results of one step, copies.

    Attributes:
        image: Picture before the gain. [H, W, 3]
        loss: Photometric loss and volume term.
        gradients: By name, of every trainable tensor that took part.
        updates: By name, Adam's change to each of these.
    """

    image: Tensor
    loss: float
    gradients: dict[str, Tensor]
    updates: dict[str, Tensor]


class StepRun:
    """One clip with its optimiser; frames are trained in turn, as a shuffled order would spread them.

    Args:
        recipe: Sizes of the clip; the same recipe makes the same clip.
        backend: The back end to compute with.
        window: Part of the picture that is drawn and compared, by the same camera; None for all of it.
    """

    def __init__(self, recipe: ClipRecipe, *, backend: Backend = FAST, window: StepWindow | None = None) -> None:
        self._config = TrainConfig(gaussians_per_anchor=recipe.gaussians_per_anchor)
        window = window or StepWindow(0, 0, recipe.width, recipe.height)
        self._backend = backend
        self._model = make_clip(recipe, backend=backend)
        self._view = _seen_through(make_view(recipe), window)
        gain = torch.ones(3, dtype=backend.dtype)
        self._gain = nn.Parameter(gain, requires_grad=not recipe.is_source)
        rows, columns = slice(window.top, window.top + window.height), slice(window.left, window.left + window.width)
        self._truth = torch.from_numpy(make_truth(recipe)[rows, columns].copy())
        parameters = named_parameters(self._model, self._gain, self._config)
        self._parameters = {name: parameter for name, (parameter, _) in parameters.items()}
        schedule = schedule_of(parameters, self._config, n_steps=10_000)
        self._optimizer = PhaseOptimizer(self._parameters, schedule=schedule, backend=backend)
        self._frame = 0
        self.n_gaussians = 0

    def whole(self) -> tuple[float]:
        """One step; its milliseconds."""
        started = time.perf_counter()
        gaussians = self._decode()
        image = self._draw(gaussians)
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
        picture = self._draw(drawn)
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

    def kept(self) -> StepOutcome:
        """One step; its results."""
        gaussians = self._decode()
        image = self._draw(gaussians)
        loss = self._loss(image, gaussians)
        loss.backward()
        learning = self._parameters.items()
        gradients = {name: parameter.grad.clone() for name, parameter in learning if parameter.grad is not None}
        return StepOutcome(image.detach(), loss.item(), gradients, self.updated(gradients))

    def updated(self, gradients: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """One step of Adam with these gradients, by name; the change of each parameter."""
        before = {name: self._parameters[name].detach().clone() for name in gradients}
        for name, parameter in self._parameters.items():
            gradient = gradients.get(name)
            parameter.grad = None if gradient is None else gradient.to(parameter.dtype)
        self._optimizer.step()
        return {name: self._parameters[name].detach() - value for name, value in before.items()}

    def _decode(self) -> Gaussians:
        self._frame = (self._frame + 1) % N_FRAMES
        gaussians = self._model.decode(self._frame / N_FRAMES)
        self.n_gaussians = len(gaussians)
        return gaussians

    def _draw(self, gaussians: Gaussians) -> Tensor:
        return render_gaussians(gaussians, self._view, backend=self._backend).image[0]

    def _loss(self, image: Tensor, gaussians: Gaussians) -> Tensor:
        found = photometric_loss(
            image,
            self._truth,
            backend=self._backend,
            ssim_weight=self._config.ssim_weight,
            gain=self._gain,
        )
        return found.loss + self._config.volume_weight * gaussians.scales.prod(1).mean()


def _seen_through(view: View, window: StepWindow) -> View:
    """The camera of a part of the picture: the same rays."""
    K = view.K.clone()
    K[0, 2] -= window.left
    K[1, 2] -= window.top
    return replace(view, K=K, width=window.width, height=window.height)


def _leaves(tensors: Sequence[Tensor]) -> list[Tensor]:
    return [tensor.detach().requires_grad_(tensor.requires_grad) for tensor in tensors]


def _with_gradients(gaussians: Gaussians, drawn: Gaussians, measured: Gaussians) -> tuple[list[Tensor], list[Tensor]]:
    """Tensors of the decode that need a gradient, and the sums of their gradients by picture and volume term."""
    outputs, gradients = [], []
    for output, first, second in zip(gaussians.tensors(), drawn.tensors(), measured.tensors(), strict=True):
        found = [leaf.grad for leaf in (first, second) if leaf.grad is not None]
        if output.requires_grad and found:
            outputs.append(output)
            gradients.append(found[0] if len(found) == 1 else found[0] + found[1])
    return outputs, gradients
