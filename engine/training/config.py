"""TrainConfig: every setting of a clip's training, each declared once. Free of torch, so that a window can import it.

Stored as the difference from the defaults; unknown names and values outside their range are errors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import msgspec

from engine.errors import ProjectError
from engine.setting import Value, setting, settings_of

MODEL, CLOUDS, COLORS, CAMERAS, LENGTH = "Model", "Point clouds", "Camera colours", "Cameras", "Length of the training"
RATES, LOSS, GATE, STEP, SHARING = "Learning rates", "Loss", "Gate", "Training step", "What a source clip inherits"


class StepRule(NamedTuple):
    """How the steps of a phase follow from the number of pictures or backgrounds.

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

    def text(self, item: str) -> str:
        """The rule in words."""
        return f"0 derives {self.per_item} per {item}, {self.lowest:,} to {self.highest:,}"


STATIC_RULE = StepRule(30, 300, 1000)
JOINT_RULE = StepRule(17, 1200, 3240)
SOURCE_RULE = StepRule(8, 1200, 1620)
QUALITIES = {"draft": 0.4, "standard": 1.0, "best": 3.0}
"""Derived steps of each quality, as a share of those of "standard"."""
MOVING_SHARE = 0.43
"""Share of the steps after the static phase, the last ones, in which only what moves learns: three for four others."""


_MOST_POINTS = 1_000_000


def _size(meaning: str, low: float, high: float, unit: str = "", label: str = "") -> msgspec.Meta:
    return setting(MODEL, meaning, low=low, high=high, unit=unit, label=label)


def _points(meaning: str, label: str) -> msgspec.Meta:
    return setting(CLOUDS, meaning, low=1, high=_MOST_POINTS, unit="anchors", label=label)


def _steps(meaning: str, label: str) -> msgspec.Meta:
    return setting(LENGTH, meaning, low=0, high=1_000_000, unit="steps", label=label)


def _rate(learned: str) -> msgspec.Meta:
    return setting(RATES, f"Learning rate of {learned} at the start of a phase.", low=0.0, high=1.0)


def _final(learned: str) -> msgspec.Meta:
    meaning = f"Share of the rate of {learned} that is left at the end of a phase; 0 takes final_lr_ratio."
    return setting(RATES, meaning, low=0.0, high=1.0)


def _choice(group: str, meaning: str, choices: Mapping[str, str]) -> msgspec.Meta:
    return setting(group, meaning, choices=choices)


