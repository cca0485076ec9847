"""Plans: sizes with their reasons for every kind of clip, and forecasts from the cost model, clips and the machine."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys

import pytest

from engine.assets import asset_path
from engine.capture.capture import open_capture
from engine.capture.clip import Clip
from engine.clip_files.clip_header import ClipHeader
from engine.errors import PreparationError
from engine.training.config import TrainConfig
from engine.training.plan.expected_sizes import Counts, Footage, counts_of, footage_of
from engine.training.plan.forecasting import MachineSpeed, MeasuredClip, measured_clip
from engine.training.plan.plan import make_plan
from engine.training.presets import preset
from tests.clip_headers import make_header

SAMPLE = Footage(width=320, height=240, n_cameras=18, n_held_out=2, n_frames=30)
BASKETBALL = Footage(width=640, height=360, n_cameras=27, n_held_out=4, n_frames=40)
CLIP = Clip(clip_index=0, start=0, n_frames=10, clip_length=10)
NEXT = Clip(clip_index=1, start=10, n_frames=10, clip_length=10)


FIELD = {
    "n_knots": 10,
    "cells": [8, 13, 20, 33, 52, 84, 134],
    "n_entries": 65536,
    "channels": 4,
    "hidden": 64,
    "feature_dim": 16,
    "bounds_min": [0.0, 0.0, 0.0],
    "side": 1.0,
    "is_shared": True,
}


def header(**changes) -> ClipHeader:
    """Of a trained reference clip of the basketball."""
    found = {
        "n_frames": 10,
        "step": 6210,
        "n_anchors": {"static": 20621, "moving": 26923},
        "n_alive": 7235,
        "moving_spacing": 0.02855,
        "field": FIELD,
        "reference_fingerprint": "clip",
        "metrics": {"preparation_s": 24.3, "training_s": 175.2, "memory_mb": 1400.0},
    }
    return make_header(**found | changes)


def measured(**changes) -> MeasuredClip:
    """The same clip as history."""
    return measured_clip(header(**changes), disk_mb=2.36, uncounted_s=2.5)


def plan(footage=BASKETBALL, clip=CLIP, *, is_source=False, config=None, **arguments):
    """A plan with the default settings unless said otherwise."""
    return make_plan(footage, clip, config or TrainConfig(), is_source=is_source, **arguments)


def texts(found) -> dict[str, tuple[object, str]]:
    """Lines by name."""
    return {line.name: (line.value, line.reason) for line in found.lines}


# ---------------------------------------------------------------- lines and reasons


def test_a_reference_clip():
    found = plan()
    assert (found.role, found.n_steps) == ("reference", 6210)
    lines = texts(found)
    assert lines["pictures"] == (270, "27 cameras (4 held out) x 10 frames, 640x360")
    assert lines["background frames"] == (40, "of every camera, all there are")
    assert lines["static steps"] == (810, "30 for each of 27 backgrounds")
    assert lines["joint steps"] == (5400, "20 for each of 270 pictures")
    assert lines["voxel"][0] == "derived"
    assert "22,000" in lines["static anchors"][1]
    assert "tiles" not in lines
    assert "early stop" not in lines


def test_a_source_clip_counts_what_the_reference_has():
    found = plan(clip=NEXT, is_source=True, reference=header())
    lines = texts(found)
    assert found.n_steps == 6000
    assert lines["source steps"] == (6000, "24 for each of 270 pictures, at most 6,000")
    assert lines["static anchors"] == (20621, "kept as they are; counted in the reference clip")
    assert lines["Gaussians per anchor"] == (5, "the reference clip's")
    assert lines["tiles"][0] == "active"
    assert lines["voxel"] == (0.02855, "the reference clip's: the same place gives the same anchors")
    assert "background frames" not in lines


def test_a_source_clip_before_its_reference_says_that_it_guesses():
    assert "not trained yet" in texts(plan(clip=NEXT, is_source=True))["static anchors"][1]


def test_steps_at_half_size_are_told_take_less_time_and_more_memory():
    full, coarse = plan(is_source=True), plan(is_source=True, config=TrainConfig(coarse_share=0.5))
    assert full.line("half size") is None
    assert texts(coarse)["half size"] == (3000, "the first 50 % of every phase, as set")
    assert texts(plan(config=TrainConfig(coarse_share=0.5)))["half size"][0] == 405 + 2700
    assert coarse.n_steps == full.n_steps
    assert 0.8 < coarse.training_s.value / full.training_s.value < 1.0
    pictures_mb = 270 * 640 * 360 * 3 / 1e6
    assert coarse.memory_mb.value - full.memory_mb.value == pytest.approx(pictures_mb / 4, abs=0.01)


def test_clips_trained_before_say_what_to_expect():
    siblings = [
        measured(clip_index=i, role="source", n_anchors={"static": 20621, "residual": n}, n_alive=7000)
        for i, n in ((1, 8000), (2, 21000), (3, 9000))
    ]
    lines = texts(
        plan(clip=dataclasses.replace(NEXT, clip_index=4), is_source=True, reference=header(), history=siblings)
    )
    said = "expected, the middle of 3 clips trained before; at most 32,000 with the inherited ones in use"
    assert lines["residual anchors"] == (9000, said)


def test_a_still_clip_before_says_nothing_of_one_in_which_something_may_move():
    nothing = {
        "role": "source",
        "step": 0,
        "n_alive": 0,
        "field": None,
        "n_anchors": {"static": 20621, "moving": 26923},
    }
    still = measured_clip(header(clip_index=1, **nothing, metrics={}), disk_mb=0.001, uncounted_s=0.0)
    assert still is not None
    later = dataclasses.replace(NEXT, clip_index=2, start=20)
    arguments = {"clip": later, "is_source": True, "reference": header()}
    with_it, without = (plan(history=[measured(), *known], **arguments) for known in ([still], []))
    assert with_it == without


def test_one_frame():
    one = plan(clip=dataclasses.replace(CLIP, n_frames=1))
    lines = texts(one)
    assert lines["pictures"][0] == 27
    assert "x 1 frame," in lines["pictures"][1]
    assert lines["joint steps"] == (1200, "20 for each of 27 pictures, at least 1,200")
    assert one.seconds < plan().seconds


def test_the_paper_preset_costs_what_it_costs():
    found = plan(SAMPLE, config=TrainConfig(**preset("paper")))
    lines = texts(found)
    assert lines["joint steps"] == (6120, "34 passes over 180 pictures, as set")
    assert lines["Gaussians per anchor"] == (10, "as set")
    assert lines["features"] == ("64 + 64", "as set")
    assert lines["field levels"] == (16, "as set")
    assert "2^17 entries, as set" in lines["field table values"][1]
    small = plan(SAMPLE)
    assert found.training_s.value > 3 * small.training_s.value
    assert found.disk_mb.value > small.disk_mb.value
    assert found.memory_mb.value > small.memory_mb.value


@pytest.mark.parametrize(
    ("setting", "name", "expected"),
    [
        ({"static_steps": 7}, "static steps", (7, "as set")),
        ({"joint_steps": 9}, "joint steps", (9, "as set")),
        ({"patience": 4}, "early stop", ("600", "when 6 pictures kept out of training gain nothing over 4 looks")),
        ({"background_frames": 12}, "background frames", (12, "of every camera, spread over the capture")),
    ],
)
def test_what_is_set_is_said(setting, name, expected):
    assert texts(plan(config=TrainConfig(**setting)))[name] == expected


def test_ablations_of_a_source_clip():
    def lines(**settings):
        found = plan(clip=NEXT, is_source=True, reference=header(), config=TrainConfig(**settings))
        return texts(found), found

    none, _ = lines(residual="none")
    assert none["residual anchors"] == (0, "residual=none")
    full, _ = lines(residual="full")
    assert full["residual anchors"][0] == 26923
    _, default = lines()
    for settings in ({"decoder": "finetune"}, {"inherit": "trainable"}, {"tiles": "all"}):
        assert lines(**settings)[1].training_s.value > default.training_s.value


def test_clips_that_store_and_build_more_cost_more():
    def planned(**settings):
        return plan(clip=NEXT, is_source=True, reference=header(), config=TrainConfig(**settings))

    default, own, learning = planned(), planned(inherit="off"), planned(inherit="trainable")
    assert own.preparation_s.value > default.preparation_s.value + 5  # depth maps of 27 cameras
    assert learning.preparation_s.value == default.preparation_s.value
    assert min(own.disk_mb.value, learning.disk_mb.value) > 1.3 * default.disk_mb.value
    heads = planned(decoder="new").disk_mb.value - default.disk_mb.value
    assert 0.01 < heads < 0.05


def test_a_clip_that_goes_on_from_the_one_before_is_of_the_short_kind():
    on = TrainConfig(independent=True, start="previous").going_on()
    found = plan(clip=NEXT, is_source=True, reference=header(), config=on)
    assert [line.name for line in found.lines if line.name.endswith("steps")] == ["source steps"]
    assert "they go on learning" in texts(found)["static anchors"][1]
    before = measured(clip_index=2, previous_fingerprint="0")
    assert before.is_source
    assert not measured().is_source


def test_a_plan_is_json():
    document = json.loads(json.dumps(plan().as_dict()))
    assert document["forecast"].keys() == {"preparation_s", "training_s", "memory_mb", "disk_mb"}
    assert all(line.keys() == {"name", "value", "unit", "reason"} for line in document["lines"])
    assert all(line["reason"] for line in document["lines"])
    assert plan().line("memory") == plan().memory_mb
    assert plan().line("nonsense") is None


# ---------------------------------------------------------------- forecasts

TRAINED = [
    # as trained by the worker process: footage, header, and what it took: preparation, training, memory, disk
    (BASKETBALL, header(), (21.8, 175.2, None, 2.362)),
    (
        BASKETBALL,
        header(role="source", clip_index=1, step=6000, n_anchors={"static": 20621, "residual": 8167}, n_alive=6738),
        (4.7, 106.4, 1205.0, 0.555),
    ),
    (
        BASKETBALL,
        header(role="source", clip_index=2, step=6000, n_anchors={"static": 20621, "residual": 21111}, n_alive=7552),
        (4.8, 113.0, 1205.0, 0.730),
    ),
    (
        SAMPLE,
        header(step=1980, n_anchors={"static": 14747, "moving": 9549}, n_alive=2416),
        (10.2, 25.5, 831.0, 1.139),
    ),
    (
        SAMPLE,
        header(role="source", clip_index=1, step=1440, n_anchors={"static": 14747, "residual": 6603}, n_alive=3846),
        (2.77, 16.7, 745.0, 0.289),
    ),
]


@pytest.mark.parametrize(("footage", "trained", "took"), TRAINED)
def test_forecasts_without_any_clip_lie_within_a_factor_of_one_and_a_half(footage, trained, took):
    is_source = trained.role == "source"
    config = TrainConfig() if footage is BASKETBALL else TrainConfig(passes=8)
    clip = dataclasses.replace(CLIP, clip_index=trained.clip_index)
    reference = None
    if is_source:
        reference = TRAINED[0 if footage is BASKETBALL else 3][1]
    found = plan(footage, clip, is_source=is_source, config=config, reference=reference)
    assert found.n_steps == trained.step
    for line, measured_value in zip(found.forecast, took, strict=True):
        if measured_value is not None:
            assert 1 / 1.5 < line.value / measured_value < 1.5, line


def test_a_clip_of_the_same_kind_corrects_all_four():
    twice = measured(metrics={"preparation_s": 50.0, "training_s": 400.0, "memory_mb": 3000.0})
    again = plan(clip=dataclasses.replace(CLIP, clip_index=7), history=[twice])
    assert again.training_s.value == pytest.approx(400, rel=0.05)  # counts are the measured ones, so sizes agree
    assert again.preparation_s.value == pytest.approx(47.5, rel=0.05)  # without compiling
    assert again.memory_mb.value == pytest.approx(3000, rel=0.05)
    assert again.disk_mb.value == pytest.approx(2.36, rel=0.05)
    assert "as measured on clip 0" in again.training_s.reason


def test_half_the_steps_take_half_the_time_of_a_measured_clip():
    history = [measured(role="source", step=6000, n_anchors={"static": 20621, "residual": 8167})]
    whole, half = (
        plan(clip=NEXT, is_source=True, reference=header(), history=history, config=TrainConfig(source_steps=n))
        for n in (6000, 3000)
    )
    assert half.training_s.value == pytest.approx(whole.training_s.value / 2)
    assert half.preparation_s.value == whole.preparation_s.value


def test_a_clip_of_the_other_kind_corrects_within_bounds():
    plain = plan(clip=NEXT, is_source=True, reference=header())
    for factor, bound in ((1.4, 1.4), (40.0, 2.0)):
        slow = measured(metrics={"training_s": 175.2 * factor})
        found = plan(clip=NEXT, is_source=True, reference=header(), history=[slow])
        assert found.training_s.value / plain.training_s.value == pytest.approx(bound, rel=0.1)
        assert "of the other kind" in found.training_s.reason
    assert found.preparation_s.value == plain.preparation_s.value  # not recorded
    assert found.disk_mb == plain.disk_mb  # the other kind says nothing about that


def test_the_clip_itself_does_not_count():
    slow = measured(metrics={"preparation_s": 500.0, "training_s": 9000.0})
    assert plan(history=[slow]) == plan()


def test_the_machine_counts_where_no_clip_does():
    slow = MachineSpeed(3.0, "measured")
    plain, found = plan(), plan(machine=slow)
    assert found.training_s.value == pytest.approx(3 * plain.training_s.value, rel=1e-3)
    assert found.training_s.reason == "measured"
    assert found.memory_mb == plain.memory_mb
    known = plan(clip=dataclasses.replace(CLIP, clip_index=7), history=[measured()], machine=slow)
    assert known == plan(clip=dataclasses.replace(CLIP, clip_index=7), history=[measured()])


# ---------------------------------------------------------------- bad input


def test_a_header_of_an_earlier_version_has_no_counts():
    assert counts_of(header(n_alive=None)) is None


def test_counts_of_a_header():
    assert counts_of(header()) == Counts(20621, 26923, 7235, 7 * 65536 * 4)
    assert counts_of(header(field=None)) == Counts(20621, 26923, 7235, 0)


@pytest.mark.parametrize("value", [None, -1.0, 0])
def test_times_that_are_none_are_not_used(value):
    known = measured(metrics={"training_s": value, "preparation_s": value})
    assert (known.training_s, known.preparation_s) == (None, None)
    assert measured(metrics=None).memory_mb is None


def test_a_capture_without_enough_cameras_is_refused():
    capture = open_capture(asset_path("sample"), scale=0.25)
    with pytest.raises(PreparationError, match="Only 1 of 20 cameras"):
        footage_of(capture, range(19))
    assert footage_of(capture, [3, 3]) == Footage(80, 60, 19, 1, 30)


def test_planning_loads_no_torch():
    code = "import sys, engine.training.plan.plan; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
