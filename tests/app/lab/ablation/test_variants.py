"""What variants there are, and how their settings follow from full."""

from __future__ import annotations

import pytest

from app.lab.ablation.variants import FULL, MIN_STEPS_PER_FRAME, VARIANTS, chosen_variants, settings_of
from engine.capture.clip import split_clips
from engine.errors import ProjectError
from engine.training.config import TrainConfig
from tests.app.lab.ablation.runs import BY_NAME


def test_variants_are_named_once_and_their_settings_are_valid():
    assert len(BY_NAME) == len(VARIANTS)
    assert VARIANTS[0].name == FULL
    assert not VARIANTS[0].overrides
    for variant in VARIANTS:
        assert TrainConfig(**variant.overrides).difference() == variant.overrides  # none repeats a default
        assert variant.words
    listed = {"decoder": "new", "residual": "none", "inherit": "off", "field": "continue", "independent": True}
    for name, value in listed.items():
        assert any(variant.overrides.get(name) == value for variant in VARIANTS)


def test_only_variants_whose_reference_clip_is_trained_alike_share_it():
    for variant in VARIANTS:
        is_source_only = variant.cut == "clips" and not variant.is_reference_moved and variant.overrides.keys() <= {
            "decoder", "residual", "inherit", "field"}  # fmt: skip
        assert variant.shares_reference == is_source_only, variant.name


def test_variants_are_chosen_by_name_in_the_order_of_the_table_with_full_beside_them():
    assert [v.name for v in chosen_variants(["independent", "decoder-new"])] == [FULL, "decoder-new", "independent"]
    usual = [variant for variant in VARIANTS if not variant.is_on_request]
    assert chosen_variants(None) == usual
    assert {"published", "full"} - {variant.name for variant in usual} == {"published"}
    assert [v.name for v in chosen_variants(["published"])] == [FULL, "published"]
    assert [v.name for v in chosen_variants([FULL])] == [FULL]
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
            assert (changed, clip_length, chosen) == (set(), 4, range(3))
        case "whole":
            assert (changed, clip_length, chosen) == ({"joint_steps"}, 10, range(1))
            assert config.n_joint_steps(1000) == n_steps
        case "frames":
            assert (changed, clip_length, chosen) == ({"joint_steps", "source_steps"}, 1, range(10))
            assert config.n_joint_steps(100) == joint
            assert n_steps - 9 < config.n_joint_steps(100) + 9 * config.n_source_steps(100) <= n_steps
        case "shorter" | "longer":
            length = {"shorter": 2, "longer": 8}[variant.cut]
            assert (changed, clip_length, chosen) == ({"joint_steps", "source_steps"}, length, range(-(-10 // length)))
            assert config.joint_steps == joint * length / 4
            assert config.source_steps == source[0] * length / 4
        case "first":
            assert (changed, clip_length, chosen) == ({"joint_steps"}, 1, range(1))
            assert config.n_joint_steps(100) == joint
    assert n_frames_covered == (1 if variant.cut == "first" else 10)


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
