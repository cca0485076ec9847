"""Splats: Gaussians as the plain arrays that file formats take, with every row fit to be written."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from engine.raster.gaussians import Gaussians

SH_C0 = 0.28209479177387814
"""The value of the spherical harmonic of degree 0 everywhere: colour = SH_C0 * f_dc + 0.5."""
OPACITY_MARGIN = 1e-6
"""Opacities are kept this far from 0 and 1 where a file stores their logit."""
THINNEST = 1e-10
"""Scale of a side that has none, where a file stores its logarithm; scene units."""
PLY_UP = (0.0, -1.0, 0.0)
"""Which way is up in most files of Gaussians: x right, y down, z forward."""


@dataclass(frozen=True, slots=True)
class Splats:
    """Gaussians in one static scene, colours the same from everywhere. Every number is finite.

    Attributes:
        means: Centres, scene units. [N, 3] float32
        quats: Rotations wxyz, unit length. [N, 4] float32
        scales: Standard deviations along the rotated axes, scene units, > 0. [N, 3] float32
        opacities: In 0..1. [N] float32
        colors: Display-encoded RGB; a little beyond 0..1 is possible. [N, 3] float32
        up: Which way is up, unit length. [3]
        n_dropped: Rows that were left out, because they cannot be drawn.
        sh_degree: Highest degree of the colours in the file that this was read from; those above 0, which change with
            the viewing direction, are left out.
    """

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    colors: np.ndarray
    up: tuple[float, float, float] = PLY_UP
    n_dropped: int = field(default=0, compare=False)
    sh_degree: int = field(default=0, compare=False)

    def __len__(self) -> int:
        return len(self.means)

    def __getitem__(self, rows: np.ndarray | slice) -> Splats:
        """The chosen rows, in the given order."""
        return replace(
            self,
            means=self.means[rows],
            quats=self.quats[rows],
            scales=self.scales[rows],
            opacities=self.opacities[rows],
            colors=self.colors[rows],
        )

    @classmethod
    def of(cls, gaussians: Gaussians) -> Splats:
        """Activated Gaussians as arrays; see `from_arrays`."""
        return cls.from_arrays(*(tensor.detach().cpu().numpy() for tensor in gaussians.tensors()))

    @classmethod
    def from_arrays(
        cls, means: np.ndarray, quats: np.ndarray, scales: np.ndarray, opacities: np.ndarray, colors: np.ndarray
    ) -> Splats:
        """Rows that can be drawn, made fit to be written.

        Rows with a number that is not finite, a rotation without direction, a negative scale or no size at all are
        left out and counted. Rotations become unit length, opacities are held in 0..1, and a side without thickness
        gets one that nobody sees.
        """
        splats, _ = cls.with_kept(means, quats, scales, opacities, colors)
        return splats

    @classmethod
    def with_kept(
        cls, means: np.ndarray, quats: np.ndarray, scales: np.ndarray, opacities: np.ndarray, colors: np.ndarray
    ) -> tuple[Splats, np.ndarray]:
        """The same, and which of the given rows they are. [N] bool"""
        with np.errstate(over="ignore", invalid="ignore"):
            means, scales, colors = (np.asarray(a, np.float32).reshape(-1, 3) for a in (means, scales, colors))
            quats = np.asarray(quats, np.float32).reshape(-1, 4)
            opacities = np.asarray(opacities, np.float32).reshape(-1)
            lengths = np.linalg.norm(quats.astype(np.float64), axis=1)
            numbers = np.concatenate([means, quats, scales, opacities[:, None], colors], axis=1)
            is_kept = np.isfinite(numbers).all(1) & (lengths > 1e-12)
            is_kept &= (scales >= 0.0).all(1) & (scales.max(1, initial=0.0) > 0.0)
        kept_quats = quats[is_kept] / lengths[is_kept, None]
        splats = cls(
            means=np.ascontiguousarray(means[is_kept]),
            quats=kept_quats.astype(np.float32),
            scales=np.maximum(scales[is_kept], np.float32(THINNEST)),
            opacities=np.clip(opacities[is_kept], 0.0, 1.0),
            colors=np.ascontiguousarray(colors[is_kept]),
            n_dropped=int(len(is_kept) - is_kept.sum()),
        )
        return splats, is_kept

    def gaussians(self) -> Gaussians:
        """The Gaussians for a rasterizer, on the CPU."""
        import torch

        from engine.raster.gaussians import Gaussians

        columns = (self.means, self.quats, self.scales, self.opacities, self.colors)
        return Gaussians(*(torch.from_numpy(np.array(column, np.float32)) for column in columns))

    @property
    def f_dc(self) -> np.ndarray:
        """Colours as coefficients of degree 0. [N, 3] float32"""
        return ((self.colors - 0.5) / SH_C0).astype(np.float32)

    @property
    def opacity_logits(self) -> np.ndarray:
        """Opacities before the sigmoid, finite. [N] float32"""
        opacities = np.clip(self.opacities.astype(np.float64), OPACITY_MARGIN, 1.0 - OPACITY_MARGIN)
        return np.log(opacities / (1.0 - opacities)).astype(np.float32)


def colors_of(f_dc: np.ndarray) -> np.ndarray:
    """Display-encoded colours of coefficients of degree 0. [N, 3] float32"""
    return (np.asarray(f_dc, np.float64) * SH_C0 + 0.5).astype(np.float32)


def opacities_of(logits: np.ndarray) -> np.ndarray:
    """The sigmoid. [N] float32"""
    return (1.0 / (1.0 + np.exp(-np.asarray(logits, np.float64)))).astype(np.float32)
