"""Phase: many steps of a training as one piece of work, which a back end may do by itself.

Single operations wait for each other, and for whoever calls them. A phase takes everything that its steps need, owns it
while it runs (parameters, pictures, what a camera sees, which tiles are drawn, moments of the optimiser), and gives
numbers back once in many steps. Where a back end has none of its own, its operations do the steps one by one
(`engine.training.step.stepwise_phase`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from torch import Tensor, nn

from engine.model.clip_model import ClipModel
from engine.model.clip_view import View
from engine.raster.gaussians import Gaussians


class ItemPlace(NamedTuple):
    """What an item is a picture of.

    Attributes:
        camera_row: Of the training cameras.
        window: Of the camera's picture.
        clip_time: In [0, 1).
    """

    camera_row: int
    window: int
    clip_time: float


class PhasePictures(Protocol):
    """The pictures to draw and compare, by the numbers of items: windows of captured pictures. Arrays stay as they are
    while a phase runs."""

    def place(self, item: int) -> ItemPlace:
        """Camera, window and time."""
        ...

    def truth(self, item: int) -> np.ndarray:
        """[H, W, 3] uint8, or float32 in 0..1"""
        ...

    def counted(self, item: int) -> np.ndarray | None:
        """Pixels that count; None for those that the camera sees. [H, W] bool"""
        ...


class PhaseCameras(Protocol):
    """The cameras that it is seen through, as engine.training.step.training_cameras has them."""

    is_learning: bool
    first_views: list[View]
    """Of whole pictures."""

    def view(self, row: int) -> View:
        """View of one camera's whole picture, as it is by now."""
        ...

    def watch(self, gaussians: Gaussians) -> None:
        """Keep the gradients of Gaussians that are about to be drawn, where cameras learn."""
        ...

    def take_gradient(self, row: int) -> None:
        """After the backward pass of a picture of one camera: what it says of that camera."""
        ...

    def settle(self) -> None:
        """After a step: back into the gauge."""
        ...


class PhaseWindows(Protocol):
    """The windows of a camera's picture, as engine.training.windows has them."""

    def row(self, camera_row: int, index: int) -> int:
        """Number of a camera's window among those of all cameras."""
        ...

    def view(self, whole: View, index: int) -> View:
        """The window as a camera sees it."""
        ...

    def views(self, wholes: Sequence[View]) -> list[View]:
        """All windows of all cameras."""
        ...

    def cut_all(self, pictures: np.ndarray | None) -> list[np.ndarray] | None:
        """All windows of a picture of each camera [C, H, W, ...]; None for None."""
        ...


@dataclass(frozen=True, slots=True)
class Schedule:
    """How fast parameters learn.

    Attributes:
        n_steps: Of the phase, over which rates fall.
        rates: At the start, by the parameter's name.
        final_ratios: The share of them left at the end; they fall log-linearly.
        max_gradient_norm: Gradients with a larger norm are scaled down to it; 0 for none.
    """

    n_steps: int
    rates: Mapping[str, float]
    final_ratios: Mapping[str, float]
    max_gradient_norm: float


@dataclass(frozen=True, slots=True)
class PhasePlan:
    """The inputs of a phase.

    Attributes:
        model: The clip; what of it learns is among the parameters.
        gains: Colour gains of the cameras. [C, 3]
        cameras: They learn as well where `cameras.is_learning`.
        pictures: The pictures to compare with.
        windows: The parts of the cameras' pictures that items are.
        is_valid: Pixels that cameras see, in every frame; None where they see all. [C, H, W] bool
        parameters: The tensors that learn, by name.
        schedule: How fast.
        reach: How far beyond its anchor a Gaussian may lie, scene units.
        reaches: The same anchor by anchor, where a checkpoint knows it. By role, [A] each
        has_rest: Whether a step may leave out tiles that no learning Gaussian touches.
        ssim_weight, volume_weight: Of the terms of the loss.
        volume_unit: Edge of the cubes that the volume term is counted in, as a mean over the Gaussians; None for the
            sum in scene units.
    """

    model: ClipModel
    gains: nn.Parameter
    cameras: PhaseCameras
    pictures: PhasePictures
    windows: PhaseWindows
    is_valid: np.ndarray | None
    parameters: Mapping[str, nn.Parameter]
    schedule: Schedule
    reach: float
    reaches: Mapping[str, Tensor] | None
    has_rest: bool
    ssim_weight: float
    volume_weight: float
    volume_unit: float | None


@dataclass(frozen=True, slots=True)
class PhaseStats:
    """The results of some steps, read from the device at once.

    Attributes:
        losses, gradient_norms: Of every step.
        mean_square: Of the last picture, over all its pixels.
        n_gaussians: Of the last picture.
        fault: The values not finite in the step after these; None where all steps were done. Nothing has changed
            since the steps before it.
    """

    losses: list[float]
    gradient_norms: list[float]
    mean_square: float
    n_gaussians: int
    fault: Fault | None = None


@dataclass(frozen=True, slots=True)
class Fault:
    """Why a step could not be done.

    Attributes:
        photometric, volume: Terms of its loss.
        n_bad: Rendered values that are not finite.
        n_values: All of them.
        is_of_gradient: Whether the loss is finite, and its gradient not.
        gradients: Names of parameters whose gradient is not finite.
    """

    photometric: float
    volume: float
    n_bad: int
    n_values: int
    is_of_gradient: bool = False
    gradients: tuple[str, ...] = ()


class Phase(Protocol):
    """Steps of one phase of a training. Between two calls the model of the plan holds the result."""

    steps_done: int

    @property
    def reaches(self) -> Mapping[str, Tensor]:
        """As in the plan, decided when the phase began."""
        ...

    def run(self, items: Sequence[int]) -> PhaseStats:
        """One step for each item: draw it, compare, update. Nothing is read from the device before the last one."""
        ...

    def arrays(self) -> dict[str, np.ndarray]:
        """Moments and step counts of the optimiser, for a checkpoint. Copies."""
        ...

    def restore(self, arrays: dict[str, np.ndarray], steps_done: int) -> None:
        """Inverse of `arrays`."""
        ...
