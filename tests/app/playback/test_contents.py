"""Parts of a clip, and where its Gaussians come from and how far they have changed. Tiny models, real decoding."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from app.playback.modes.contents import BORN_HERE, LEARNED_ON, OF_REFERENCE, EditedParts, part_of
from app.playback.modes.view_modes import CONTENTS
from engine.clip_files.clip_state import ClipState
from engine.model.clip_model import ClipModel
from tests.app.playback.clip_models import CLIP, reference, source
from tests.clip_headers import make_header
from tests.engine.metrics.tiny_clips import CLIP_LENGTH, make_model


def parts_of(model: ClipModel, state: ClipState, base: ClipState | None) -> EditedParts:
    return EditedParts(model, CLIP, state, base)


@pytest.mark.parametrize("content", CONTENTS)
@pytest.mark.parametrize("frame", range(CLIP_LENGTH))
def test_births_and_changes_belong_to_the_gaussians_of_every_part(content: str, frame: int) -> None:
    _, state = reference()
    parts = parts_of(*source(state), state)
    found = parts.part(content).decode(CLIP.clip_time(frame))
    assert len(parts.births(found.rows)) == len(found.rows) == len(found.gaussians)
    assert parts.changes(found.gaussians, found.rows).shape == (len(found.gaussians),)


@pytest.mark.slow
def test_static_and_dynamic_together_are_everything() -> None:
    _, state = reference()
    parts = parts_of(*source(state), state)
    contents = ("all", "static", "dynamic")
    everything, static, dynamic = (parts.part(content).decode(0.0).gaussians for content in contents)
    for name in ("means", "quats", "scales", "opacities", "colors"):
        joined = torch.cat([getattr(static, name), getattr(dynamic, name)])
        torch.testing.assert_close(joined, getattr(everything, name), rtol=0, atol=0)


def test_a_clip_in_which_nothing_moves_has_an_empty_dynamic_part() -> None:
    model = make_model(has_motion=False)
    parts = parts_of(model, ClipState({}, make_header(spacing=0.2)), None)
    empty = parts.part("dynamic").decode(0.0)
    assert len(empty.gaussians) == 0
    assert len(parts.births(empty.rows)) == len(parts.changes(empty.gaussians, empty.rows)) == 0


@pytest.mark.parametrize("adapted", [False, True])
def test_births_say_which_clip_brought_what(adapted: bool) -> None:
    _, state = reference()
    model, own = source(state, adapted=adapted)
    parts = parts_of(model, own, state)
    births = parts.births(parts.part("all").decode(0.0).rows)
    k, n_static = model.decoder.gaussians_per_anchor, len(model.anchor_set("static"))
    moving = LEARNED_ON if adapted else OF_REFERENCE
    n_moving, n_residual = len(model.alive("adapted" if adapted else "moving", 0.0)), 1
    in_order = {"static": (OF_REFERENCE, n_static), "residual": (BORN_HERE, n_residual)}
    in_order["adapted" if adapted else "moving"] = (moving, n_moving)
    expected = np.concatenate([np.full(k * n, birth) for birth, n in (in_order[role] for role in model.roles())])
    np.testing.assert_array_equal(births, expected)


def test_a_reference_clip_is_all_its_own_and_only_what_moves_has_changed() -> None:
    model, state = reference()
    parts = parts_of(model, state, None)
    found = parts.part("all").decode(0.0)
    changes = parts.changes(found.gaussians, found.rows)
    n_static = model.decoder.gaussians_per_anchor * len(model.anchor_set("static"))
    assert not parts.births(found.rows).any()
    np.testing.assert_allclose(changes[:n_static], 0.0, atol=1e-6)
    assert (changes[n_static:] > 1e-3).all(), "the field is far from zero"


@pytest.mark.parametrize("adapted", [False, True])
def test_changes_are_the_largest_of_colour_opacity_and_way(adapted: bool) -> None:
    base, state = reference()
    model, own = source(state, adapted=adapted)
    parts = parts_of(model, own, state)
    found = parts.part("all").decode(0.0)
    gaussians, changes = found.gaussians, parts.changes(found.gaussians, found.rows)
    k = model.decoder.gaussians_per_anchor
    roles = np.concatenate([np.repeat(role, k * len(model.alive(role, 0.0))) for role in model.roles()])
    assert np.isnan(changes[roles == "residual"]).all()
    np.testing.assert_allclose(changes[roles == "static"], 0.0, atol=1e-6)
    is_moving = torch.from_numpy((roles == "moving") | (roles == "adapted"))
    before, now = base.static_gaussians("moving"), gaussians[is_moving.nonzero()[:, 0]]
    colors = (now.colors - before.colors).abs().amax(1)
    opacities = (now.opacities - before.opacities).abs()
    ways = (now.means - before.means).norm(dim=1) / 0.2
    expected = torch.stack([colors, opacities, ways]).amax(0)
    np.testing.assert_allclose(changes[is_moving.numpy()], expected.numpy(), rtol=1e-4)


def test_a_part_leaves_the_model_as_it_is() -> None:
    model, _ = reference()
    before = model.decode(0.0)
    assert part_of(model, "all") is model
    part_of(model, "dynamic").decode(0.0)
    for mine, theirs in zip(model.decode(0.0).tensors(), before.tensors(), strict=True):
        torch.testing.assert_close(mine, theirs, rtol=0, atol=0)
