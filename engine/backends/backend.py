"""Backend: the operations that a clip is trained with, behind one object; and the values that they return."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from torch import Tensor

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
            tiles that are not active.
    """

    loss: Tensor
    mean_square: float


class Adam(Protocol):
    """Moments of the parameters. Owns neither parameters nor rates. A parameter without a gradient is left alone,
    moments and step count included."""

    def norm(self, gradients: Mapping[str, Tensor]) -> float:
        """Euclidean norm over all gradients; not finite if one of them is not."""
        ...

    def update(self, gradients: Mapping[str, Tensor], rates: Mapping[str, float], scale: float) -> None:
        """One step of the parameters that have a gradient, which is multiplied by `scale`. Called after `norm` of the
        same gradients."""
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
    """What a clip is trained with. Stateless, so that threads may share one.

    Arguments are those of the public calls, already checked: `engine.raster.rasterize`, `engine.model.decoding`,
    `engine.model.joining` and `engine.training.step.losses`. Tensors come and go on `device`.
    """

    @property
    def name(self) -> str:
        """As in `engine.backends.table`."""
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
