"""TrainConfig: every number of a clip's training, with unit and reason. Free of torch so that a window can import it.

Saved as the difference from the defaults; unknown keys and values outside their range are errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import MISSING, asdict, dataclass, fields, replace
from typing import Any, NamedTuple

from engine.errors import ProjectError


class StepRule(NamedTuple):
    """How the steps of a phase follow from what there is to learn from.

    Attributes:
        per_item: Steps per picture, or per background.
        lowest, highest: Bounds of the sum.
    """

    per_item: int
    lowest: int
    highest: int

    def steps(self, n_items: int) -> int:
        """Steps for so many items."""
        return min(max(self.per_item * n_items, self.lowest), self.highest)


STATIC_RULE = StepRule(30, 300, 1000)
JOINT_RULE = StepRule(20, 1200, 6000)
SOURCE_RULE = StepRule(24, 1200, 6000)


@dataclass(frozen=True, slots=True)
class TrainConfig:
    """All settings of one clip's training.

    Defaults follow the small preset: features 16/16, five Gaussians per anchor, a field of at most seven levels
    whose knots lie on the frames. Step counts of 0 mean "derived from the number of training pictures".
    """

    # sizes of the model
    static_feature_dim: int = 16
    """Width of the static feature f_s of an anchor."""
    dynamic_feature_dim: int = 16
    """Width of the dynamic feature f_d that the field gives."""
    gaussians_per_anchor: int = 5
    """K; 4 to 6 once anchors are two to three pixels apart."""
    head_hidden: int = 64
    """Hidden width of each decoder head."""
    field_hidden: int = 64
    """Hidden width of the field's network."""
    field_channels: int = 4
    """Values per hash table entry."""
    field_base_cells: int = 8
    """Cells along the longest side at the coarsest level."""
    field_growth: float = 1.6
    """Ratio of cells between levels."""
    field_max_levels: int = 7
    """Levels are added until a cell is about 1.5 anchor spacings, at most this many."""
    field_levels: int = 0
    """Number of levels; 0 derives it as said above."""
    field_log2_entries: int = 0
    """log2 of the entries per level and table; 0 derives it from the anchors alive in a frame."""
    field_tables: str = "shared"
    """shared: one table for all frames, with time as fourth coordinate of the hash, as published. per_frame: a table
    for every frame, of which a step touches one. Moving pixels of validation cameras after 1000 steps, shared against
    per_frame: half-size sample, two seeds, reference clip 22.1 against 21.8 dB, source clip 19.7 against 19.1;
    basketball, one seed, 25.5 against 25.2 and 23.5 against 22.7."""

    # sizes of the clouds
    max_static_points: int = 22_000
    """Anchors of the static part; the voxel grows until they fit."""
    max_moving_points: int = 32_000
    """Anchors of the moving part over the whole clip. In a reference clip the voxel grows until they fit. A source clip
    keeps that voxel; where its own anchors and the inherited ones in use would be more, some points are left to the
    anchors beside them (engine.cloud.motion.budget). Basketball, clip 3, validation cameras, 1500 steps, one seed:
    42,960
    residual anchors gave 29.04 dB and 25.35 on moving pixels in 1.20 MB, 30,139 of them, as by this number, 29.05 and
    25.35 in 1.00 MB, 20,000 gave 28.94 and 25.04 in 0.83 MB."""
    background_frames: int = 50
    """Frames, spread over the capture, from which each camera's background is estimated."""

    # colours of the cameras
    color: str = "auto"
    """What a training camera's colours are against the scene's: `engine.cloud.background.gains` estimates it, the
    reference clip
    trains it, later clips keep it. auto: a gain per channel where the cameras differ, nothing where they do not.
    gain: always a gain per channel. off: never; every camera shows the scene's own colours.

    There is no offset and no matrix because they give nothing: basketball, reference clip of 1500 steps, gain against
    gain + offset against matrix + offset (3 x 4), training pictures 31.37, 31.46, 31.51 dB, two validation cameras in
    raw colours of the mean camera 28.19, 28.16, 28.18. Fitted to renders of the first, gain, offset and 3 x 4 give the
    validation cameras 28.75, 28.77, 28.81 dB."""

    # length of the training, steps; one step renders one picture
    static_steps: int = 0
    """Steps on the backgrounds before the moving part is added; 0 derives 30 per training camera, 300 to 1000."""
    joint_steps: int = 0
    """Steps of the reference clip after that; 0 derives 20 per training picture, 1200 to 6000. Validation cameras of
    the basketball, one seed: 2000 steps gave 29.3 dB and 26.4 on moving pixels, 6000 gave 29.7 and 27.1."""
    source_steps: int = 0
    """Steps of a source clip; 0 derives 24 per training picture, 1200 to 6000: frozen heads learn more slowly.
    The same cameras: 3000 steps gave 29.2 dB and 24.8 on moving pixels, 6000 gave 29.3 and 25.3."""

    passes: float = 0.0
    """Passes over the training pictures of a clip, for clips of both kinds; 0 keeps the derived steps above."""

    # learning rates; all fall log-linearly over the phase, to `final_lr_ratio` of their start
    feature_lr: float = 7.5e-3
    scale_lr: float = 7e-3
    table_lr: float = 0.04
    field_mlp_lr: float = 8e-3
    """Table and network of the field. Frozen heads leave all change over time to it. Moving pixels of a validation
    camera in the sample's source clip, 1440 steps, one seed: 5e-3 and 2e-3 gave 19.1 dB, 0.02 and 4e-3 20.7, 0.06 and
    4e-3 21.8, 0.05 and 1e-2 21.9. These two lie a little below the best, for both kinds of clip."""
    opacity_head_lr: float = 2e-3
    shape_head_lr: float = 4e-3
    color_head_lr: float = 4e-3
    offset_head_lr: float = 4e-3
    gain_lr: float = 3e-4
    """Per-camera colour gains, reference clip only; not trained where `color` found none."""
    final_lr_ratio: float = 0.02
    """Of every group without a ratio of its own below, where 0 stands for this one and 1 for a constant rate."""
    feature_final_ratio: float = 0.0
    scale_final_ratio: float = 0.0
    field_final_ratio: float = 0.0
    """Table and network of the field."""
    opacity_head_final_ratio: float = 0.0
    shape_head_final_ratio: float = 0.0
    color_head_final_ratio: float = 0.0
    offset_head_final_ratio: float = 0.0

    # loss
    ssim_weight: float = 0.2
    """Loss = (1 - w) L1 + w (1 - SSIM) + volume term."""
    volume_weight: float = 1e-3
    """Weight of the mean Gaussian volume, measured in cubes of the anchor spacing so that no scene scale enters."""
    max_gradient_norm: float = 2.0
    """Norm over all gradients above which they are scaled down to it; 0 switches it off. Far above what a good training
    has, so that it acts on accidents alone: medians are 0.002 to 0.04, the largest norm in a whole training was 0.09 on
    the basketball and 0.12 on the sample. Steps that were clipped are counted in the clip's metrics."""

    # gate
    gate: str = "hull"
    """hull: static anchors have no dynamic feature, moving ones are decoded only at times where that frame's hull
    has them. static: likewise, but moving ones are decoded at all times; what the gate in time is worth. off: the
    published method, every anchor is evaluated at every time."""

    # what a step of a source clip looks at
    tiles: str = "active"
    """active: only tiles that a learning Gaussian touches are drawn, compared and differentiated. all: whole pictures.
    What is learned is the same, bit for bit. Basketball, 640 x 360, a fifth of the tiles active, two shared cores:
    kernels of a step 9 ms instead of 14, the fastest tenth of the steps 13 ms instead of 19."""
    decode_backend: str = "auto"
    """What decodes the anchors of a training step, see engine.model.decode.decoding. auto: fused kernels where they
    can. reference: plain torch, several times slower, to compare with; what is learned is the same but for rounding."""

    # what a source clip takes over; every value but the first is an ablation (ClipGStream, ablation studies)
    decoder: str = "frozen"
    """frozen: the heads of the reference clip as they are. finetune: they go on learning in every source clip.
    new: they start afresh in every source clip."""
    residual: str = "dedup"
    """dedup: residual anchors where the inherited ones leave space uncovered. none: inherited anchors only. full: all
    moving points of the clip become residual anchors, beside the inherited ones that cover them."""
    inherit: str = "frozen"
    """frozen: inherited anchors keep feature and scales. moving: static ones do, and those moving ones that the clip
    uses go on learning as its own. trainable: they all start from them and learn. off: the clip builds static and
    moving anchors of its own; only the decoder is taken over.

    moving against frozen, held-out cameras, later clips: basketball, default steps, moving pixels 26.92 and 26.70 dB,
    all 29.27 and 29.24, an eighth more bytes; sample, passes=8, 23.1 and 22.4, 27.8 and 27.6, a quarter more bytes.
    Not the default, since the method freezes all anchors and the gain is smallest where trainings are long."""
    field: str = "per_clip"
    """per_clip: every clip learns a field from nothing. continue: the field of the clip before goes on learning, and
    its last state shows all clips. joint: one clip, and so one field, for the whole capture."""
    independent: bool = False
    """Every clip is trained as a reference clip is, and shares nothing with the others."""
    start: str = "scratch"
    """Where an independent clip begins. previous: with everything the clip before has learned, and all of it goes on
    learning; with clips of one frame this streams frame by frame."""

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise ProjectError(f"{name} is {value}; it has to lie between {low} and {high}.")
        for name, allowed in _CHOICES.items():
            value = getattr(self, name)
            if value not in allowed:
                listed = f"{', '.join(repr(item) for item in allowed[:-1])} or {allowed[-1]!r}"
                raise ProjectError(f"{name} is {value!r}; it has to be {listed}.")
        if self.independent and self.field == "continue":
            raise ProjectError(
                "independent clips cannot continue each other's field.", hint="Leave out field=continue."
            )
        shared = [name for name in _SHARING if getattr(self, name) != _CHOICES[name][0]]
        if self.independent and shared:
            listed = ", ".join(f"{name}={getattr(self, name)}" for name in shared)
            raise ProjectError(
                f"independent clips take over nothing, so {listed} would change nothing.", hint=f"Leave out {listed}."
            )
        if self.inherit == "off" and self.residual == "none":
            raise ProjectError(
                "inherit=off with residual=none leaves a source clip without anything that moves.",
                hint="Leave out one of them.",
            )
        if self.start == "previous" and not self.independent:
            raise ProjectError("start=previous needs independent=true.", hint="Add it, or leave out start=previous.")

    def difference(self) -> dict[str, Any]:
        """Only the values that differ from the defaults."""
        default = TrainConfig()
        return {name: value for name, value in asdict(self).items() if value != getattr(default, name)}

    def going_on(self) -> TrainConfig:
        """Settings of a clip with start=previous: those of a source clip, and everything inherited learns."""
        learning = {"inherit": "trainable", "decoder": "finetune", "field": "continue"}
        return replace(self, independent=False, start="scratch", **learning)

    @property
    def keeps_static(self) -> bool:
        """Whether a source clip shows the reference clip's static anchors exactly as they are there."""
        return self.inherit in ("frozen", "moving") and self.decoder == "frozen"

    def n_static_steps(self, n_cameras: int) -> int:
        """Steps of the static phase for this many training cameras."""
        return self.static_steps or STATIC_RULE.steps(n_cameras)

    def n_joint_steps(self, n_pictures: int) -> int:
        """Steps of the joint phase of a reference clip with this many training pictures."""
        return self.joint_steps or self._n_pass_steps(n_pictures) or JOINT_RULE.steps(n_pictures)

    def n_source_steps(self, n_pictures: int) -> int:
        """Steps of a source clip with this many training pictures."""
        return self.source_steps or self._n_pass_steps(n_pictures) or SOURCE_RULE.steps(n_pictures)

    def _n_pass_steps(self, n_pictures: int) -> int:
        return math.ceil(self.passes * n_pictures)


