"""Promotion and demotion in whole trainings: who becomes dynamic, what stays the same, what is stored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from engine.clip_files.clip_state import ClipState, read_clip_state
from engine.clip_files.compact import write_compact_clip
from engine.errors import NonFiniteLoss
from engine.gate.image_gate import MIN_FRAMES, GateTable
from engine.gate.reasons import CHANGES, INSIDE, LEARNED_NOTHING, LIGHT, STILL, USER_DYNAMIC, USER_STATIC
from engine.gate.regions import GateRegion
from engine.model.clip_model import ClipModel, load_clip_model
from engine.model.clip_view import REACH_SPACINGS
from engine.training.clip_training import ClipTraining
from engine.training.preparation import clip_preparation
from engine.training.preparation.building import merged
from engine.training.step import demotion
from tests.engine.training.tiny_training import (
    CLIP_LENGTH,
    Tiny,
    finish,
    live_picture,
    picture,
    same_arrays,
    take_steps,
)

pytestmark = pytest.mark.slow

STATIC = ("positions", "color_logits", "features", "log_offset_scales", "log_base_scales")


def around(points: np.ndarray, treat: str, n: int = 9) -> tuple[GateRegion, np.ndarray]:
    """A box that holds the n leftmost of these points, and which these are."""
    rows = np.argsort(points[:, 0], kind="stable")[:n]
    x0, y0, z0 = points[rows].min(axis=0).tolist()
    x1, y1, z1 = points[rows].max(axis=0).tolist()
    region = GateRegion(treat, (x0, y0, z0), (x1, y1, z1))
    return region, region.contains(points)


def static_points(state: ClipState) -> np.ndarray:
    return state.arrays["sets.static.positions"]


def learned(state: ClipState) -> dict[str, np.ndarray]:
    return {name: array for name, array in state.arrays.items() if not name.startswith("gate.")}


def seeing_light(monkeypatch: pytest.MonkeyPatch, rows: np.ndarray) -> None:
    """Trainings measure that light changes on these static anchors, and that none lies inside a hull."""

    def measured(_frames, _n_frames, _backgrounds, _rig, points: np.ndarray, **_) -> GateTable:
        is_dynamic = np.zeros(len(points), dtype=bool)
        is_dynamic[rows] = True
        reasons = np.where(is_dynamic, LIGHT, STILL).astype(np.uint8)
        return GateTable(is_dynamic, reasons, is_dynamic.astype(np.float32) * 2)

    monkeypatch.setattr(clip_preparation, "measure_gate", measured)
    monkeypatch.setattr(clip_preparation, "frames_inside", lambda points, *_: np.zeros(len(points), dtype=np.int64))


def look_of(model: ClipModel, rows: np.ndarray) -> list[np.ndarray]:
    """Decoded Gaussians of static rows."""
    k = model.decoder.gaussians_per_anchor
    chosen = torch.from_numpy((rows[:, None] * k + np.arange(k)).reshape(-1))
    return [tensor[chosen].numpy() for tensor in model.constant_gaussians("static").tensors()]


@pytest.mark.parametrize("clip_index", [0, 1])
def test_where_nothing_changes_the_gate_from_pictures_changes_no_bit(tiny: Tiny, tmp_path, monkeypatch, clip_index):
    seeing_light(monkeypatch, np.zeros(0, dtype=np.int64))
    trained = [
        tiny.trained(clip_index, is_source=clip_index > 0, gate=gate, prep_dir=tmp_path) for gate in ("hull", "images")
    ]
    assert same_arrays(trained[0].arrays, learned(trained[1]))
    assert (trained[1].arrays["gate.static"] == STILL).all()
    assert not any(name.startswith("gate.") for name in trained[0].arrays)


def test_the_gate_from_pictures_finds_no_lamp_in_the_sample(tiny: Tiny, tmp_path):
    reasons = tiny.prepared(1, gate="images", prep_dir=tmp_path).state().arrays["gate.static"]
    assert not np.isin(reasons, (LIGHT, CHANGES)).any()


def test_promoted_anchors_go_on_from_what_they_learned_and_every_clip_inherits_them(tiny: Tiny, tmp_path, monkeypatch):
    rows = np.arange(5, 17)
    seeing_light(monkeypatch, rows)
    training = tiny.training(0, is_source=False, gate="images", prep_dir=tmp_path)
    training.prepare()
    take_steps(training, 12)
    before = training.model.anchor_set("static")
    expected = before.features.detach()[rows].numpy().copy()
    n_static, positions = len(before), before.positions.numpy().copy()
    training._add_moving()
    promoted = training.model.anchor_set("promoted")
    assert training.model.roles() == ["static", "moving", "promoted"]
    assert np.array_equal(promoted.positions.numpy(), positions[rows])
    assert np.array_equal(promoted.features.detach().numpy(), expected)
    assert promoted.presence is not None
    assert promoted.presence.all()
    assert len(training.model.anchor_set("static")) == n_static - len(rows)
    assert training.model.field is not None
    training._start_phase(1, 0)
    state = finish(training)
    assert not np.array_equal(state.arrays["sets.promoted.features"], expected)  # they learn
    assert (state.arrays["gate.promoted"] == LIGHT).all()
    assert len(state.arrays["gate.static"]) == n_static - len(rows)

    seeing_light(monkeypatch, np.zeros(0, dtype=np.int64))
    source = tiny.trained(1, reference=state, gate="images", prep_dir=tmp_path)
    assert source.arrays["inherited.promoted.presence"].all()  # part of the still scene: there at all times
    model = load_clip_model(source, state)
    assert model.roles()[:3] == ["static", "moving", "promoted"]
    for clip_time in (0.0, 0.75):
        assert len(model.alive("promoted", clip_time)) == len(rows)


@pytest.mark.parametrize("settings", [{}, {"tiles": "all"}])
def test_a_source_clip_replaces_anchors_and_leaves_all_others_as_they_are(tiny: Tiny, tmp_path, monkeypatch, settings):
    rows = np.array([3, 4, 100, 101, 102, 333])
    seeing_light(monkeypatch, rows)
    training = tiny.prepared(1, gate="images", prep_dir=tmp_path, **settings)
    hidden = training.model.hidden["static"].numpy()
    assert np.array_equal(np.flatnonzero(hidden), rows)
    replacing = training.model.anchor_set("replacing")
    assert np.array_equal(replacing.positions.numpy(), static_points(tiny.reference)[rows])
    assert np.array_equal(replacing.features.detach().numpy(), tiny.reference.arrays["sets.static.features"][rows])
    assert (training._tiles is not None) == (not settings)
    state = finish(training)
    assert not np.array_equal(
        state.arrays["sets.replacing.features"], tiny.reference.arrays["sets.static.features"][rows]
    )
    model, reference = load_clip_model(state, tiny.reference), load_clip_model(tiny.reference, None)
    kept = np.flatnonzero(~hidden)
    assert len(model.anchor_set("static")) == len(kept)
    for ours, theirs in zip(look_of(model, np.arange(len(kept))), look_of(reference, kept), strict=True):
        assert np.array_equal(ours, theirs)  # the same bits in every clip


def test_active_tiles_change_nothing_with_replaced_anchors(tiny: Tiny, tmp_path, monkeypatch):
    seeing_light(monkeypatch, np.arange(20, 40))
    states = [tiny.trained(1, gate="images", prep_dir=tmp_path, tiles=tiles) for tiles in ("active", "all")]
    assert same_arrays(*(state.arrays for state in states))


def test_replaced_anchors_survive_storage_and_resuming(tiny: Tiny, tmp_path, monkeypatch):
    seeing_light(monkeypatch, np.arange(50, 70))
    arguments = {"gate": "images", "prep_dir": tmp_path}
    straight = finish(tiny.prepared(1, **arguments))
    first = tiny.prepared(1, **arguments)
    take_steps(first, 3).write_checkpoint(tmp_path / "checkpoint.safetensors")
    resumed = tiny.training(1, **arguments)
    resumed.restore_checkpoint(tmp_path / "checkpoint.safetensors")
    assert same_arrays(finish(resumed).arrays, straight.arrays)
    write_compact_clip(tmp_path / "clip.safetensors", resumed.finish())
    again = read_clip_state(tmp_path / "clip.safetensors")
    assert again.arrays["inherited.static.is_hidden"].sum() == 20 - int(
        (again.arrays["gate.static"] == LEARNED_NOTHING).sum()
    )
    assert np.array_equal(picture(tiny, again, tiny.reference), live_picture(tiny, resumed))


def test_a_clip_that_streams_on_keeps_replaced_anchors_as_promoted_ones(tiny: Tiny, tmp_path, monkeypatch):
    seeing_light(monkeypatch, np.arange(10))
    streaming = {"gate": "images", "independent": True, "start": "previous", "prep_dir": tmp_path}
    second = tiny.trained(1, is_source=False, previous=tiny.reference, **streaming)
    assert not any("is_hidden" in name for name in second.arrays)  # it owns all of its anchors
    n_static = len(static_points(tiny.reference))
    assert len(static_points(second)) == n_static - 10
    start = merged(second)
    assert len(start.arrays["sets.promoted.positions"]) == 10
    third = tiny.prepared(2, is_source=False, previous=second, **streaming)
    presence = third.model.anchor_set("promoted").presence
    assert presence is not None
    assert presence.shape == (10, CLIP_LENGTH)
    assert presence.all()


def test_anchors_inside_a_hull_are_replaced_and_may_go(tiny: Tiny, tmp_path, monkeypatch):
    seeing_light(monkeypatch, np.zeros(0, dtype=np.int64))
    n_frames_inside = np.zeros(len(static_points(tiny.reference)), dtype=np.int64)
    n_frames_inside[[7, 8]], n_frames_inside[9] = (MIN_FRAMES, CLIP_LENGTH), MIN_FRAMES - 1
    monkeypatch.setattr(clip_preparation, "frames_inside", lambda *_: n_frames_inside)
    training = tiny.prepared(1, gate="images", prep_dir=tmp_path)
    assert np.flatnonzero(training.model.hidden["static"].numpy()).tolist() == [7, 8]
    assert np.flatnonzero(training.state().arrays["gate.static"] == INSIDE).tolist() == [7, 8]
    assert not tiny.prepared(1, prep_dir=tmp_path).model.hidden  # gate=hull leaves them as they are


@pytest.mark.parametrize("gate", ["hull", "images"])
def test_what_the_user_marks_as_dynamic_is(tiny: Tiny, tmp_path, gate):
    region, inside = around(static_points(tiny.reference), "dynamic")
    training = tiny.prepared(1, gate=gate, prep_dir=tmp_path, regions=[region])
    assert (training.model.hidden["static"].numpy() >= inside).all()
    assert (training.state().arrays["gate.static"][inside] == USER_DYNAMIC).all()


def test_what_the_user_marks_as_static_is(tiny: Tiny, tmp_path, monkeypatch):
    region, inside = around(static_points(tiny.reference), "static")
    seeing_light(monkeypatch, np.flatnonzero(inside))
    training = tiny.prepared(1, gate="images", prep_dir=tmp_path, regions=[region])
    assert not training.model.hidden
    assert (training.state().arrays["gate.static"][inside] == USER_STATIC).all()
    everywhere = GateRegion("static", (-1e6, -1e6, -1e6), (1e6, 1e6, 1e6))
    still = tiny.prepared(1, prep_dir=tmp_path, regions=[everywhere])
    assert still.is_finished  # nothing moves where nothing may: there is nothing to learn
    assert still.model.roles() == ["static", "moving"]


def test_the_published_method_knows_no_regions(tiny: Tiny, tmp_path):
    ungated = tiny.trained(0, is_source=False, gate="off", prep_dir=tmp_path, static_steps=2, joint_steps=2)
    region, _ = around(static_points(ungated), "dynamic")
    training = tiny.prepared(1, reference=ungated, gate="off", prep_dir=tmp_path, regions=[region])
    assert not training.model.hidden
    # nor does a source clip split a set that is dynamic as a whole
    assert "replacing" not in tiny.prepared(1, reference=ungated, gate="images", prep_dir=tmp_path).model.roles()


# ---------------------------------------------------------------- demotion


def demoted(tiny: Tiny, training: ClipTraining, state: ClipState) -> tuple[ClipState, str]:
    views = [training._views[camera] for camera in training.camera_indices]
    return demotion.demote(state, training.reference, views, reach=REACH_SPACINGS * state.header.spacing)


def test_what_nobody_sees_goes(tiny: Tiny, monkeypatch):
    # nothing is that transparent after so few steps, so the limit is raised
    opacities = largest_opacities(tiny.reference)
    limit = float(np.sort(opacities)[20])
    monkeypatch.setattr(demotion, "MIN_OPACITY", limit)
    monkeypatch.setattr(demotion, "_looks_like", lambda model, role, *_: np.zeros(len(model.anchor_set(role)), bool))
    result, said = demoted(tiny, tiny.training(0, is_source=False), tiny.reference)
    is_kept = opacities >= limit
    assert is_kept.sum() == len(is_kept) - 20
    for name in STATIC:
        assert np.array_equal(
            result.arrays[f"sets.moving.{name}"], tiny.reference.arrays[f"sets.moving.{name}"][is_kept]
        )
        assert np.array_equal(result.arrays[f"sets.static.{name}"], tiny.reference.arrays[f"sets.static.{name}"])
    assert "20 own anchors" in said
    assert "rest in this clip" in said


def largest_opacities(state: ClipState) -> np.ndarray:
    """Of each moving anchor over frames and the times between them."""
    model = load_clip_model(state, None)
    largest = np.zeros(len(model.anchor_set("moving")))
    for half in range(2 * model.n_frames - 1):
        rows = model.alive("moving", half / (2 * model.clip_length))
        nothing = torch.zeros(0, dtype=torch.int64)
        gaussians = model.decode(half / (2 * model.clip_length), {"static": nothing, "moving": rows})
        found = gaussians.opacities.detach().reshape(len(rows), -1).amax(dim=1).numpy()
        largest[rows.numpy()] = np.maximum(largest[rows.numpy()], found)
    return largest


def test_a_frame_without_anyone_is_no_obstacle(tiny: Tiny):
    state = tiny.trained(1)
    arrays = {name: array.copy() for name, array in state.arrays.items()}
    arrays["inherited.moving.presence"][:, 2] = False
    result, _ = demoted(tiny, tiny.training(1), replace(state, arrays=arrays))
    assert not result.arrays["inherited.moving.presence"][:, 2].any()


def test_inherited_anchors_that_nobody_sees_rest_in_the_clip(tiny: Tiny, monkeypatch):
    training = tiny.training(1)
    state = tiny.trained(1)
    monkeypatch.setattr(demotion, "MIN_OPACITY", 2.0)
    result, _ = demoted(tiny, training, state)
    assert not result.arrays["inherited.moving.presence"].any()
    assert "sets.residual.positions" not in result.arrays
    assert np.isfinite(picture(tiny, result, tiny.reference)).all()


def test_anchors_that_learned_no_change_become_static(tiny: Tiny, tmp_path, monkeypatch):
    rows = np.arange(30, 50)
    seeing_light(monkeypatch, rows)
    training = tiny.prepared(0, is_source=False, gate="images", prep_dir=tmp_path, static_steps=4)
    take_steps(training, 4)._add_moving()
    state = training.state()  # no joint step: the field is as it starts, next to nothing
    result, said = demoted(tiny, training, state)
    assert "sets.promoted.positions" not in result.arrays
    n_static = len(static_points(state))
    returned = static_points(result)[n_static:]
    assert all(
        position.tobytes() in {row.tobytes() for row in returned}
        for position in state.arrays["sets.promoted.positions"]
    )
    assert (result.arrays["gate.static"][n_static:] == LEARNED_NOTHING).all()
    assert len(result.arrays["gate.static"]) == len(static_points(result))
    assert "are static" in said
    difference = np.abs(picture(tiny, result, None) - picture(tiny, state, None)).max()
    assert difference <= demotion.MAX_CHANGE


def test_a_replaced_anchor_that_learned_nothing_comes_back(tiny: Tiny, tmp_path, monkeypatch):
    rows = np.arange(30, 50)
    seeing_light(monkeypatch, rows)
    training = tiny.prepared(1, gate="images", prep_dir=tmp_path)
    state = training.state()  # not a step: all replacing anchors look as the static ones did
    result, _ = demoted(tiny, training, state)
    assert "inherited.static.is_hidden" not in result.arrays
    assert "sets.replacing.positions" not in result.arrays
    assert (result.arrays["gate.static"][rows] == LEARNED_NOTHING).all()
    assert state.arrays["inherited.static.is_hidden"].sum() == len(rows)  # what was given stays
    arrays = state.arrays | {"sets.replacing.features": state.arrays["sets.replacing.features"].copy()}
    arrays["sets.replacing.features"][7] += 3.0
    result, _ = demoted(tiny, training, replace(state, arrays=arrays))
    assert np.flatnonzero(result.arrays["inherited.static.is_hidden"]).tolist() == [rows[7]]
    assert len(result.arrays["sets.replacing.positions"]) == 1


def test_what_would_change_pixels_is_undone(tiny: Tiny, tmp_path, monkeypatch):
    seeing_light(monkeypatch, np.arange(30, 50))
    training = tiny.prepared(1, gate="images", prep_dir=tmp_path)
    arrays = {name: array.copy() for name, array in training.state().arrays.items()}
    arrays["sets.replacing.features"] += 3.0
    state = replace(training.state(), arrays=arrays)
    monkeypatch.setattr(demotion, "_alike", lambda first, _: torch.ones(len(first), dtype=torch.bool))
    result, said = demoted(tiny, training, state)
    assert "would change" in said
    assert result.arrays["inherited.static.is_hidden"].sum() == 20


def test_numbers_that_are_not_finite_are_refused_not_dropped(tiny: Tiny, tmp_path, monkeypatch):
    seeing_light(monkeypatch, np.arange(5))
    training = tiny.prepared(1, gate="images", prep_dir=tmp_path)
    with torch.no_grad():
        training.model.anchor_set("replacing").features[2] = float("nan")
    with pytest.raises(NonFiniteLoss, match=r"replacing"):
        training.finish()
