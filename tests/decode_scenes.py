"""Scenes of the decode tests: three sets of anchors with their heads and their field, in the sizes of the presets."""

from __future__ import annotations

import copy
from typing import Any

import torch

from engine.backends.table import backend_called
from engine.clip_files.clip_header import FieldShape
from engine.model.anchors import AnchorSet
from engine.model.decoder import Decoder
from engine.model.decoding import ChosenAnchors, decode_anchors
from engine.model.field import SpatioTemporalField
from engine.model.motion import AnchorMotion
from engine.raster.gaussians import Gaussians

PAPER: dict[str, Any] = {"features": 64, "hidden": 64, "k": 10}
ODD: dict[str, Any] = {"features": 5, "hidden": 20, "k": 5}
PRESET: dict[str, Any] = {"features": 16, "hidden": 64, "k": 5}
SINGLE: dict[str, Any] = {"features": 3, "hidden": 7, "k": 1}


class Scene:
    """A static, a moving and a residual set with their heads and their field, all learning."""

    def __init__(
        self,
        *,
        features: int = 5,
        hidden: int = 20,
        k: int = 5,
        n: int = 70,
        channels: int = 4,
        spread: float = 1.0,
        is_shared: bool = False,
        is_rectified: bool = False,
    ) -> None:
        self.generator = torch.Generator().manual_seed(n)
        shape = FieldShape(
            n_knots=3, cells=(3, 7, 12), n_entries=512, channels=channels, hidden=hidden, feature_dim=features,
            bounds_min=(0.0, 0.0, 0.0), side=1.0, is_shared=is_shared,
            is_rectified=is_rectified,
        )  # fmt: skip
        self.field = SpatioTemporalField(shape, self.generator)
        self.decoder = Decoder(
            static_dim=features, dynamic_dim=features, gaussians_per_anchor=k, hidden=hidden, generator=self.generator
        )
        with torch.no_grad():
            for table in self.field.tables:
                table.normal_(generator=self.generator)
        self.sets = {
            "static": self._anchors(n, features, spread, is_dynamic=False),
            "moving": self._anchors(n + 1, features, spread, is_dynamic=True),
            "residual": self._anchors(n // 2, features, spread, is_dynamic=True, travels=True),
        }

    def _anchors(self, n: int, features: int, spread: float, *, is_dynamic: bool, travels: bool = False) -> AnchorSet:
        def random(*size: int) -> torch.Tensor:
            return torch.rand(*size, generator=self.generator)

        presence = torch.ones(n, 3, dtype=torch.bool) if is_dynamic else None
        anchors = AnchorSet.from_cloud(
            random(n, 3),
            random(n, 3),
            spacing=0.1,
            feature_dim=features,
            presence=presence,
            motion=AnchorMotion(3 * random(n).round(), random(n, 3) - 0.5, 0.1 * random(n, 3)) if travels else None,
        )
        with torch.no_grad():
            anchors.features.normal_(generator=self.generator).mul_(spread)
            anchors.log_offset_scales.add_(random(n, 3))
            anchors.log_base_scales.add_(random(n, 3))
        return anchors

    def double(self) -> Scene:
        """A copy in float64, without gradients."""
        twin = copy.deepcopy(self)
        for module in twin.modules():
            module.double()
        for parameter in twin.parameters().values():
            parameter.grad = None
        return twin

    def modules(self) -> list[torch.nn.Module]:
        return [self.field, self.decoder, *self.sets.values()]

    def parameters(self) -> dict[str, torch.nn.Parameter]:
        named = {"field": self.field, "decoder": self.decoder, **self.sets}
        return {f"{name}.{key}": p for name, module in named.items() for key, p in module.named_parameters()}

    def rows(self, *, share: float = 0.7) -> dict[str, torch.Tensor]:
        generator = torch.Generator().manual_seed(5)
        chosen = {}
        for role, anchors in self.sets.items():
            order = torch.randperm(len(anchors), generator=generator)
            chosen[role] = order[: int(share * len(anchors))].sort().values
        return chosen

    def decode(self, rows: dict[str, torch.Tensor], knots: list, backend: str, decoded: Any = None) -> Gaussians:
        chosen = [
            ChosenAnchors(
                anchors=anchors,
                rows=rows[role],
                corners=self.field.corners(anchors.positions.float()) if anchors.is_dynamic else None,
                decoded=decoded if role == "static" else None,
                moved=anchors.positions_at(moment(knots)) if anchors.travels else None,
            )
            for role, anchors in self.sets.items()
        ]
        return decode_anchors(chosen, self.decoder, self.field, knots, backend=backend_called(backend))


def moment(knots: list) -> float:
    """The frame, or the time between two, that knots stand for."""
    return sum(knot * weight for knot, weight in knots)


def backward(gaussians: Gaussians) -> None:
    generator = torch.Generator().manual_seed(9)
    weights = [torch.randn(t.shape, generator=generator).to(t.dtype) for t in gaussians.tensors()]
    torch.autograd.backward(gaussians.tensors(), weights)
