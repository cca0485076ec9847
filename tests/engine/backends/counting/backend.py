"""A back end of these tests alone: another one, which counts what it is asked for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from engine.backends.backend import Adam, Backend, PhotometricLoss
from engine.backends.cpu.backend import CpuBackend
from engine.backends.phase import Phase, PhasePlan
from engine.backends.reference.backend import ReferenceBackend
from engine.raster import Gaussians, Rendering, TileBoxes


class CountingBackend:
    """Hands everything on and counts it."""

    name = "counting"
    device = torch.device("cpu")
    dtype = torch.float32

    def __init__(self, inner: Backend | None = None) -> None:
        self.n_calls: Counter[str] = Counter()
        self._inner = ReferenceBackend() if inner is None else inner

    def is_available(self) -> bool:
        return True

    def warm_up(self, *, is_training: bool) -> None:
        self.n_calls["warm_up"] += 1

    def rasterize(self, *arguments: Any, **options: Any) -> Rendering:
        self.n_calls["rasterize"] += 1
        return self._inner.rasterize(*arguments, **options)

    def tile_boxes(self, *arguments: Any, **options: Any) -> TileBoxes:
        self.n_calls["tile_boxes"] += 1
        return self._inner.tile_boxes(*arguments, **options)

    def decode(self, *arguments: Any, **options: Any) -> Gaussians:
        self.n_calls["decode"] += 1
        return self._inner.decode(*arguments, **options)

    def join(self, *arguments: Any, **options: Any) -> Gaussians:
        self.n_calls["join"] += 1
        return self._inner.join(*arguments, **options)

    def photometric_loss(self, *arguments: Any, **options: Any) -> PhotometricLoss:
        self.n_calls["photometric_loss"] += 1
        return self._inner.photometric_loss(*arguments, **options)

    def tile_squares(self, *arguments: Any, **options: Any) -> Tensor:
        self.n_calls["tile_squares"] += 1
        return self._inner.tile_squares(*arguments, **options)

    def volume_sum(self, *arguments: Any, **options: Any) -> Tensor:
        self.n_calls["volume_sum"] += 1
        return self._inner.volume_sum(*arguments, **options)

    def adam(self, parameters: Mapping[str, Tensor]) -> Adam:
        self.n_calls["adam"] += 1
        return self._inner.adam(parameters)

    def phase(self, plan: PhasePlan) -> Phase | None:
        return self._inner.phase(plan)


class CountingCpu(CountingBackend):
    """The same with the compiled kernels."""

    def __init__(self) -> None:
        super().__init__(CpuBackend())
