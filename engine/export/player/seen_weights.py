"""How much of the pictures each Gaussian makes up: what is loaded first, and what is not worth its bytes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch

from engine.camera.rig import CameraRig
from engine.export.splats import Splats
from engine.raster.rasterize import rasterize
from engine.raster.rasterizer import Rasterizer

N_VIEWS = 8
"""Cameras are looked through, spread over the rig."""
WIDTH_PX = 320
"""Pictures are at most so wide."""
UNSEEN = 0.05 / (320 * 180)
"""A share of the picture below which a moving Gaussian is not stored for a slow line: 55 dB and more without them."""

Weigh = Callable[[Splats], np.ndarray]
"""Opacity times area in the picture, as far as nothing hides it, as a share of the picture. [N] float32, by rows [N]"""


@dataclass(frozen=True, slots=True)
class SeenWeights:
    """The weights of Gaussians in the pictures of some cameras of a rig: of each the largest. A `Weigh`.

    Attributes:
        rig: The cameras to look through.
        near_plane: Scene units.
        backend: It draws.
    """

    rig: CameraRig
    near_plane: float
    backend: Rasterizer

    @classmethod
    def of(cls, rig: CameraRig, near_plane: float, backend: Rasterizer) -> SeenWeights:
        """Through a few cameras of a capture, in small pictures."""
        some = rig.subset(np.unique(np.linspace(0, len(rig) - 1, N_VIEWS).round().astype(np.int64)))
        shares = np.minimum(1.0, WIDTH_PX / some.image_sizes[:, :1])
        return cls(some.resized(np.maximum(1, (some.image_sizes * shares).astype(np.int64))), near_plane, backend)

    def __call__(self, splats: Splats) -> np.ndarray:
        """See `Weigh`."""
        found = np.zeros(len(splats), np.float32)
        if not len(splats):
            return found
        plain = splats.gaussians()
        for world_to_camera, K, size in zip(
            self.rig.world_to_camera, self.rig.Ks, self.rig.image_sizes.tolist(), strict=True
        ):
            colors = torch.zeros_like(plain.colors, requires_grad=True)
            with torch.enable_grad():
                image = rasterize(
                    replace(plain, colors=colors),
                    torch.from_numpy(world_to_camera[None]).float(),
                    torch.from_numpy(K[None]).float(),
                    *size,
                    backend=self.backend,
                    near_plane=self.near_plane,
                ).image
                image[..., 0].mean().backward()  # what a colour weighs in the picture
            assert colors.grad is not None
            found = np.maximum(found, colors.grad[:, 0].numpy())
        return found


def weight_by_size(splats: Splats) -> np.ndarray:
    """The same without cameras: opacity times the product of the two longer sides. A `Weigh`."""
    sides = np.sort(splats.scales, axis=1)
    return splats.opacities * sides[:, 1] * sides[:, 2]
