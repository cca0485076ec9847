"""A back end of these tests alone: the reference, which counts what it is asked for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from engine.backends.backend import PhotometricLoss
from engine.backends.reference.adam import ReferenceAdam
from engine.backends.reference.backend import ReferenceBackend
from engine.raster import Gaussians, Rendering, TileBoxes


class CountingBackend:
    """Hands everything on and counts it."""

    name = "counting"
    device = torch.device("cpu")
    dtype = torch.float32

    def __init__(self) -> None:
        self.n_calls: Counter[str] = Counter()
        self._reference = ReferenceBackend()

    def rasterize(self, *arguments: Any, **options: Any) -> Rendering:
        self.n_calls["rasterize"] += 1
        return self._reference.rasterize(*arguments, **options)

    def tile_boxes(self, *arguments: Any, **options: Any) -> TileBoxes:
        self.n_calls["tile_boxes"] += 1
        return self._reference.tile_boxes(*arguments, **options)

    def decode(self, *arguments: Any, **options: Any) -> Gaussians:
        self.n_calls["decode"] += 1
        return self._reference.decode(*arguments, **options)

    def join(self, *arguments: Any, **options: Any) -> Gaussians:
        self.n_calls["join"] += 1
        return self._reference.join(*arguments, **options)

    def photometric_loss(self, *arguments: Any, **options: Any) -> PhotometricLoss:
        self.n_calls["photometric_loss"] += 1
        return self._reference.photometric_loss(*arguments, **options)

    def tile_squares(self, *arguments: Any, **options: Any) -> Tensor:
        self.n_calls["tile_squares"] += 1
        return self._reference.tile_squares(*arguments, **options)

    def volume_sum(self, *arguments: Any, **options: Any) -> Tensor:
        self.n_calls["volume_sum"] += 1
        return self._reference.volume_sum(*arguments, **options)

    def adam(self, parameters: Mapping[str, Tensor]) -> ReferenceAdam:
        self.n_calls["adam"] += 1
        return self._reference.adam(parameters)