class TrainConfig(msgspec.Struct, frozen=True):
    """All settings of one clip's training. Raises ProjectError for a value that a setting may not have.

    The defaults are the small preset. Steps and sizes of 0 are derived from the capture.
    """

    static_feature_dim: Annotated[int, _size("Width of the static feature of an anchor.", 1, 256, "values")] = 16
    dynamic_feature_dim: Annotated[
        int, _size("Width of the dynamic feature that the field gives an anchor.", 1, 256, "values")
    ] = 16
    gaussians_per_anchor: Annotated[
        int, _size("Gaussians that each anchor is decoded to.", 1, 32, "Gaussians", "Gaussians per anchor")
    ] = 5
    head_hidden: Annotated[int, _size("Hidden width of each decoder head.", 4, 1024, "values")] = 64
    field_hidden: Annotated[int, _size("Hidden width of the field's network.", 4, 1024, "values")] = 64
    field_channels: Annotated[int, _size("Values per entry of the field's hash table.", 1, 16, "values")] = 4
    field_base_cells: Annotated[
        int, _size("Cells of the field along the longest side of the scene at the coarsest level.", 2, 64, "cells")
    ] = 8
    field_growth: Annotated[
        float, _size("Ratio of the cells along a side between one level and the next.", 1.1, 4.0)
    ] = 1.6
    field_max_levels: Annotated[
        int,
        _size(
            "Largest number of levels of the field; levels are added until a cell is about 1.5 anchor spacings.",
            1,
            16,
            "levels",
        ),
    ] = 7
    field_levels: Annotated[int, _size("Levels of the field; 0 derives them.", 0, 16, "levels")] = 0
    field_log2_entries: Annotated[
        int, _size("log2 of the entries per level and table; 0 derives it from the anchors alive in a frame.", 0, 20)
    ] = 0
    field_tables: Annotated[
        str,
        _choice(
            MODEL,
            "Hash tables of the field.",
            {
                "graded": "one for all frames, in which the finer a level is, the more frames share its entries",
                "shared": "one for all frames, with time as fourth coordinate, as published",
                "per_frame": "one for every frame, of which a step touches one",
            },
        ),
    ] = "graded"

    field_form: Annotated[
        str,
        _choice(
            MODEL,
            "Box of the field, and the last layer of its network.",
            {
                "fitted": "a cube around nearly all anchors, and no activation",
                "published": "from the first to the last anchor along each axis, and a ReLU",
            },
        ),
    ] = "fitted"
    initial: Annotated[
        str,
        _choice(
            MODEL,
            "Initial values of anchors, heads and field.",
            {
                "cloud": "colours of the cloud, Gaussians spread over the anchor's cell, residual anchors like the "
                "inherited ones beside them",
                "published": "no colour, scales from the distance to three neighbours, features of zero",
            },
        ),
    ] = "cloud"

    cloud: Annotated[
        str,
        _choice(
            CLOUDS,
            "Source of the point clouds that anchors start from.",
            {
                "parts": "static parts by stereo of the backgrounds, moving parts by visual hulls",
                "frames": "everything by stereo of every frame of the clip, as published; needs gate=off; the voxel "
                "grows until a reference clip has no more anchors than both limits below together",
            },
        ),
    ] = "parts"
    backgrounds: Annotated[
        str,
        _choice(
            CLOUDS,
            "Frames that a camera's background is estimated from.",
            {
                "capture": "spread over the whole capture",
                "clip": "frames of the clip itself, so that it can be trained before the capture is complete",
            },
        ),
    ] = "capture"
    max_static_points: Annotated[
        int,
        _points(
            "Largest number of static anchors for pictures of up to 640 x 480; larger ones get more, in proportion to "
            "their sides. The voxel grows until they fit.",
            "Static anchors, at most",
        ),
    ] = 22_000
    max_moving_points: Annotated[
        int,
        _points(
            "Largest number of moving anchors over the whole clip, likewise. In a reference clip the voxel grows until "
            "they fit; a source clip keeps that voxel and leaves some points to neighbouring anchors.",
            "Moving anchors, at most",
        ),
    ] = 32_000
    background_frames: Annotated[
        int,
        setting(
            CLOUDS,
            "Largest number of frames from which each camera's background is estimated.",
            low=2,
            high=1000,
            unit="frames",
        ),
    ] = 50

    color: Annotated[
        str,
        _choice(
            COLORS,
            "How a training camera's colours relate to the scene's: estimated first, trained with the reference "
            "clip, kept by later clips. Except with `off`, how its exposure changes from frame to frame is measured in "
            "every clip and removed.",
            {
                "auto": "a gain per channel where the cameras differ",
                "gain": "a gain per channel, always",
                "off": "every camera shows the scene's own colours",
            },
        ),
    ] = "auto"

    refine_cameras: Annotated[
        str,
        _choice(
            CAMERAS,
            "Poses and focal lengths of the training cameras while a reference clip trains; later clips keep the "
            "result. Held-out cameras do not change.",
            {"off": "as in the capture", "on": "small corrections are learned"},
        ),
    ] = "off"

    quality: Annotated[
        str,
        _choice(
            LENGTH,
            "How long is trained, where the steps below are derived: the learning rates fall towards the last step.",
            {
                "draft": f"{QUALITIES['draft']:g} times the steps, to see whether a capture works",
                "standard": "until most of what is learned at all is learned",
                "best": f"{QUALITIES['best']:g} times the steps, for the last few tenths of a decibel",
            },
        ),
    ] = "standard"
    static_steps: Annotated[
        int,
        _steps(
            f"Steps on the backgrounds before the moving part is added; {STATIC_RULE.text('training camera')}.",
            "Static steps",
        ),
    ] = 0
    joint_steps: Annotated[
        int,
        _steps(
            "Steps of the reference clip after that, in the last three of seven of which still parts no longer learn; "
            f"{JOINT_RULE.text('training picture')}.",
            "Joint steps",
        ),
    ] = 0
    source_steps: Annotated[
        int, _steps(f"Steps of a source clip; {SOURCE_RULE.text('training picture')}.", "Steps of later clips")
    ] = 0
    passes: Annotated[
        float,
        setting(
            LENGTH,
            "Passes over the training pictures of a clip, whatever its kind; 0 keeps the steps derived above.",
            low=0.0,
            high=1000.0,
            unit="passes",
        ),
    ] = 0.0

    feature_lr: Annotated[float, _rate("the anchors' static features")] = 0.015
    scale_lr: Annotated[float, _rate("the anchors' scales")] = 0.014
    table_lr: Annotated[float, _rate("the field's hash tables")] = 0.08
    field_mlp_lr: Annotated[float, _rate("the field's network")] = 0.016
    opacity_head_lr: Annotated[float, _rate("the head of opacities")] = 2e-3
    shape_head_lr: Annotated[float, _rate("the head of scales and rotations")] = 4e-3
    color_head_lr: Annotated[float, _rate("the head of colours")] = 4e-3
    offset_head_lr: Annotated[float, _rate("the head of offsets")] = 4e-3
    position_lr: Annotated[
        float,
        setting(
            RATES,
            "Learning rate of the anchors' positions at the start of a phase, as a share of how far the cameras reach; "
            "with 0 they stay where they are.",
            low=0.0,
            high=1.0,
        ),
    ] = 0.0
    gain_lr: Annotated[float, _rate("the cameras' colour gains in the reference clip")] = 3e-4
    camera_lr: Annotated[float, _rate("corrections of cameras, in pixels at the working size,")] = 0.015
    final_lr_ratio: Annotated[
        float,
        setting(
            RATES,
            "Share of a rate that is left at the end of a phase, for everything without a share of its own; rates fall "
            "log-linearly.",
            low=1e-6,
            high=1.0,
        ),
    ] = 0.1
    feature_final_ratio: Annotated[float, _final("static features")] = 0.0
    scale_final_ratio: Annotated[float, _final("scales")] = 0.0
    position_final_ratio: Annotated[float, _final("positions")] = 0.0
    field_final_ratio: Annotated[float, _final("the field's tables and network")] = 0.0
    opacity_head_final_ratio: Annotated[float, _final("the head of opacities")] = 0.0
    shape_head_final_ratio: Annotated[float, _final("the head of scales and rotations")] = 0.0
    color_head_final_ratio: Annotated[float, _final("the head of colours")] = 0.0
    offset_head_final_ratio: Annotated[float, _final("the head of offsets")] = 0.0

    ssim_weight: Annotated[
        float, setting(LOSS, "w in the loss (1 - w) L1 + w (1 - SSIM) + volume term.", low=0.0, high=1.0)
    ] = 0.2
    volume_weight: Annotated[
        float,
        setting(LOSS, "Weight of the volume term.", low=0.0, high=10.0),
    ] = 1e-3
    volume: Annotated[
        str,
        _choice(
            LOSS,
            "Definition of the volume term.",
            {
                "mean": "the mean over the Gaussians, in cubes of the anchor spacing",
                "sum": "the sum over the Gaussians, in cubes of scene units, as published",
            },
        ),
    ] = "mean"
    max_gradient_norm: Annotated[
        float,
        setting(
            LOSS,
            "Gradients with a larger norm, which only outliers have, are scaled down to it; 0 switches this off.",
            low=0.0,
            high=1e6,
        ),
    ] = 2.0

    gate: Annotated[
        str,
        _choice(
            GATE,
            "Which anchors may change over time, and when they exist.",
            {
                "hull": "static anchors never change; moving ones are decoded only where a frame has its visual hull",
                "static": "static anchors never change; moving ones are decoded in every frame",
                "off": "every anchor is evaluated in every frame, as published",
            },
        ),
    ] = "hull"

    motion: Annotated[
        str,
        _choice(
            GATE,
            "Where anchors of what moves are, frame by frame.",
            {
                "travel": "they travel with what they are on, and are a source clip's own; with gate=hull and "
                "inherit=moving",
                "stay": "they keep their places, and the field carries all motion, as published",
            },
        ),
    ] = "travel"

    tiles: Annotated[
        str,
        _choice(
            STEP,
            "What a step of a source clip draws and compares; the result is the same.",
            {"active": "only tiles that a learning Gaussian touches", "all": "whole pictures"},
        ),
    ] = "active"
    storage: Annotated[
        str,
        _choice(
            STEP,
            "How a finished clip is stored, shown and inherited.",
            {"compact": "rounded to few bits", "exact": "as it was trained, in float32"},
        ),
    ] = "compact"

    decoder: Annotated[
        str,
        _choice(
            SHARING,
            "Heads of the decoder once still parts have learned: at the end of a reference clip, and in source clips.",
            {
                "moving": "those of moving parts keep learning, unless still parts do or clips continue each other",
                "frozen": "all are kept",
                "finetune": "they keep learning in every source clip",
                "new": "they start afresh in every source clip",
            },
        ),
    ] = "moving"
    residual: Annotated[
        str,
        _choice(
            SHARING,
            "Anchors that a source clip adds.",
            {
                "dedup": "where inherited anchors leave space uncovered",
                "none": "none",
                "full": "all points of the clip's cloud that may move, in addition to the inherited ones",
            },
        ),
    ] = "dedup"
    inherit: Annotated[
        str,
        _choice(
            SHARING,
            "Anchors of the reference clip in a source clip.",
            {
                "frozen": "they keep feature and scales",
                "moving": "static ones do; moving ones that the clip uses keep learning, or make room for its own with "
                "motion=travel",
                "trainable": "all are starting values that keep learning",
                "off": "none; the clip builds its own and inherits only the decoder",
            },
        ),
    ] = "moving"
    field: Annotated[
        str,
        _choice(
            SHARING,
            "The field that gives dynamic features.",
            {
                "per_clip": "every clip learns its own from nothing",
                "continue": "one keeps learning from clip to clip, and its last state shows all of them",
                "joint": "one clip, and so one field, for the whole capture",
            },
        ),
    ] = "per_clip"
    schedule: Annotated[
        str,
        _choice(
            SHARING,
            "Learning rates of a source clip.",
            {
                "per_clip": "they begin anew and fall again, as published",
                "inherited": "they stay where those of the reference clip ended",
            },
        ),
    ] = "per_clip"
    independent: Annotated[
        bool, setting(SHARING, "Every clip is trained as a reference clip is, and shares nothing with the others.")
    ] = False
    start: Annotated[
        str,
        _choice(
            SHARING,
            "Initial state of an independent clip.",
            {
                "scratch": "from scratch",
                "previous": "from the previous clip's result, all of which keeps learning",
            },
        ),
    ] = "scratch"

    def __post_init__(self) -> None:
        for name, declared in SETTINGS.items():
            declared.check(getattr(self, name))
        if self.independent and self.field == "continue":
            raise ProjectError(
                "independent clips cannot continue each other's field.", hint="Leave out field=continue."
            )
        changed = self.difference()
        kept = ("frozen", "moving")
        sharing = ("decoder", "residual", "inherit", "schedule")
        shared = [name for name in sharing if changed.get(name, "frozen") not in kept]
        if self.independent and shared:
            listed = ", ".join(f"{name}={getattr(self, name)}" for name in shared)
            raise ProjectError(
                f"independent clips inherit nothing, so {listed} would have no effect.", hint=f"Leave out {listed}."
            )
        if self.inherit == "off" and self.residual == "none":
            raise ProjectError(
                "inherit=off with residual=none leaves a source clip with nothing that moves.",
                hint="Leave out one of them.",
            )
        if self.cloud == "frames" and self.gate != "off":
            raise ProjectError(
                f"cloud=frames does not separate moving from static, so it cannot be combined with gate={self.gate}.",
                hint="Add gate=off, or leave out cloud=frames.",
            )
        if self.start == "previous" and not self.independent:
            raise ProjectError("start=previous needs independent=true.", hint="Add it, or leave out start=previous.")

    def difference(self) -> dict[str, Value]:
        """Only the values that differ from the defaults."""
        return {name: value for name, s in SETTINGS.items() if (value := getattr(self, name)) != s.default}

    def going_on(self) -> TrainConfig:
        """Settings of a clip with start=previous: those of a source clip, and everything inherited learns."""
        learning = {"inherit": "trainable", "decoder": "finetune", "field": "continue"}
        return msgspec.structs.replace(self, independent=False, start="scratch", **learning)

    @property
    def keeps_static(self) -> bool:
        """Whether a source clip shows the reference clip's static anchors exactly as they are there."""
        return self.inherit in ("frozen", "moving") and self.decoder in ("frozen", "moving")

    @property
    def learns_moving_heads(self) -> bool:
        """Whether the heads of moving parts keep learning where still parts no longer do."""
        return self.decoder == "moving" and self.keeps_static and not self.follows_previous

    @property
    def anchors_travel(self) -> bool:
        """Whether anchors of what moves travel. In a source clip all of them are its own then."""
        is_own = self.inherit in ("moving", "off") and self.residual != "none" and not self.follows_previous
        return self.motion == "travel" and self.gate == "hull" and is_own

    @property
    def follows_previous(self) -> bool:
        """Whether a clip continues the one before, which has to be finished then."""
        return self.field == "continue" or self.start == "previous"

    @property
    def needs_backgrounds(self) -> bool:
        """Whether backgrounds are estimated: with cloud=frames nothing but exposures is measured against them."""
        return self.cloud != "frames" or self.color != "off"

    def n_static_steps(self, n_cameras: int, n_windows: int = 1) -> int:
        """Steps of the static phase for this many training cameras, whose pictures have so many windows."""
        return self.static_steps or self._derived(STATIC_RULE.steps(n_cameras), n_windows**0.5)

    def n_joint_steps(self, n_pictures: int, n_windows: int = 1) -> int:
        """Steps of the joint phase of a reference clip with this many training pictures of so many windows."""
        passes = self._n_pass_steps(n_pictures * n_windows)
        return self.joint_steps or passes or self._derived(JOINT_RULE.steps(n_pictures), n_windows**0.5)

    def n_source_steps(self, n_pictures: int, n_windows: int = 1) -> int:
        """Steps of a source clip with this many training pictures of so many windows."""
        passes = self._n_pass_steps(n_pictures * n_windows)
        return self.source_steps or passes or self._derived(SOURCE_RULE.steps(n_pictures), n_windows)

    def _n_pass_steps(self, n_windows: int) -> int:
        return math.ceil(self.passes * n_windows)

    def _derived(self, n_steps: int, growth: float) -> int:
        """Steps of the chosen quality, where pictures of one window need `n_steps` for the standard one.

        Args:
            growth: How many times as many larger pictures need: a reference clip as the root of their windows, since
                neighbouring pixels teach the same anchors; a source clip, whose windows are mostly still, as these.
        """
        return max(round(n_steps * QUALITIES[self.quality] * growth), 1)

    def of_windows(self, n_windows: int) -> TrainConfig:
        """The settings with the limits of anchors that pictures of so many windows have."""
        names, grown = ("max_static_points", "max_moving_points"), n_windows**0.5
        limits = {name: min(round(getattr(self, name) * grown), _MOST_POINTS) for name in names}
        return msgspec.structs.replace(self, **limits)


