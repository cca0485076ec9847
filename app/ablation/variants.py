"""The variants of an ablation: named differences from the settings as they are. Data; each changes only what it names.

Ablations switch one part of the method off or replace it. Baselines are other ways to model a long capture, made of
the same loaders, anchors, rasterizer and metrics; they are named for what they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from engine.errors import ProjectError


@dataclass(frozen=True, slots=True)
class Variant:
    """One way to train the chosen clips.

    Attributes:
        name: Of the command line, the folder and the table.
        words: What it is.
        overrides: Training settings that it changes.
        is_baseline: Another way, not the method without a part.
        cut: How the chosen frames are cut: "clips" as the others are, "frames" into clips of one frame, "whole" into a
            single clip with all steps, "first" only the first frame.
        shares_reference: Whether its reference clip is that of "full": only source clips differ.
    """

    name: str
    words: str
    overrides: dict[str, Any] = field(default_factory=dict)
    is_baseline: bool = False
    cut: str = "clips"
    shares_reference: bool = True


FULL = "full"
VARIANTS = (
    Variant(FULL, "the settings as they are"),
    Variant("decoder-new", "without decoder inheritance: new heads in every source clip", {"decoder": "new"}),
    Variant("decoder-finetune", "inherited heads go on learning in every source clip", {"decoder": "finetune"}),
    Variant("residual-none", "without residual anchors: inherited anchors only", {"residual": "none"}),
    Variant("residual-full", "residual anchors without deduplication", {"residual": "full"}),
    Variant("inherit-trainable", "inherited anchors go on learning in every source clip", {"inherit": "trainable"}),
    Variant("inherit-off", "without anchor inheritance: every source clip builds its own", {"inherit": "off"}),
    Variant(
        "inherit-trainable-residual-full",
        "without both: no deduplication, and inherited anchors go on learning",
        {"inherit": "trainable", "residual": "full"},
    ),
    Variant(
        "field-continue",
        "one field goes on from clip to clip, its last state shows all",
        {"field": "continue"},
        shares_reference=True,
    ),
    Variant("gate-off", "every anchor at every time, as published", {"gate": "off"}, shares_reference=False),
    Variant("independent", "clips share nothing", {"independent": True}, is_baseline=True, shares_reference=False),
    Variant(
        "field-joint",
        "one clip, and so one field, for all frames",
        is_baseline=True,
        cut="whole",
        shares_reference=False,
    ),
    Variant(
        "frame-stream",
        "frame after frame: each starts from the one before, and everything learns on",
        {"independent": True, "start": "previous"},
        is_baseline=True,
        cut="frames",
        shares_reference=False,
    ),
    Variant(
        "first-frame",
        "static Gaussians of the first frame, measured on that frame alone",
        is_baseline=True,
        cut="first",
        shares_reference=False,
    ),
)
"""Everything that `clipgstream ablate` can train, in the order of its table."""


def chosen_variants(names: Sequence[str] | None) -> list[Variant]:
    """Variants by name, in the order of the table; all of them for None. "full" is always there.

    Raises:
        ProjectError: There is no such variant.
    """
    known = {variant.name for variant in VARIANTS}
    unknown = [name for name in names or () if name not in known]
    if unknown:
        raise ProjectError(
            f"There is no variant called {', '.join(unknown)}.", hint=f"Variants are {', '.join(sorted(known))}."
        )
    return [variant for variant in VARIANTS if names is None or variant.name in {*names, FULL}]


def settings_of(
    variant: Variant, base: dict[str, Any], *, clip_length: int, clips: range, n_pictures_per_frame: int
) -> tuple[dict[str, Any], int, range]:
    """Training settings, clip length and clips to train of a variant.

    Args:
        base: Settings of "full" that differ from the defaults.
        clip_length, clips: Of "full".
        n_pictures_per_frame: Training cameras; a single long clip gets as many steps as all its parts together.
    """
    overrides = base | variant.overrides
    if variant.cut == "clips":
        return overrides, clip_length, clips
    from engine.training.config import TrainConfig

    config = TrainConfig(**base)
    per_clip = n_pictures_per_frame * clip_length
    n_steps = config.n_joint_steps(per_clip) + (len(clips) - 1) * config.n_source_steps(per_clip)
    first, stop = clips.start * clip_length, clips.stop * clip_length
    if variant.cut == "whole":
        return overrides | {"joint_steps": n_steps}, stop - first, range(1)
    n_frames = stop - first
    if variant.cut == "first":
        return overrides, 1, range(first, first + 1)
    # streaming: the first frame as thoroughly as a clip, the rest of the steps for the others
    rest = max((n_steps - config.n_joint_steps(per_clip)) // max(n_frames - 1, 1), 20)
    return overrides | {"source_steps": rest}, 1, range(first, stop)
