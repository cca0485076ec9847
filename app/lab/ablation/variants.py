"""The variants of an ablation: named differences from the settings as they are. Data; each changes only what it names.

Ablations switch one part of the method off or replace it. Baselines are other ways to model a long capture, made of
the same loaders, anchors, rasterizer and metrics; they are named for what they are.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from engine.capture.clip import Clip
from engine.errors import ProjectError
from engine.training.config import TrainConfig, config_of, parse_overrides
from engine.training.presets import PUBLISHED_SIZES


@dataclass(frozen=True, slots=True)
class Variant:
    """One way to train the chosen clips.

    Attributes:
        name: Of the command line, the folder and the table.
        words: Its description.
        overrides: Training settings that it changes.
        is_baseline: Another way, not the method without a part.
        cut: How the chosen frames are cut: "clips" as the others are, "shorter" or "longer" into clips of about half or
            twice that length, "frames" into clips of one frame, "whole" into a single clip with all steps, "first" only
            the first frame.
        shares_reference: Whether its reference clip is that of "full": only source clips differ.
        is_reference_moved: Whether the clip in the middle is the one that others inherit from.
        reference_of: Another variant whose reference clip it shares, when that is not "full".
        is_on_request: Only trained when it is named.
        base_name: The variant that this one is with source clips of another length; see `with_source_steps`.
    """

    name: str
    words: str
    overrides: dict[str, Any] = field(default_factory=dict)
    is_baseline: bool = False
    cut: str = "clips"
    shares_reference: bool = True
    is_reference_moved: bool = False
    reference_of: str = ""
    is_on_request: bool = False
    base_name: str = ""

    @property
    def family(self) -> str:
        """Variants of one family have the same reference clip."""
        return FULL if self.shares_reference else self.reference_of or self.base_name or self.name


FULL = "full"
MIN_STEPS_PER_FRAME = 20
"""Least number for a stream, also where the clips of "full" have fewer."""
_STAY = "anchors of source clips keep their places, so compare with anchors-stay"
VARIANTS = (
    Variant(FULL, "the settings as they are"),
    Variant("decoder-new", "without decoder inheritance (DI): new heads in every source clip", {"decoder": "new"}),
    Variant("decoder-finetune", "inherited heads keep learning in every source clip", {"decoder": "finetune"}),
    Variant(
        "anchors-stay",
        "moving anchors of source clips keep their places, as published: where inherited ones cover them, these serve",
        {"motion": "stay"},
    ),
    Variant(
        "residual-none",
        f"without residual anchors: inherited anchors only; {_STAY}",
        {"residual": "none", "motion": "stay"},
    ),
    Variant(
        "residual-full",
        "without residual anchor compensation (RAC): all points of a clip next to the inherited anchors, however many; "
        f"{_STAY}",
        {"residual": "full", "motion": "stay"},
    ),
    Variant(
        "inherit-frozen",
        f"all inherited anchors stay as they are, as published; {_STAY}",
        {"inherit": "frozen", "motion": "stay"},
    ),
    Variant(
        "inherit-trainable",
        f"without anchor inheritance (AI): inherited anchors keep learning in every source clip; {_STAY}",
        {"inherit": "trainable", "motion": "stay"},
    ),
    Variant(
        "inherit-off",
        "stricter than without AI: every source clip builds its own anchors and inherits the heads alone; without a "
        "static phase, and its static cloud from the reference clip's backgrounds",
        {"inherit": "off"},
    ),
    Variant(
        "inherit-trainable-residual-full",
        f"without RAC and AI: all points of a clip, however many, and inherited anchors keep learning; {_STAY}",
        {"inherit": "trainable", "residual": "full", "motion": "stay"},
    ),
    Variant(
        "field-continue",
        f"one field continues from clip to clip, its last state shows all; {_STAY}",
        {"field": "continue", "motion": "stay"},
        shares_reference=True,
    ),
    Variant(
        "schedule-inherited",
        "source clips begin no new schedule: all that they learn stays at the rates that the reference clip ended with",
        {"schedule": "inherited"},
    ),
    Variant(
        "clips-shorter", "clips of half the length, with as many steps a frame", cut="shorter", shares_reference=False
    ),
    Variant(
        "clips-longer", "clips of twice the length, with as many steps a frame", cut="longer", shares_reference=False
    ),
    Variant(
        "reference-middle",
        "the clip in the middle is the reference",
        shares_reference=False,
        is_reference_moved=True,
    ),
    Variant(
        "gate-off",
        "every anchor at every time, as published; the field has the levels and entries for all of them. So anchors of "
        "all clips keep their places, still ones cover points of later clips too, there is no light layer, marked "
        "regions do not count, and still parts of the reference clip learn until its end",
        {"gate": "off", "field_max_levels": 16},
        shares_reference=False,
    ),
    Variant(
        "independent",
        "clips share nothing: each has clouds of its own frames, its own seed, and as many steps as a clip of full "
        "that inherits; the first is that of full",
        {"independent": True, "backgrounds": "clip"},
        is_baseline=True,
    ),
    *(
        Variant(
            f"independent-{cut}",
            f"independent clips of {length} the length, with as many steps a frame; the first is that of clips-{cut}",
            {"independent": True, "backgrounds": "clip"},
            is_baseline=True,
            cut=cut,
            shares_reference=False,
            reference_of=f"clips-{cut}",
            is_on_request=True,
        )
        for cut, length in (("shorter", "half"), ("longer", "twice"))
    ),
    Variant(
        "field-joint",
        "one clip, and so one field, for all frames, with all steps",
        is_baseline=True,
        cut="whole",
        shares_reference=False,
    ),
    Variant(
        "frame-stream",
        "frame after frame: each starts from the one before, and everything learns on; all steps over all frames",
        {"independent": True, "start": "previous"},
        is_baseline=True,
        cut="frames",
        shares_reference=False,
    ),
    Variant(
        "first-frame",
        "static Gaussians of the first frame alone, measured on it, with the steps of a whole clip",
        {"backgrounds": "clip"},
        is_baseline=True,
        cut="first",
        shares_reference=False,
    ),
    # from the published scheme to "full", one part after the other; only time changes where the tiles do. Rates and
    # lengths are those of "full": costs are compared at equal rates
    *(
        Variant(
            name,
            f"published sizes, {words}",
            PUBLISHED_SIZES | changed,
            is_baseline=True,
            shares_reference=False,
            reference_of=reference_of,
            is_on_request=True,
        )
        for name, words, changed, reference_of in (
            ("published", "every anchor at every time, all tiles", {"gate": "off", "tiles": "all"}, ""),
            ("published-static", "static anchors decoded once, all tiles", {"gate": "static", "tiles": "all"}, ""),
            ("published-gate", "moving anchors only where they can be, all tiles", {"tiles": "all"}, ""),
            ("published-tiles", "gate, and only active tiles", {}, "published-gate"),
        )
    ),
)
"""Everything that `clipgstream ablate` can train, in the order of its table."""


_STEPS_NAME = re.compile(r"(.+)-steps([1-9][0-9]*)")


def with_source_steps(variant: Variant, n_steps: int) -> Variant:
    """The same with source clips of so many steps: a point of the curve of its quality over time.

    Raises:
        ProjectError: It has no source clips of the usual length.
    """
    if variant.cut != "clips" or variant.overrides.get("independent"):
        raise ProjectError(
            f"{variant.name} has no source clips, so their number of steps would change nothing.",
            hint="Leave it out, or leave out --source-steps.",
        )
    return replace(
        variant,
        name=f"{variant.name}-steps{n_steps}",
        words=f"{variant.words}; {n_steps} steps in a source clip",
        overrides=variant.overrides | {"source_steps": n_steps},
        base_name=variant.name,
    )


def variant_called(name: str) -> Variant | None:
    """The variant of a name, also of one that `with_source_steps` gave; None when there is none."""
    known = {variant.name: variant for variant in VARIANTS}
    steps = _STEPS_NAME.fullmatch(name)
    if name in known or steps is None:
        return known.get(name)
    base = known.get(steps[1])
    try:
        return None if base is None else with_source_steps(base, int(steps[2]))
    except ProjectError:
        return None


def own_row(text: str) -> Variant:
    """A row of settings that are tried, as `NAME: KEY=VALUE KEY=VALUE`.

    Raises:
        ProjectError: It has no name or no settings, takes the name of another variant, or a setting does not exist.
    """
    name, colon, settings = (part.strip() for part in text.partition(":"))
    if not colon or not re.fullmatch(r"[A-Za-z0-9._]+(-[A-Za-z0-9._]+)*", name) or not settings:
        raise ProjectError(f"--row is '{text}'.", hint="Write it as NAME: KEY=VALUE KEY=VALUE.")
    if variant_called(name) is not None:
        raise ProjectError(f"A variant is called '{name}' already.", hint="Choose another name for the row.")
    overrides = parse_overrides(settings.split())
    config_of(overrides)  # raises where one may not have its value
    is_of_source = overrides.keys() <= _OF_SOURCE_CLIPS
    return Variant(name, settings, overrides, shares_reference=is_of_source, is_on_request=True)


_OF_SOURCE_CLIPS = {"decoder", "residual", "inherit", "field", "schedule", "source_steps", "tiles"}
"""Settings that leave the reference clip as it is."""


def rank(name: str) -> tuple[int, int]:
    """Place of a variant in the table; rows of own settings come last."""
    steps, names = _STEPS_NAME.fullmatch(name), [variant.name for variant in VARIANTS]
    base = name if steps is None or name in names else steps[1]
    return names.index(base) if base in names else len(names), 0 if steps is None else int(steps[2])


def chosen_variants(names: Sequence[str] | None) -> list[Variant]:
    """Variants by name, in the order of the table; all but those on request for None. "full" is always there, and so is
    a variant whose reference clip another one shares.

    Raises:
        ProjectError: There is no such variant.
    """
    known = {variant.name for variant in VARIANTS}
    unknown = [name for name in names or () if name not in known]
    if unknown:
        raise ProjectError(
            f"There is no variant called {', '.join(unknown)}.", hint=f"Variants are {', '.join(sorted(known))}."
        )
    if names is None:
        return [variant for variant in VARIANTS if not variant.is_on_request]
    needed = {*names, FULL, *(variant.reference_of for variant in VARIANTS if variant.name in names)}
    return [variant for variant in VARIANTS if variant.name in needed]


def settings_of(
    variant: Variant, base: dict[str, Any], *, clips: Sequence[Clip], n_cameras: int, n_capture_frames: int
) -> tuple[dict[str, Any], int, range]:
    """Training settings, clip length and clips to train of a variant.

    Args:
        base: Settings of "full" that differ from the defaults.
        clips: Those of "full", from the first on; the last one may be shorter.
        n_cameras: Training cameras. A single long clip, and all frames of a stream together, get as many steps as all
            clips of "full" together, and clips of another length as many per frame.
        n_capture_frames: Where the chosen frames end before the capture does, they are cut without a remainder, because
            the last clip would continue beyond them.
    """
    overrides = base | variant.overrides
    config = TrainConfig(**base)
    is_alone = variant.overrides.get("independent", False)
    if variant.cut == "clips":
        if is_alone:
            overrides |= _alone(config, config.n_source_steps(n_cameras * clips[0].n_frames), n_cameras)
        return overrides, clips[0].clip_length, range(len(clips))
    n_frames = clips[-1].stop
    n_first, *n_others = (n_cameras * clip.n_frames for clip in clips)
    joint_steps = config.n_joint_steps(n_first)
    rest = sum(config.n_source_steps(n) for n in n_others)
    if variant.cut in {"shorter", "longer"}:
        clip_length = clips[0].clip_length
        length = _other_length(
            clip_length, n_frames, is_shorter=variant.cut == "shorter", is_end=n_frames == n_capture_frames
        )
        source_steps = config.n_source_steps(n_first)
        steps = {"joint_steps": joint_steps, "source_steps": source_steps}
        steps = {name: max(round(n * length / clip_length), 1) for name, n in steps.items()}
        overrides |= _alone(config, steps["source_steps"], n_cameras) if is_alone else steps
        return overrides, length, range(-(-n_frames // length))
    if variant.cut == "whole":
        return overrides | {"joint_steps": joint_steps + rest}, n_frames, range(1)
    overrides |= {"joint_steps": joint_steps}  # the first frame as thoroughly as a clip
    if variant.cut == "first":
        return overrides, 1, range(1)
    return overrides | {"source_steps": max(rest // max(n_frames - 1, 1), MIN_STEPS_PER_FRAME)}, 1, range(n_frames)


def _alone(config: TrainConfig, n_steps: int, n_cameras: int) -> dict[str, int]:
    """Steps of the phases of an independent clip that has as many as one that inherits."""
    n_static = 0 if config.cloud == "frames" else config.n_static_steps(n_cameras)
    n_static = min(n_static, n_steps // 2)  # of a short schedule, so that both phases have some
    return {"static_steps": n_static, "joint_steps": n_steps - n_static}


def _other_length(clip_length: int, n_frames: int, *, is_shorter: bool, is_end: bool) -> int:
    """Half or twice a clip length, or the nearest one beyond that which cuts the frames without a remainder."""
    lengths = [length for length in range(1, n_frames + 1) if is_end or n_frames % length == 0]
    if is_shorter:
        return max((length for length in lengths if length <= clip_length / 2), default=1)
    return min((length for length in lengths if length >= 2 * clip_length), default=n_frames)