SETTINGS = settings_of(TrainConfig)
"""Every setting by name, in the order of their declaration."""


def config_of(values: Mapping[str, Any]) -> TrainConfig:
    """The settings with these values, all others at their defaults.

    Raises:
        ProjectError: A setting does not exist, or may not have its value.
    """
    unknown = sorted(values.keys() - SETTINGS.keys())
    if unknown:
        raise ProjectError(f"There is no training setting called {', '.join(unknown)}.", hint="Remove it.")
    return TrainConfig(**values)


def parse_overrides(assignments: Sequence[str]) -> dict[str, Value]:
    """Turn ["key=value", ...] into values of settings, as far as each can be checked by itself.

    Raises:
        ProjectError: An assignment is malformed, a setting does not exist, or it may not have its value.
    """
    values: dict[str, Value] = {}
    for assignment in assignments:
        name, separator, text = (part.strip() for part in assignment.partition("="))
        if not separator:
            raise ProjectError(f"Setting '{assignment}' has no '='.", hint="Write it as key=value.")
        if name not in SETTINGS:
            hint = "Choose it with --backend." if name == "backend" else f"Known settings: {', '.join(SETTINGS)}."
            raise ProjectError(f"Setting '{name}' does not exist.", hint=hint)
        values[name] = SETTINGS[name].parse(text)
    return values
