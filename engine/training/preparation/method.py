"""Method: the decisions by which a clip is prepared and trained; this class is the method of the product.

They are about a clip's start, the parts that learn, the anchors it adds, the frames in which its anchors exist, its
field, and the pixels of a step. A variant overrides single decisions (engine.training.variants); preparation and
training ask here and do not know which it is.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import torch

from engine.capture.clip import Clip
from engine.clip_files.clip_state import ClipState
from engine.cloud.motion.moving_cloud import MovingCloud
from engine.gate.regions import GateRegion
from engine.model.clip_model import ClipModel
from engine.training.config import TrainConfig
from engine.training.preparation.building import ResidualAnchors, adapt_heads, adapt_moving, uncovered_points
from engine.training.preparation.clip_field import fit_field
from engine.training.preparation.gating import decide


class Method:
    """The decisions. Owns nothing; the numbers are those of the settings.

    Attributes:
        learns_inherited: Whether all inherited anchors keep learning; they are stored with the clip then.
        learns_heads: Whether heads learn in a source clip, all or those of what moves.
        builds_static: Whether a source clip has its own static anchors in place of all inherited ones.
        has_light: Whether inherited still parts are given the light of the clip.
        obeys_regions: Whether regions that the user marks count.
        has_active_tiles: Whether a step of a source clip may leave out tiles that nothing learning touches.
        keeps_unread_entries: Whether entries of the field that no anchor of the clip reads are stored.
        inherits_schedule: Whether the rates of a source clip stay where those of the reference clip ended.
    """

    learns_inherited = False
    learns_heads = True
    builds_static = False
    has_light = True
    obeys_regions = True
    has_active_tiles = True
    keeps_unread_entries = False
    inherits_schedule = False

    def base(self, reference: ClipState | None, previous: ClipState | None) -> ClipState | None:
        """The reference clip that a clip inherits from; None for a clip that inherits nothing."""
        return reference

    def words(self, config: TrainConfig) -> str:
        """How a source clip treats the parts that it takes over, in one line."""
        moving = ", moving ones keep learning" if config.inherit == "moving" else ""
        moving = ", moving ones replaced by such as travel" if config.anchors_travel else moving
        return f"inherited anchors kept{moving}, decoder kept for still parts"

    def choose_decoder(self, model: ClipModel, *, seed: int) -> None:
        """The heads that a source clip starts with: those of the reference clip, as they are.

        Args:
            model: With the heads of the reference clip.
            seed: Of new heads.
        """
        model.decoder.requires_grad_(requires_grad=False)

    def covering(self, model: ClipModel) -> list[str]:
        """Roles of the inherited anchors that cover new points: those that can change, and so show them."""
        return ["moving"]

    def choose_residual(
        self, cloud: MovingCloud, is_new: np.ndarray, n_used: int, config: TrainConfig
    ) -> ResidualAnchors:
        """The moving points of a source clip that become anchors: those that inherited anchors do not cover.

        Args:
            cloud: The clip's moving points.
            is_new: Points that no inherited anchor covers. [P] bool
            n_used: Inherited anchors that exist in some frame of the clip.
            config: Gives the most anchors.
        """
        return uncovered_points(cloud, is_new, n_used, config)

    def adapt(self, model: ClipModel, config: TrainConfig) -> None:
        """What becomes the clip's own: the moving anchors that exist in it, with inherit=moving, and heads for them."""
        if config.inherit == "moving":
            adapt_moving(model)
        adapt_heads(model)

    def gate(
        self, model: ClipModel, regions: Sequence[GateRegion], *, is_source: bool
    ) -> tuple[dict[str, np.ndarray], str]:
        """Which anchors have a dynamic feature and exist when: static ones have none, except where the user says so.

        Returns:
            Reasons by the name under which the clip stores them, and the decision in one line; both empty where
            nothing was decided.
        """
        if not regions or model.anchor_set("static").is_dynamic:
            return {}, ""
        return decide(model, regions, is_source=is_source)

    def attach_field(
        self,
        model: ClipModel,
        clip: Clip,
        config: TrainConfig,
        *,
        spacing: float,
        previous: ClipState | None,
        generator: torch.Generator,
    ) -> str:
        """Give a clip its own fresh field; reports its size.

        Args:
            spacing: Distance between moving anchors, scene units.
            previous: The clip before, finished, where it is known.
        """
        return fit_field(model, spacing=spacing, config=config, generator=generator)

    def final_ratios(self, names: Iterable[str], config: TrainConfig) -> dict[str, float]:
        """Final rates of parameters that do not end at `config.final_lr_ratio`, as shares of their start.

        Args:
            names: Of all parameters that learn.
        """
        return {}
