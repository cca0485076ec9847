"""Plans: steps and pictures of both kinds of clip, and forecasts from clips or from timed steps."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest

from engine.assets import asset_path
from engine.backends.table import backend_called
from engine.capture.capture import open_capture
from engine.capture.clip import Clip
from engine.clip_files.clip_header import ClipHeader
from engine.errors import PreparationError
from engine.training.config import TrainConfig
from engine.training.plan import plan as plan_module
from engine.training.plan.forecast import MeasuredClip, measured_clip
from engine.training.plan.measured_steps import measured_step_s
from engine.training.plan.plan import Footage, StepSizes, footage_of, make_plan, resumed_plan
from tests.clip_headers import make_header

SAMPLE = Footage(width=320, height=240, n_cameras=18, n_held_out=2, n_frames=30)
BASKETBALL = Footage(width=640, height=360, n_cameras=27, n_held_out=4, n_frames=40)
HALF = Footage(width=320, height=180, n_cameras=27, n_held_out=4, n_frames=40)
FIVE = Clip(clip_index=0, start=0, n_frames=5, clip_length=5)
CLIP = Clip(clip_index=0, start=0, n_frames=10, clip_length=10)
NEXT = Clip(clip_index=1, start=10, n_frames=10, clip_length=10)
STEP_S = {"static": 0.01, "joint": 0.02, "moving": 0.02, "source": 0.03}


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
        "step": 4050,
        "n_anchors": {"static": 20621, "moving": 26923},
        "n_alive": 7235,
        "reference_fingerprint": "clip",
        "metrics": {"preparation_s": 24.3, "training_s": 175.2, "memory_mb": 1400.0},
    }
    return make_header(**found | changes)


def measured(**changes) -> MeasuredClip:
    """The same clip as history."""
    return measured_clip(header(**changes), disk_mb=2.36, uncounted_s=2.5)


def plan(footage=BASKETBALL, clip=CLIP, *, is_source=False, config=None, **arguments: Any):
    """A plan with the default settings unless said otherwise."""
    arguments.setdefault("step_time", lambda sizes, phase: STEP_S[phase])
    return make_plan(footage, clip, config or TrainConfig(), is_source=is_source, **arguments)


def values(found) -> dict[str, object]:
    """Lines by name."""
    return {line.name: line.value for line in found.lines}


# ---------------------------------------------------------------- lines


def test_a_reference_clip():
    found = plan()
    assert (found.role, found.n_steps) == ("reference", 4050)
    shown = values(found)
    assert found.training_s is not None
    prices = [shown.pop(f"training at quality={quality}") for quality in ("draft", "best")]
    assert prices == pytest.approx([0.4 * found.training_s, 3 * found.training_s], rel=1e-3)
    assert shown == {
        "pictures": 270,
        "background frames": 40,
        "static steps": 810,
        "joint steps": 1847,
        "moving steps": 1393,
        "static anchors": "<= 22,000",
        "moving anchors": "<= 32,000",
        "Gaussians per anchor": 5,
    }


def test_a_source_clip_counts_what_the_reference_has():
    found = plan(clip=NEXT, is_source=True, reference=header())
    lines = values(found)
    assert found.n_steps == lines["source steps"] == 1620
    assert lines["static anchors"] == 20621
    assert "background frames" not in lines
    assert values(plan(clip=NEXT, is_source=True))["static anchors"] == "<= 22,000"


def test_a_source_clip_says_how_far_it_lies_from_its_reference():
    far = dataclasses.replace(NEXT, clip_index=12)
    lines = values(plan(clip=far, is_source=True, reference=header(), exposure=(-0.0412, 0.0004)))
    assert (lines["distance"], lines["exposure"]) == (12, "-4.1 to +0.0 %")
    assert values(plan(clip=far, is_source=True, exposure=(-0.0002, 0.0)))["exposure"] == "unchanged"
    assert not {"distance", "exposure"} & values(plan()).keys()


def test_a_cloud_of_all_frames_needs_no_phase_and_no_backgrounds():
    found = plan(config=TrainConfig(gate="off", cloud="frames", color="off"))
    assert not {"static steps", "background frames", "static anchors"} & values(found).keys()
    assert values(found)["anchors"] == "<= 54,000"
    with_backgrounds = plan(config=TrainConfig(gate="off", cloud="frames"))
    assert "background frames" in values(with_backgrounds)
    assert found.memory_mb < with_backgrounds.memory_mb


def test_a_source_clip_of_frames_has_as_many_anchors_as_it_needs():
    config = TrainConfig(cloud="frames", gate="off")
    assert values(plan(clip=NEXT, is_source=True, config=config))["residual anchors"] is None


def test_a_still_clip_takes_no_steps():
    found = plan(clip=NEXT, is_source=True, reference=header(), is_still=True)
    assert found.n_steps == found.training_s == values(found)["source steps"] == 0


def test_a_plan_is_json():
    document = json.loads(json.dumps(plan().as_dict()))
    assert document["forecast"].keys() == {"preparation_s", "training_s", "memory_mb", "disk_mb"}
    assert document["forecast"]["disk_mb"] is None
    assert all(line.keys() == {"name", "value", "unit"} for line in document["lines"])


def test_a_resumed_training_takes_what_is_left():
    whole = plan()
    rest = resumed_plan(whole, 2025, 4050)
    assert (rest.training_s, rest.preparation_s) == (pytest.approx((whole.training_s or 0) / 2), 0)
    unknown = resumed_plan(plan(step_time=lambda sizes, phase: None), 2025, 4050)
    assert (unknown.training_s, unknown.seconds) == (None, None)


# ---------------------------------------------------------------- forecasts


def test_without_any_clip_the_timed_steps_are_multiplied():
    found = plan()
    assert found.training_s == pytest.approx((810 * 0.01 + 3240 * 0.02) * 1.03, abs=0.001)
    assert found.seconds == found.preparation_s + (found.training_s or 0)
    assert (found.disk_mb, found.forecast[3].text) == (None, "unknown")


def test_without_timed_steps_the_time_is_not_known():
    found = plan(step_time=lambda sizes, phase: None)
    assert (found.training_s, found.seconds) == (None, None)


def test_steps_are_timed_at_the_sizes_of_the_reference_clip_or_expected_ones():
    asked = []
    plan(SAMPLE, step_time=lambda sizes, phase: asked.append((phase, sizes)) or 0.01)
    plan(clip=NEXT, is_source=True, reference=header(), step_time=lambda s, phase: asked.append((phase, s)) or 0.01)
    assert [phase for phase, _ in asked] == ["static", "joint", "moving", "source"]
    first, last = asked[0][1], asked[3][1]
    assert (first.width, first.height) == (320, 240)
    assert first.n_static == pytest.approx(0.6 * 14747, rel=0.1)  # as trained
    assert first.n_moving == pytest.approx(2416, rel=0.2)
    assert (last.n_static, last.n_moving) == (round(0.6 * 20621), 7235)


@pytest.mark.parametrize(
    ("footage", "clip", "is_source", "cores", "took"),
    [
        # preparation and memory of real trainings
        (BASKETBALL, CLIP, False, 2, (21.8, 1400.0)),
        (BASKETBALL, CLIP, True, 2, (4.7, 1205.0)),
        (SAMPLE, CLIP, False, 2, (10.2, 831.0)),
        (SAMPLE, CLIP, True, 2, (2.77, 745.0)),
        (HALF, CLIP, False, 2, (27.6, 1086.0)),
        (HALF, FIVE, False, 1, (49.2, 1078.0)),
    ],
)
def test_rough_figures_lie_within_a_factor_of_one_and_a_half(monkeypatch, footage, clip, is_source, cores, took):
    monkeypatch.setattr(plan_module, "n_cores", lambda: cores)
    found = plan(footage, clip, is_source=is_source)
    for expected, measured_value in zip((found.preparation_s, found.memory_mb), took, strict=True):
        assert 1 / 1.5 < expected / measured_value < 1.5


def test_a_clip_of_the_same_kind_says_all_four():
    again = plan(clip=dataclasses.replace(CLIP, clip_index=7), history=[measured()], step_time=None)
    figures = [again.preparation_s, again.training_s, again.memory_mb, again.disk_mb]
    assert figures == pytest.approx([21.8, 175.2, 1400.0, 2.36])  # preparation without compiling


def test_half_the_steps_take_half_the_time_of_a_measured_clip():
    history = [measured(role="source", step=6000)]
    whole, half = (
        plan(clip=NEXT, is_source=True, reference=header(), history=history, config=TrainConfig(source_steps=n))
        for n in (6000, 3000)
    )
    assert half.training_s == pytest.approx((whole.training_s or 0) / 2, abs=0.001)
    assert half.preparation_s == whole.preparation_s


def test_the_clip_itself_the_other_kind_and_still_clips_do_not_count():
    still = measured(clip_index=3, role="source", step=0, n_alive=0)
    slow = measured(metrics={"preparation_s": 500.0, "training_s": 9000.0})
    assert plan(history=[slow]) == plan()
    arguments = {"clip": NEXT, "is_source": True, "reference": header()}
    assert plan(history=[slow, still], **arguments) == plan(**arguments)
    assert measured(previous_fingerprint="0").is_source


@pytest.mark.parametrize("phase", ["static", "joint", "moving", "source"])
def test_steps_of_every_phase_can_be_timed(phase):
    sizes = StepSizes(32, 24, n_static=40, n_moving=20, config=TrainConfig(gaussians_per_anchor=2))
    assert 0 < measured_step_s(sizes, phase, backend_called("cpu")) < 60


# ---------------------------------------------------------------- bad input


def test_a_header_of_an_earlier_version_has_no_counts():
    found = plan(clip=NEXT, is_source=True, reference=header(n_anchors={}, n_alive=None))
    assert found.training_s is not None


@pytest.mark.parametrize("value", [None, -1.0, 0])
def test_times_that_are_none_are_not_used(value):
    known = measured(metrics={"training_s": value, "preparation_s": value})
    assert (known.training_s, known.step_s, known.preparation_s) == (None, None, None)
    assert measured(metrics=None).memory_mb is None


def test_a_capture_without_enough_cameras_is_refused():
    capture = open_capture(asset_path("sample"), scale=0.25)
    with pytest.raises(PreparationError, match="Only 1 of 20 cameras"):
        footage_of(capture, range(19))
    assert footage_of(capture, [3, 3]) == Footage(80, 60, 19, 1, 30)
