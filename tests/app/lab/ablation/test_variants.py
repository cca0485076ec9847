"""What variants there are, and how their settings follow from full."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from app.lab.ablation.variants import (
    FULL,
    MIN_STEPS_PER_FRAME,
    VARIANTS,
    Variant,
    chosen_variants,
    own_row,
    rank,
    settings_of,
)
from engine.capture.clip import split_clips
from engine.errors import ProjectError
from engine.training.clip_training import seed_of
from engine.training.config import TrainConfig
from engine.training.phases import phases_of
from engine.training.presets import PUBLISHED_SIZES, preset
from engine.training.variants.variant_method import method_of
from tests.app.lab.ablation.runs import BY_NAME

SIZES = PUBLISHED_SIZES
STAY: dict[str, Any] = {"motion": "stay"}
STAYING = ["anchors of source clips keep their places", "compare with anchors-stay"]
OWN: dict[str, Any] = {"shares_reference": False}
BASELINE: dict[str, Any] = {"is_baseline": True, "shares_reference": False}
ON_REQUEST = BASELINE | {"is_on_request": True}
PINNED: dict[str, tuple[dict[str, Any], dict[str, Any], list[str]]] = {
    "full": ({}, {}, ["settings as they are"]),
    "decoder-new": ({"decoder": "new"}, {}, ["new heads in every source clip"]),
    "decoder-finetune": ({"decoder": "finetune"}, {}, ["inherited heads keep learning"]),
    "anchors-stay": (STAY, {}, ["source clips keep their places", "where inherited ones cover them, these serve"]),
    "residual-none": ({"residual": "none"} | STAY, {}, ["inherited anchors only", *STAYING]),
    "residual-full": ({"residual": "full"} | STAY, {}, ["all points of a clip", "however many", *STAYING]),
    "inherit-frozen": ({"inherit": "frozen"} | STAY, {}, ["all inherited anchors stay as they are", *STAYING]),
    "inherit-trainable": ({"inherit": "trainable"} | STAY, {}, ["inherited anchors keep learning", *STAYING]),
    "inherit-off": (
        {"inherit": "off"},
        {},
        ["its own anchors", "without a static phase", "reference clip's backgrounds"],
    ),
    "inherit-trainable-residual-full": (
        {"inherit": "trainable", "residual": "full"} | STAY,
        {},
        ["all points of a clip, however many", "inherited anchors keep learning", *STAYING],
    ),
    "field-continue": ({"field": "continue"} | STAY, {}, ["one field continues from clip to clip", *STAYING]),
    "schedule-inherited": (
        {"schedule": "inherited"},
        {},
        ["no new schedule", "all that they learn", "the rates that the reference clip ended with"],
    ),
    "clips-shorter": ({}, OWN | {"cut": "shorter"}, ["half the length", "as many steps a frame"]),
    "clips-longer": ({}, OWN | {"cut": "longer"}, ["twice the length", "as many steps a frame"]),
    "reference-middle": ({}, OWN | {"is_reference_moved": True}, ["in the middle is the reference"]),
    "gate-off": (
        {"gate": "off", "field_max_levels": 16},
        OWN,
        [
            *("every anchor at every time", "levels and entries", "all clips keep their places", "still ones cover"),
            *("no light layer", "marked regions do not count", "learn until its end"),
        ],
    ),
    "independent": (
        {"independent": True, "backgrounds": "clip"},
        {"is_baseline": True},
        ["share nothing", "clouds of its own frames", "its own seed", "as many steps", "the first is that of full"],
    ),
    "independent-shorter": (
        {"independent": True, "backgrounds": "clip"},
        ON_REQUEST | {"cut": "shorter", "reference_of": "clips-shorter"},
        ["independent clips of half the length", "as many steps a frame", "the first is that of clips-shorter"],
    ),
    "independent-longer": (
        {"independent": True, "backgrounds": "clip"},
        ON_REQUEST | {"cut": "longer", "reference_of": "clips-longer"},
        ["independent clips of twice the length", "as many steps a frame", "the first is that of clips-longer"],
    ),
    "field-joint": ({}, BASELINE | {"cut": "whole"}, ["one clip, and so one field, for all frames", "all steps"]),
    "frame-stream": (
        {"independent": True, "start": "previous"},
        BASELINE | {"cut": "frames"},
        ["frame after frame", "from the one before", "everything learns on", "all steps"],
    ),
    "first-frame": (
        {"backgrounds": "clip"},
        BASELINE | {"cut": "first"},
        ["first frame alone", "measured on it", "steps of a whole clip"],
    ),
    "published": (SIZES | {"gate": "off", "tiles": "all"}, ON_REQUEST, ["published sizes", "every time", "all tiles"]),
    "published-static": (
        SIZES | {"gate": "static", "tiles": "all"},
        ON_REQUEST,
        ["published sizes", "static anchors decoded once", "all tiles"],
    ),
    "published-gate": (
        SIZES | {"tiles": "all"},
        ON_REQUEST,
        ["published sizes", "only where they can be", "all tiles"],
    ),
    "published-tiles": (
        SIZES,
        ON_REQUEST | {"reference_of": "published-gate"},
        ["published sizes", "gate", "only active tiles"],
    ),
}
"""What each variant changes of "full": settings, how it is trained, and what its words have to say of that."""


def test_a_variant_is_what_is_pinned_and_its_words_say_all_of_it():
    assert [variant.name for variant in VARIANTS] == list(PINNED)
    usual = Variant("", "")
    for variant in VARIANTS:
        overrides, others, said = PINNED[variant.name]
        assert variant == replace(usual, name=variant.name, words=variant.words, overrides=overrides, **others)
        assert TrainConfig(**overrides).difference() == overrides  # none repeats a default
        assert [part for part in said if part not in variant.words] == [], variant.name


BASES = ({}, {"gate": "off", "cloud": "frames"}, preset("paper"))


@pytest.mark.parametrize("base", BASES, ids=["default", "gate=off", "paper"])
def test_beside_what_is_pinned_only_lengths_follow_from_how_a_variant_is_cut(base):
    clips = split_clips(12, 4)
    full, *_ = settings_of(BY_NAME[FULL], base, clips=clips, n_cameras=10, n_capture_frames=12)
    assert full == base
    for variant in VARIANTS:
        settings, *_ = settings_of(variant, base, clips=clips, n_cameras=10, n_capture_frames=12)
        steps = {
            "clips": set(),
            "shorter": {"joint_steps", "source_steps"},
            "longer": {"joint_steps", "source_steps"},
            "frames": {"joint_steps", "source_steps"},
            "whole": {"joint_steps"},
            "first": {"joint_steps"},
        }[variant.cut]
        steps = {"static_steps", "joint_steps"} if variant.name.startswith("independent") else steps
        changed = {name for name, value in settings.items() if base.get(name) != value}
        assert changed - steps == {name for name, value in variant.overrides.items() if base.get(name) != value}
        assert base | variant.overrides == {name: settings[name] for name in settings.keys() - (steps - base.keys())}


def test_only_variants_whose_reference_clip_is_trained_alike_share_it():
    for variant in VARIANTS:
        is_source_only = variant.cut == "clips" and not variant.is_reference_moved and variant.overrides.keys() <= {
            "decoder", "residual", "inherit", "field", "motion", "schedule"}  # fmt: skip
        # the first of independent clips is that of full by its words; the settings are those of the others
        assert variant.shares_reference == (is_source_only or variant.name == "independent"), variant.name


@pytest.mark.parametrize("base", [*BASES, {"passes": 1.0}, {"passes": 8.0}, {"source_steps": 7}])
def test_independent_clips_are_trained_as_long_as_those_of_full(base):
    clips, n_cameras = split_clips(30, 10), 18
    settings, *_ = settings_of(BY_NAME["independent"], base, clips=clips, n_cameras=n_cameras, n_capture_frames=30)
    config = TrainConfig(**settings)
    for clip in clips[1:]:
        sizes = {"n_cameras": n_cameras, "n_frames": clip.n_frames, "n_windows": 1}
        in_full = phases_of(TrainConfig(**base), **sizes, is_source=True)
        alone = phases_of(config, **sizes, is_source=False)
        assert sum(n for _, n in alone) == sum(n for _, n in in_full)
        assert all(n > 0 for _, n in alone)
    for cut in ("shorter", "longer"):
        own, of_full = (
            settings_of(BY_NAME[name], base, clips=clips, n_cameras=n_cameras, n_capture_frames=30)
            for name in (f"independent-{cut}", f"clips-{cut}")
        )
        assert own[1:] == of_full[1:], "the same clips"
        sizes = {"n_cameras": n_cameras, "n_frames": own[1], "n_windows": 1}
        alone = phases_of(TrainConfig(**own[0]), **sizes, is_source=False)
        assert sum(n for _, n in alone) == of_full[0]["source_steps"]
    seeds = [seed_of(config, clip, seed) for seed in range(3) for clip in clips]
    assert len(set(seeds)) == len(seeds)
    assert {seed_of(TrainConfig(**base), clip, 5) for clip in clips} == {5}


def test_variants_are_chosen_by_name_in_the_order_of_the_table_with_full_beside_them():
    assert [v.name for v in chosen_variants(["independent", "decoder-new"])] == [FULL, "decoder-new", "independent"]
    usual = [variant for variant in VARIANTS if not variant.is_on_request]
    assert chosen_variants(None) == usual
    assert {"published", "full"} - {variant.name for variant in usual} == {"published"}
    assert [v.name for v in chosen_variants(["published"])] == [FULL, "published"]
    assert [v.name for v in chosen_variants([FULL])] == [FULL]
    assert [v.name for v in chosen_variants(["independent-longer"])] == [FULL, "clips-longer", "independent-longer"]
    with pytest.raises(ProjectError, match="called nonsense") as caught:
        chosen_variants(["full", "nonsense"])
    assert "decoder-new" in caught.value.hint


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.name)
def test_a_variant_changes_what_it_names_and_trains_as_long_as_full(variant):
    clips = split_clips(10, 4)  # the last one has two frames
    overrides, clip_length, chosen = settings_of(variant, {}, clips=clips, n_cameras=100, n_capture_frames=10)
    config, full = TrainConfig(**overrides), TrainConfig()
    joint, source = full.n_joint_steps(400), [full.n_source_steps(400), full.n_source_steps(200)]
    n_steps = joint + sum(source)
    assert overrides | variant.overrides == overrides
    changed = overrides.keys() - variant.overrides.keys()
    n_frames_covered = sum(clip.n_frames for clip in split_clips(10, clip_length)[chosen.start : chosen.stop])
    match variant.cut:
        case "clips":
            steps = {"static_steps", "joint_steps"} if variant.name == "independent" else set()
            assert (changed, clip_length, chosen) == (steps, 4, range(3))
        case "whole":
            assert (changed, clip_length, chosen) == ({"joint_steps"}, 10, range(1))
            assert config.n_joint_steps(1000) == n_steps
        case "frames":
            assert (changed, clip_length, chosen) == ({"joint_steps", "source_steps"}, 1, range(10))
            assert config.n_joint_steps(100) == joint
            assert n_steps - 9 < config.n_joint_steps(100) + 9 * config.n_source_steps(100) <= n_steps
        case "shorter" | "longer" if variant.overrides:
            length = {"shorter": 2, "longer": 8}[variant.cut]
            assert (changed, clip_length) == ({"static_steps", "joint_steps"}, length)
            assert config.static_steps + config.joint_steps == source[0] * length / 4
        case "shorter" | "longer":
            length = {"shorter": 2, "longer": 8}[variant.cut]
            assert (changed, clip_length, chosen) == ({"joint_steps", "source_steps"}, length, range(-(-10 // length)))
            assert config.joint_steps == joint * length / 4
            assert config.source_steps == source[0] * length / 4
        case "first":
            assert (changed, clip_length, chosen) == ({"joint_steps"}, 1, range(1))
            assert config.n_joint_steps(100) == joint
    assert n_frames_covered == (1 if variant.cut == "first" else 10)


def test_every_anchor_at_every_time_leaves_out_all_that_its_words_say():
    config, full = (TrainConfig(**BY_NAME[name].overrides) for name in ("gate-off", FULL))
    method = method_of(config, previous=None)
    assert full.anchors_travel
    assert not config.anchors_travel
    assert {method.has_light, method.obeys_regions} == {False}
    sizes = {"n_cameras": 10, "n_frames": 4, "n_windows": 1, "is_source": False}
    assert [name for name, _ in phases_of(config, **sizes)] == ["static", "joint"]
    assert sum(n for _, n in phases_of(config, **sizes)) == sum(n for _, n in phases_of(full, **sizes))


def test_settings_of_full_stay_in_every_variant_and_a_frame_has_its_least_steps():
    clips = split_clips(8, 4)
    for variant in VARIANTS:
        assert settings_of(variant, {"passes": 2.0}, clips=clips, n_cameras=3, n_capture_frames=8)[0]["passes"] == 2.0
    overrides, _, _ = settings_of(
        BY_NAME["frame-stream"], {"passes": 2.0}, clips=clips, n_cameras=3, n_capture_frames=8
    )
    assert overrides["joint_steps"] == 24  # two passes over three cameras and four frames, for the first frame alone
    assert overrides["source_steps"] == MIN_STEPS_PER_FRAME
    alone, _, _ = settings_of(BY_NAME["frame-stream"], {}, clips=split_clips(1, 1), n_cameras=3, n_capture_frames=1)
    assert alone["source_steps"] >= MIN_STEPS_PER_FRAME


@pytest.mark.parametrize(("n_frames", "length", "n_capture_frames", "shorter", "longer"), [
    (40, 10, 150, 5, 20), (30, 10, 150, 5, 30), (30, 10, 30, 5, 20), (28, 7, 150, 2, 14), (3, 1, 3, 1, 2),
])  # fmt: skip
def test_other_clip_lengths_cover_the_same_frames(n_frames, length, n_capture_frames, shorter, longer):
    clips = split_clips(n_frames, length)
    for cut, expected in (("shorter", shorter), ("longer", longer)):
        variant = BY_NAME[f"clips-{cut}"]
        _, got, chosen = settings_of(variant, {}, clips=clips, n_cameras=3, n_capture_frames=n_capture_frames)
        assert got == expected
        assert split_clips(n_capture_frames, got)[chosen[-1]].stop == n_frames


def test_the_reference_in_the_middle_is_trained_first(runner):
    runner.run(["reference-middle"])
    assert [clip for name, clip in runner.launched if name == "reference-middle-seed0"] == [1, 0]


def test_a_row_of_own_settings_is_a_variant():
    row = own_row("fast-field: table_lr=0.1 source_steps=700")
    assert (row.name, row.words) == ("fast-field", "table_lr=0.1 source_steps=700")
    assert row.overrides == {"table_lr": 0.1, "source_steps": 700}
    assert not row.shares_reference, "the reference clip learns at that rate, too"
    assert own_row("short: source_steps=700").shares_reference
    assert rank("fast-field") > max(rank(variant.name) for variant in VARIANTS)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("no colon", "--row is"),
        ("name:", "--row is"),
        (": passes=1", "--row is"),
        ("a/b: passes=1", "--row is"),
        ("full: passes=1", "called 'full' already"),
        ("full-steps7: passes=1", "already"),
        ("x: passes", "has no '='"),
        ("x: nonsense=1", "does not exist"),
        ("x: passes=-1", "passes"),
    ],
)
def test_bad_rows_are_refused(text: str, said: str):
    with pytest.raises(ProjectError, match=said):
        own_row(text)