_RANGES: dict[str, tuple[float, float]] = {
    "static_feature_dim": (1, 256),
    "dynamic_feature_dim": (1, 256),
    "gaussians_per_anchor": (1, 32),
    "head_hidden": (4, 1024),
    "field_hidden": (4, 1024),
    "field_channels": (1, 16),
    "field_base_cells": (2, 64),
    "field_growth": (1.1, 4.0),
    "field_max_levels": (1, 16),
    "field_log2_entries": (0, 20),
    "max_static_points": (1, 1_000_000),
    "max_moving_points": (1, 1_000_000),
    "background_frames": (2, 1000),
    "static_steps": (0, 1_000_000),
    "joint_steps": (0, 1_000_000),
    "source_steps": (0, 1_000_000),
    "passes": (0.0, 1000.0),
    "field_levels": (0, 16),
    "feature_lr": (0.0, 1.0),
    "scale_lr": (0.0, 1.0),
    "table_lr": (0.0, 1.0),
    "field_mlp_lr": (0.0, 1.0),
    "opacity_head_lr": (0.0, 1.0),
    "shape_head_lr": (0.0, 1.0),
    "color_head_lr": (0.0, 1.0),
    "offset_head_lr": (0.0, 1.0),
    "gain_lr": (0.0, 1.0),
    "final_lr_ratio": (1e-6, 1.0),
    "feature_final_ratio": (0.0, 1.0),
    "scale_final_ratio": (0.0, 1.0),
    "field_final_ratio": (0.0, 1.0),
    "opacity_head_final_ratio": (0.0, 1.0),
    "shape_head_final_ratio": (0.0, 1.0),
    "color_head_final_ratio": (0.0, 1.0),
    "offset_head_final_ratio": (0.0, 1.0),
    "ssim_weight": (0.0, 1.0),
    "volume_weight": (0.0, 10.0),
    "max_gradient_norm": (0.0, 1e6),
}


