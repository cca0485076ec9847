"""Backend: the operations that a clip is trained with, behind one object; and the values that they return."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from torch import Tensor

from engine.backends.phase import Phase, PhasePlan
from engine.model.model_backend import ModelBackend

ADAM_BETAS = 0.9, 0.999
ADAM_EPSILON = 1e-15
"""Far below any gradient: rarely seen anchors must not be slowed down by it."""


@dataclass(frozen=True, slots=True)
class PhotometricLoss:
    """Loss of one picture.

    Attributes:
        loss: Scalar, differentiable in image and gain.
        mean_square: Mean of (image * gain - truth)^2 over the whole picture; what does not count adds zero, and so do
            tiles that are not active. Scalar, without gradient.
    """

    loss: Tensor
    mean_square: Tensor


class Adam(Protocol):
    """Moments of the parameters. Owns neither parameters nor rates. A parameter without a gradient is left alone,
    moments and step count included.

    Attributes:
        steps: How often each parameter was updated; whoever takes back a step that changed nothing sets it back.
    """

    steps: dict[str, int]

    def step(
        self, gradients: Mapping[str, Tensor], rates: Mapping[str, float], *, max_norm: float, is_sound: Tensor
    ) -> Tensor:
        """One step of the parameters that have a gradient. It counts, but changes no value, where `is_sound` is false
        or the norm is not finite; the host need not know.

        Args:
            max_norm: Gradients of a larger norm are scaled down to it; 0 for none.
            is_sound: Scalar bool, on the device.
        Returns:
            Euclidean norm over all gradients, not finite if one of them is not. Scalar
        """
        ...

    def state(self) -> dict[str, dict[str, Tensor]]:
        """exp_avg, exp_avg_sq and step of every parameter that was ever updated. Copies."""
        ...

    def restore(self, name: str, state: Mapping[str, Tensor]) -> None:
        """Inverse of `state` for one parameter; takes any device and floating dtype.

        Raises:
            ValueError: A moment is not of the parameter's shape.
        """
        ...


class Backend(ModelBackend, Protocol):
    """The computations that train a clip. Stateless, so that threads may share one.

    Arguments are those of the public calls, already checked: `engine.raster.rasterize`, `engine.model.decoding`,
    `engine.model.joining` and `engine.training.step.losses`. Tensors are on `device` throughout.
    """

    @property
    def name(self) -> str:
        """As in `engine.backends.table`."""
        ...

    def is_available(self) -> bool:
        """Whether it works on this machine, tried on something small; at most a second, and without compiling."""
        ...

    def warm_up(self, *, is_training: bool) -> None:
        """Load what its operations need into this process: those of a training step, or of pictures alone."""
        ...

    def photometric_loss(
        self,
        image: Tensor,
        truth: Tensor,
        *,
        ssim_weight: float,
        gain: Tensor | None,
        is_counted: Tensor | None,
        tile_mask: Tensor | None,
        rest: Tensor | None,
    ) -> PhotometricLoss:
        """L1 and SSIM of one picture, see `engine.training.step.losses.photometric_loss`."""
        ...

    def tile_squares(self, image: Tensor, truth: Tensor, gain: Tensor) -> Tensor:
        """Sums of (image * gain - truth / 255)^2 over tiles. [rows, columns] float64

        Args:
            image: [H, W, 3]
            truth: [H, W, 3] uint8
            gain: [3]
        """
        ...

    def volume_sum(self, scales: Tensor, unit: float) -> Tensor:
        """Sum of the products of three scales [N, 3], in cubes of `unit` scene units; differentiable."""
        ...

    def adam(self, parameters: Mapping[str, Tensor]) -> Adam:
        """Fresh moments for these parameters, which must keep their memory; of this back end's dtype and device."""
        ...

    def phase(self, plan: PhasePlan) -> Phase | None:
        """The backend's own way to do all steps of a phase; None where the operations above do them one by one."""
        ...
