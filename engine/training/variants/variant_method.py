"""The method with some decisions replaced, as settings name them: ablations, baselines and the published scheme."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase

import numpy as np
import torch
from msgspec.structs import asdict

from engine.capture.clip import Clip
from engine.clip_files.anchor_record import AnchorRecord
from engine.clip_files.clip_state import ClipState
from engine.cloud.motion.moving_cloud import MovingCloud
from engine.errors import ProjectError
from engine.gate.regions import GateRegion
from engine.model.clip_model import ClipModel, decoder_shape
from engine.model.decoder import Decoder
from engine.model.reading import read_field
from engine.training.config import TrainConfig
from engine.training.preparation.building import ResidualAnchors, adapt_heads, adapt_moving
from engine.training.preparation.clip_field import fit_field
from engine.training.preparation.method import Method

_FINAL_RATIOS = {
    "sets.*.features": "feature_final_ratio",
    "sets.*.log_*_scales": "scale_final_ratio",
    "sets.*.positions": "position_final_ratio",
    "field.*": "field_final_ratio",
    **{f"decoder.{head}.*": f"{head}_head_final_ratio" for head in ("opacity", "color", "shape", "offset")},
}
"""Names of parameters to the setting that says where their rates end; 0 stands for `final_lr_ratio`."""


def method_of(config: TrainConfig, *, previous: ClipState | None) -> Method:
    """The method that settings describe.

    Args:
        config: All settings of a clip's training.
        previous: The clip before, finished; with start=previous a clip continues from there.
    """
    if config.start == "previous" and previous is not None:
        return StreamingMethod(config)
    return Method() if _is_product(config) else VariantMethod(config)


def _is_product(config: TrainConfig) -> bool:
    default = TrainConfig()
    names = ["gate", "tiles", "decoder", "residual", "field_form", "initial", "schedule", *_FINAL_RATIOS.values()]
    is_default = all(getattr(config, name) == getattr(default, name) for name in names)
    return is_default and config.inherit in ("frozen", "moving") and config.field != "continue"


class VariantMethod(Method):
    """Every decision as the settings say it.

    Args:
        config: Gives the choices.
    """

    def __init__(self, config: TrainConfig) -> None:
        self._gate, self._learns_moving_heads = config.gate, config.learns_moving_heads
        self.learns_heads = config.decoder in ("finetune", "new") or config.learns_moving_heads
        self._inherit, self._decoder, self._residual = config.inherit, config.decoder, config.residual
        self._is_plain = config.initial == "published"
        self._field_goes_on = config.field == "continue"
        self.learns_inherited = self._inherit == "trainable"
        self.builds_static = self._inherit == "off"
        self.has_light = not self.builds_static and self._gate != "off"
        self.obeys_regions = self._gate != "off"
        self.has_active_tiles = config.tiles == "active"
        # the field may show this clip as the next one leaves it, which reads other entries
        self.keeps_unread_entries = self._field_goes_on
        self.inherits_schedule = config.schedule == "inherited"

    def words(self, config: TrainConfig) -> str:
        moving = "replaced by such as travel" if config.anchors_travel else "learning"
        anchors = {
            "frozen": "kept",
            "moving": f"kept if static, {moving} if moving",
            "trainable": "learning",
            "off": "left out",
        }
        heads = {"frozen": "kept", "moving": "kept", "finetune": "learning", "new": "new"}[self._decoder]
        heads = "learning for what moves" if self._learns_moving_heads else heads
        return f"inherited anchors {anchors[self._inherit]}, decoder {heads}"

    def choose_decoder(self, model: ClipModel, *, seed: int) -> None:
        """New heads have their own generator: other random starts are the same for any choice. Where still parts learn
        or have other heads than before, all parts have one set of heads."""
        if self._decoder in ("finetune", "new") or self.learns_inherited or self.builds_static:
            model.unite_heads()
        if self._decoder == "new":
            model.decoder = Decoder(
                **asdict(decoder_shape(model.decoder)),
                generator=torch.Generator().manual_seed(seed),
                is_plain=self._is_plain,
            ).to(model.backend.device, model.backend.dtype)
        model.decoder.requires_grad_(self._decoder in ("finetune", "new"))

    def covering(self, model: ClipModel) -> list[str]:
        """gate=off: every inherited anchor has a dynamic feature."""
        return model.roles() if self._gate == "off" else super().covering(model)

    def choose_residual(
        self, cloud: MovingCloud, is_new: np.ndarray, n_used: int, config: TrainConfig
    ) -> ResidualAnchors:
        if self._residual == "none":
            return ResidualAnchors(np.zeros_like(is_new), cloud.presence, ~is_new, 0, "residual=none")
        if self._residual == "full":
            every = np.ones_like(is_new)
            return ResidualAnchors(every, cloud.presence, every, 0, "all moving points, residual=full")
        return super().choose_residual(cloud, is_new, n_used, config)

    def adapt(self, model: ClipModel, config: TrainConfig) -> None:
        if self._inherit == "moving":  # which a clip that continues from the one before does not do, whatever is set
            adapt_moving(model, all_of_them=self._gate in ("off", "static"))
        if self._learns_moving_heads:
            adapt_heads(model)

    def gate(
        self, model: ClipModel, regions: Sequence[GateRegion], *, is_source: bool
    ) -> tuple[dict[str, np.ndarray], str]:
        """gate=off: every anchor has a dynamic feature at every time. static: only those that move, at every time."""
        decided: tuple[dict[str, np.ndarray], str] = ({}, "")
        if self._gate != "off":
            decided = super().gate(model, regions, is_source=is_source)
        if self._gate != "hull":
            for role in model.roles():
                anchors = model.anchor_set(role)
                if anchors.is_dynamic or self._gate == "off":
                    shape = len(anchors), model.n_frames
                    anchors.presence = torch.ones(shape, dtype=torch.bool, device=model.backend.device)
        return decided

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
        if self._field_goes_on:
            if previous is not None and previous.header.field:
                return _continue_field(model, previous, clip)
            # later clips move elsewhere in the same scene
            around = model.anchor_set("static").positions.detach().float().cpu() if "static" in model.roles() else None
            return fit_field(model, spacing=spacing, config=config, generator=generator, around=around)
        return super().attach_field(model, clip, config, spacing=spacing, previous=previous, generator=generator)

    def final_ratios(self, names: Iterable[str], config: TrainConfig) -> dict[str, float]:
        own = {
            name: getattr(config, setting)
            for name in names
            for pattern, setting in _FINAL_RATIOS.items()
            if fnmatchcase(name, pattern)
        }
        return {name: ratio for name, ratio in own.items() if ratio}


class StreamingMethod(VariantMethod):
    """start=previous: a clip continues from the whole clip before, and all of it keeps learning."""

    def __init__(self, config: TrainConfig) -> None:
        super().__init__(config.going_on())
        self.has_light = False  # the clip before has learned its own

    def base(self, reference: ClipState | None, previous: ClipState | None) -> ClipState | None:
        return reference if previous is None else merged(previous)


def merged(state: ClipState) -> ClipState:
    """A finished clip as a start for another: its residual anchors count among the moving ones from here on, its
    replacing ones among the promoted."""
    own = {role: record.own for role, record in state.anchors.items() if record.own is not None}
    arrays = dict(state.arrays)
    for added, among in (("residual", "moving"), ("replacing", "promoted")):
        if added not in own:
            continue
        for name in AnchorRecord(own=own[added]).arrays(added):
            del arrays[name]
        anchors = own[among].joined(own[added]) if among in own else own[added]
        arrays |= AnchorRecord(own=anchors).arrays(among)
    return ClipState(arrays, state.header)


def _continue_field(model: ClipModel, previous: ClipState, clip: Clip) -> str:
    """Attach the field of the clip before, which keeps learning; reports it.

    Raises:
        ProjectError: It has fewer frames than this clip.
    """
    field, index = read_field(previous), previous.header.clip_index
    if field.shape.n_knots < clip.n_frames:
        raise ProjectError(
            f"The field of clip {index} has {field.shape.n_knots} frames, clip {clip.clip_index} has "
            f"{clip.n_frames}, so it cannot continue there.",
            hint="Take a clip of full length as reference, or field=per_clip.",
        )
    model.attach_field(field)
    return f"the field of clip {index} continues"
