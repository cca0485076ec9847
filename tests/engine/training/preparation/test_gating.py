"""Marked regions in whole trainings: which static anchors become dynamic, what stays the same, what is stored."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from engine.backends.table import backend_called
from engine.clip_files.clip_state import ClipState, read_clip_state
from engine.clip_files.compact import write_compact_clip
from engine.gate.reasons import STILL, USER_DYNAMIC, USER_STATIC
from engine.gate.regions import GateRegion
from engine.model.clip_model import ClipModel
from engine.model.reading import load_clip_model
from engine.training.variants.variant_method import merged
from tests.engine.training.tiny_training import (
    CLIP_LENGTH,
    Tiny,
    finish,
    live_picture,
    picture,
    same_arrays,
    stepwise,
    take_steps,
)

pytestmark = pytest.mark.slow


def around(points: np.ndarray, treat: str, n: int = 9) -> tuple[GateRegion, np.ndarray]:
    """A box that holds the n leftmost of these points, and which these are."""
    rows = np.argsort(points[:, 0], kind="stable")[:n]
    x0, y0, z0 = points[rows].min(axis=0).tolist()
    x1, y1, z1 = points[rows].max(axis=0).tolist()
    region = GateRegion(treat, (x0, y0, z0), (x1, y1, z1))
    return region, region.contains(points)


def static_points(state: ClipState) -> np.ndarray:
    return state.arrays["sets.static.positions"]


def look_of(model: ClipModel, rows: np.ndarray) -> list[np.ndarray]:
    """Decoded Gaussians of static rows."""
    k = model.decoder.gaussians_per_anchor
    chosen = torch.from_numpy((rows[:, None] * k + np.arange(k)).reshape(-1))
    return [tensor[chosen].numpy() for tensor in model.constant_gaussians("static").tensors()]


def test_promoted_anchors_go_on_from_what_they_learned_and_every_clip_inherits_them(tiny: Tiny, tmp_path):
    probe = tiny.prepared(0, is_source=False, prep_dir=tmp_path)
    region, inside = around(probe.model.anchor_set("static").positions.numpy(), "dynamic", 12)
    rows = np.flatnonzero(inside)
    training = tiny.prepared(0, is_source=False, prep_dir=tmp_path, regions=[region])
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
    assert (state.arrays["gate.promoted"] == USER_DYNAMIC).all()
    assert (state.arrays["gate.static"] == STILL).all()
    assert len(state.arrays["gate.static"]) == n_static - len(rows)

    source = tiny.trained(1, reference=state, prep_dir=tmp_path, inherit="frozen")
    assert source.arrays["inherited.promoted.presence"].all()  # part of the still scene: there at all times
    model = load_clip_model(source, state, backend=backend_called("cpu"))
    assert model.roles()[:3] == ["static", "moving", "promoted"]
    for clip_time in (0.0, 0.75):
        assert len(model.alive("promoted", clip_time)) == len(rows)


@pytest.mark.parametrize("settings", [{}, {"tiles": "all"}])
def test_a_source_clip_replaces_anchors_and_leaves_all_others_as_they_are(tiny: Tiny, tmp_path, settings):
    region, inside = around(static_points(tiny.reference), "dynamic")
    rows = np.flatnonzero(inside)
    training = tiny.prepared(1, prep_dir=tmp_path, regions=[region], **settings)
    hidden = training.model.hidden["static"].numpy()
    assert np.array_equal(np.flatnonzero(hidden), rows)
    replacing = training.model.anchor_set("replacing")
    assert np.array_equal(replacing.positions.numpy(), static_points(tiny.reference)[rows])
    assert np.array_equal(replacing.features.detach().numpy(), tiny.reference.arrays["sets.static.features"][rows])
    assert (stepwise(training).tiles is not None) == (not settings)
    state = finish(training)
    assert not np.array_equal(
        state.arrays["sets.replacing.features"], tiny.reference.arrays["sets.static.features"][rows]
    )
    model, reference = (
        load_clip_model(state, tiny.reference, backend=backend_called("cpu")),
        load_clip_model(tiny.reference, None, backend=backend_called("cpu")),
    )
    kept = np.flatnonzero(~hidden)
    assert len(model.anchor_set("static")) == len(kept)
    for ours, theirs in zip(look_of(model, np.arange(len(kept))), look_of(reference, kept), strict=True):
        assert np.array_equal(ours, theirs)  # the same bits in every clip


def test_active_tiles_change_nothing_with_replaced_anchors(tiny: Tiny, tmp_path):
    region, _ = around(static_points(tiny.reference), "dynamic", 20)
    states = [tiny.trained(1, prep_dir=tmp_path, regions=[region], tiles=tiles) for tiles in ("active", "all")]
    assert same_arrays(*(state.arrays for state in states))


def test_replaced_anchors_survive_storage_and_resuming(tiny: Tiny, tmp_path):
    region, inside = around(static_points(tiny.reference), "dynamic", 20)
    arguments = {"regions": [region], "prep_dir": tmp_path}
    straight = finish(tiny.prepared(1, **arguments))
    first = tiny.prepared(1, **arguments)
    take_steps(first, 3).write_checkpoint(tmp_path / "checkpoint.safetensors")
    resumed = tiny.training(1, **arguments)
    resumed.restore_checkpoint(tmp_path / "checkpoint.safetensors")
    assert same_arrays(finish(resumed).arrays, straight.arrays)
    write_compact_clip(tmp_path / "clip.safetensors", resumed.finish())
    again = read_clip_state(tmp_path / "clip.safetensors")
    assert np.array_equal(again.arrays["inherited.static.is_hidden"], inside)
    assert np.array_equal(picture(tiny, again, tiny.reference), live_picture(tiny, resumed))


def test_a_clip_that_streams_on_keeps_replaced_anchors_as_promoted_ones(tiny: Tiny, tmp_path):
    region, inside = around(static_points(tiny.reference), "dynamic", 10)
    n_inside = int(inside.sum())
    streaming = {"regions": [region], "independent": True, "start": "previous", "prep_dir": tmp_path}
    second = tiny.trained(1, is_source=False, previous=tiny.reference, **streaming)
    assert not any("is_hidden" in name for name in second.arrays)  # it owns all of its anchors
    n_static = len(static_points(tiny.reference))
    assert len(static_points(second)) == n_static - n_inside
    start = merged(second)
    assert len(start.arrays["sets.promoted.positions"]) == n_inside
    third = tiny.prepared(2, is_source=False, previous=second, **streaming)
    presence = third.model.anchor_set("promoted").presence
    assert presence is not None
    assert presence.shape == (n_inside, CLIP_LENGTH)
    assert presence.all()


def test_what_the_user_marks_as_dynamic_is(tiny: Tiny, tmp_path):
    region, inside = around(static_points(tiny.reference), "dynamic")
    training = tiny.prepared(1, prep_dir=tmp_path, regions=[region])
    assert np.array_equal(training.model.hidden["static"].numpy(), inside)
    assert (training.state().arrays["gate.static"][inside] == USER_DYNAMIC).all()


def test_what_the_user_marks_as_static_is(tiny: Tiny, tmp_path):
    region, inside = around(static_points(tiny.reference), "static")
    dynamic = GateRegion("dynamic", region.low, region.high)
    training = tiny.prepared(1, prep_dir=tmp_path, regions=[dynamic, region])  # later ones overrule earlier ones
    assert not training.model.hidden
    assert (training.state().arrays["gate.static"][inside] == USER_STATIC).all()
    everywhere = GateRegion("static", (-1e6, -1e6, -1e6), (1e6, 1e6, 1e6))
    still = tiny.prepared(1, prep_dir=tmp_path, regions=[everywhere], inherit="frozen")
    assert still.is_finished  # nothing moves where nothing may: there is nothing to learn
    assert still.model.roles() == ["static", "moving"]


def test_the_published_method_knows_no_regions(tiny: Tiny, tmp_path):
    ungated = tiny.trained(0, is_source=False, gate="off", prep_dir=tmp_path, static_steps=2, joint_steps=2)
    region, _ = around(static_points(ungated), "dynamic")
    training = tiny.prepared(1, reference=ungated, gate="off", prep_dir=tmp_path, regions=[region])
    assert not training.model.hidden
    # nor does a source clip split a set that is dynamic as a whole
    assert "replacing" not in tiny.prepared(1, reference=ungated, prep_dir=tmp_path, regions=[region]).model.roles()
