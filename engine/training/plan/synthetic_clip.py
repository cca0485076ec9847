"""Synthetic clips to time steps on: anchors spread over a picture and its depth, a field, a decoder, one camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.model.clip_view import View
from engine.model.decoder import Decoder
from engine.model.decoding import ChosenAnchors
from engine.model.model_backend import ModelBackend
from engine.training.config import TrainConfig
from engine.training.preparation.clip_field import fit_field

N_FRAMES = 10
SPLAT_PX = 3.0
"""Median standard deviation of a Gaussian in the picture."""
_LEVELS_SPACING = 1 / 150
"""Share of the scene's depth that the field takes for the distance of anchors: all seven levels are used."""


@dataclass(frozen=True, slots=True)
class ClipRecipe:
    """Sizes of a synthetic clip.

    Attributes:
        n_anchors: Anchors, all in the picture and alive in every frame.
        n_static: How many of them are static; None for half of them in a source clip, and none otherwise.
        motion_share: Share of the picture's width and height, around its middle, in which the moving ones are.
        gaussians_per_anchor: K.
        width, height: Picture, pixels.
        is_source: Static anchors frozen, and heads as in a source clip; else everything learns.
    """

    n_anchors: int
    gaussians_per_anchor: int = 5
    width: int = 480
    height: int = 360
    is_source: bool = False
    n_static: int | None = None
    motion_share: float = 1.0

    def __str__(self) -> str:
        return f"{self.n_anchors} anchors, k={self.gaussians_per_anchor}, {self.width}x{self.height}"


def make_clip(
    recipe: ClipRecipe, *, backend: ModelBackend, seed: int = 0, config: TrainConfig | None = None
) -> ClipModel:
    """A clip with random features, so that no head is at its start. Same seed, same clip but for its dtype.

    Without moving anchors it has no field. `config` gives the widths; the recipe's number of Gaussians counts.
    """
    generator = torch.Generator().manual_seed(seed)
    config = config or TrainConfig(gaussians_per_anchor=recipe.gaussians_per_anchor)
    decoder = Decoder(
        static_dim=config.static_feature_dim,
        dynamic_dim=config.dynamic_feature_dim,
        gaussians_per_anchor=recipe.gaussians_per_anchor,
        hidden=config.head_hidden,
        generator=generator,
    )
    n_static = recipe.n_static
    if n_static is None:
        n_static = recipe.n_anchors // 2 if recipe.is_source else 0
    sets = {}
    if n_static:
        sets["static"] = _anchors(recipe, n_static, config, generator, is_moving=False)
    role = "residual" if recipe.is_source else "moving"
    if recipe.n_anchors > n_static:
        sets[role] = _anchors(recipe, recipe.n_anchors - n_static, config, generator, is_moving=True)
    if recipe.is_source:
        for anchors in sets.values():
            anchors.requires_grad_(requires_grad=anchors.is_dynamic)
    model = ClipModel(sets=sets, decoder=decoder, field=None, clip_length=N_FRAMES, n_frames=N_FRAMES, backend=backend)
    if recipe.is_source:
        learns_heads = config.learns_moving_heads and recipe.n_anchors > n_static
        model.freeze_still_parts(learns_heads=learns_heads)
    fit_field(model, spacing=8.0 * _LEVELS_SPACING, config=config, generator=generator)
    with torch.no_grad():
        for table in [] if model.field is None else model.field.tables:  # away from its start of nearly zero
            table.mul_(300.0)
    return model


def make_view(recipe: ClipRecipe) -> View:
    """The camera that sees all anchors, at the origin."""
    focal = 0.9 * recipe.width
    K = np.array([[focal, 0.0, recipe.width / 2], [0.0, focal, recipe.height / 2], [0.0, 0.0, 1.0]])
    return View.from_arrays(np.eye(4), K, width=recipe.width, height=recipe.height, near_plane=0.01)


def make_truth(recipe: ClipRecipe, *, seed: int = 1) -> np.ndarray:
    """A soft picture to compare with. [H, W, 3] uint8"""
    rng = np.random.default_rng(seed)
    coarse = rng.uniform(0, 255, (-(-recipe.height // 12), -(-recipe.width // 12), 3))
    return coarse.repeat(12, 0).repeat(12, 1)[: recipe.height, : recipe.width].astype(np.uint8)


def chosen_anchors(model: ClipModel, *, has_field: bool = True) -> list[ChosenAnchors]:
    """All anchors of a clip as `decode_anchors` takes them; without field for f_d = 0."""
    field = model.field if has_field else None
    chosen = []
    for role in model.roles():
        anchors = model.anchor_set(role)
        corners = field.corners(anchors.positions) if field is not None and anchors.is_dynamic else None
        chosen.append(ChosenAnchors(anchors=anchors, rows=torch.arange(len(anchors)), corners=corners))
    return chosen


def _anchors(
    recipe: ClipRecipe, n_rows: int, config: TrainConfig, generator: torch.Generator, *, is_moving: bool
) -> AnchorSet:
    def uniform(low: float, high: float) -> Tensor:
        return low + (high - low) * torch.rand(n_rows, generator=generator)

    focal = 0.9 * recipe.width
    z = uniform(2.0, 10.0)
    reach = 0.5 * (recipe.motion_share if is_moving else 1.0)
    x = uniform(-reach, reach) * recipe.width / focal * z
    y = uniform(-reach, reach) * recipe.height / focal * z
    log_px = (z / focal).log()[:, None].expand(n_rows, 3)
    anchors = AnchorSet.from_cloud(
        torch.stack([x, y, z], 1),
        torch.rand(n_rows, 3, generator=generator),
        spacing=1.0,
        feature_dim=config.static_feature_dim,
        presence=torch.ones(n_rows, N_FRAMES, dtype=torch.bool) if is_moving else None,
    )
    with torch.no_grad():
        anchors.features.copy_(torch.randn(anchors.features.shape, generator=generator))
        anchors.log_offset_scales.copy_(log_px + math.log(2 * SPLAT_PX))
        anchors.log_base_scales.copy_(log_px + math.log(2 * SPLAT_PX))  # the shape head halves it
    return anchors