_CHOICES: dict[str, tuple[str, ...]] = {
    "color": ("auto", "gain", "off"),
    "gate": ("hull", "static", "off"),
    "field_tables": ("shared", "per_frame"),
    "decoder": ("frozen", "finetune", "new"),
    "residual": ("dedup", "none", "full"),
    "inherit": ("frozen", "moving", "trainable", "off"),
    "field": ("per_clip", "continue", "joint"),
    "start": ("scratch", "previous"),
    "tiles": ("active", "all"),
    "decode_backend": ("auto", "reference"),
}
_SHARING = ("decoder", "residual", "inherit")
"""Settings of what a source clip takes over. The first choice of each is the default."""
_BOOLEANS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}

_WORDS = {bool: "true or false", float: "a number", int: "a whole number"}


def _parse_bool(text: str) -> bool:
    try:
        return _BOOLEANS[text.lower()]
    except KeyError as error:
        raise ValueError(text) from error


def parse_overrides(assignments: Sequence[str]) -> dict[str, Any]:
    """Turn ["key=value", ...] into keyword arguments of TrainConfig.

    Raises:
        ProjectError: An assignment is malformed, a key is unknown or a value has the wrong type.
    """
    kinds: dict[str, type] = {f.name: type(f.default) for f in fields(TrainConfig) if f.default is not MISSING}
    values: dict[str, Any] = {}
    for assignment in assignments:
        key, separator, text = assignment.partition("=")
        key = key.strip()
        if not separator:
            raise ProjectError(f"Setting '{assignment}' has no '='.", hint="Write it as key=value.")
        if key not in kinds:
            raise ProjectError(
                f"Setting '{key}' does not exist.",
                hint=f"Known settings: {', '.join(sorted(kinds))}.",
            )
        try:
            parse: Callable[[str], Any] = _parse_bool if kinds[key] is bool else kinds[key]
            values[key] = parse(text.strip())
        except ValueError as error:
            raise ProjectError(f"Setting '{key}' is '{text}', which is not {_WORDS[kinds[key]]}.") from error
    return values
