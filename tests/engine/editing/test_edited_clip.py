"""EditedClip against the slow truth: every action on every target, stacks of them, and what is hard about them."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from engine.editing.actions import Action, Delete, Expose, Hide, Hold, Recolor, Smooth, Transform
from engine.editing.edit import (
    Box,
    Edit,
    Everything,
    KeyedVolume,
    Picked,
    PickedRows,
    Prism,
    Scope,
    Sphere,
    TargetOfMoment,
    VolumeKey,
)
from engine.editing.edited_clip import EditedGaussians
from engine.editing.effects import NO_EFFECTS, EditStack, Effect, Effects
from engine.editing.picks import pack_rows
from engine.errors import ProjectError
from engine.model.clip_model import ClipModel
from tests.engine.editing.edited_clips import CLIP, OWN, REFERENCE, K, edited, make_clip
from tests.engine.editing.slow_truth import One, SlowTruth

TURN = (math.cos(0.3), 0.0, math.sin(0.3), 0.0)
TARGETS: dict[str, TargetOfMoment] = {
    "everything": Everything(),
    "box": Box((0.5, 0.4, 0.5), (0.3, 0.5, 0.25), TURN),
    "sphere": Sphere((0.5, 0.5, 0.5), 0.45),
    "prism": Prism(
        (0.5, 0.45, 0.5), (0.4, 0.35, 0.45), ((-1.0, -0.6), (0.9, -1.0), (0.1, 0.1), (1.0, 0.8), (-0.7, 1.0)), TURN, 2.5
    ),
    "picked": Picked(
        (
            PickedRows(0, REFERENCE, "static", pack_rows(np.arange(3, 30, 2))),
            PickedRows(0, REFERENCE, "moving", pack_rows(np.arange(5, 20))),
            PickedRows(2, OWN, "residual", pack_rows(np.array([0, 4, 5, 10_000]))),
            PickedRows(1, "another clip", "residual", pack_rows(np.arange(18))),
        )
    ),
}
ACTIONS: dict[str, Action] = {
    "hide": Hide(),
    "delete": Delete(),
    "move": Transform((0.3, -0.2, 0.1), TURN, 1.7, (0.5, 0.5, 0.5)),
    "shrink": Transform(scale=1e-6),
    "recolor": Recolor((0.9, 0.1, 0.2), 0.4, 1.8, (1.5, 0.7, 1.0), 0.6),
    "brighten": Recolor(gains=(50.0, 50.0, 50.0), opacity=99.0),
    "expose": Expose(1.3),
    "darken": Expose(-16.0),
    "hold": Hold(12),
    "hold another clip": Hold(3),
    "smooth": Smooth(0.9),
    "smooth all": Smooth(100.0),
    "smooth nothing": Smooth(0.1),
}
TIMES = (0.0, 1 / 6, 2.5 / 6, 4 / 6, 4.9 / 6)


def truth_of(model: ClipModel) -> SlowTruth:
    names = {"static": (REFERENCE, 0), "moving": (REFERENCE, 0), "residual": (OWN, 2)}
    return SlowTruth(model, CLIP, names, {"static", "moving"})


def assert_same(found: EditedGaussians, expected: dict[tuple[str, int], One]) -> None:
    names = [
        (found.rows.sets[place].role, int(number))
        for place, number in zip(found.rows.set_index, found.rows.number, strict=True)
    ]
    assert len(names) == len(set(names)) == len(found.gaussians)
    assert set(names) == set(expected)
    if not names:
        return
    wanted = [expected[name] for name in names]
    means, quats, scales, opacities, colors = (tensor.double().numpy() for tensor in found.gaussians.tensors())
    np.testing.assert_allclose(means, [one.mean for one in wanted], rtol=2e-5, atol=2e-6)
    np.testing.assert_allclose(scales, [one.scale for one in wanted], rtol=2e-5)
    np.testing.assert_allclose(opacities, [one.opacity for one in wanted], atol=2e-6)
    np.testing.assert_allclose(colors, [one.color for one in wanted], atol=4e-6)
    turns = np.stack([one.quat for one in wanted])
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    np.testing.assert_allclose(np.abs((turns * quats).sum(1)), 1.0, atol=1e-4)


def effects_of(*effects: Effect) -> Effects:
    return Effects(effects, repr(effects))


@pytest.mark.parametrize("is_inverted", [False, True])
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("action", ACTIONS)
def test_every_action_on_every_target(action: str, target: str, is_inverted: bool) -> None:
    model = make_clip()
    clip, truth = edited(model), truth_of(model)
    for is_reference_only in (False, True):
        effect = Effect(TARGETS[target], ACTIONS[action], is_inverted, is_reference_only)
        for clip_time in TIMES:
            assert_same(clip.decode(clip_time, effects_of(effect)), truth.at((effect,), clip_time))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("has_light", [False, True])
def test_stacks(seed: int, has_light: bool) -> None:
    model, rng = make_clip(has_light=has_light), np.random.default_rng(seed)
    clip, truth = edited(model), truth_of(model)
    targets, actions = list(TARGETS.values()), list(ACTIONS.values())
    effects = tuple(
        Effect(
            targets[rng.integers(len(targets))],
            actions[rng.integers(2, len(actions))] if rng.random() < 0.8 else Delete(),
            bool(rng.random() < 0.4),
            bool(rng.random() < 0.3),
        )
        for _ in range(4)
    )
    for clip_time in (0.0, 2.5 / 6, 4 / 6):
        assert_same(clip.decode(clip_time, effects_of(*effects)), truth.at(effects, clip_time))


def test_what_fades_between_frames_is_edited_alike() -> None:
    model = make_clip()
    clip, truth = edited(model), truth_of(model)
    for action in ACTIONS.values():
        effect = Effect(TARGETS["box"], action)
        found = clip.decode(2.5 / 6, effects_of(effect), alive_at=3 / 6)
        assert_same(found, truth.at((effect,), 2.5 / 6, 3 / 6))


@pytest.mark.parametrize("action", ACTIONS)
def test_an_empty_clip_stays_empty(action: str) -> None:
    found = edited(make_clip(is_empty=True)).decode(0.0, effects_of(Effect(Everything(), ACTIONS[action])))
    assert len(found.gaussians) == len(found.rows) == found.n_still == 0


def test_nothing_is_left_when_all_is_deleted_and_later_edits_do_no_harm() -> None:
    gone = Effect(Everything(), Delete())
    for action in ACTIONS.values():
        found = edited(make_clip()).decode(1 / 6, effects_of(gone, Effect(Everything(), action)))
        assert len(found.gaussians) == 0


def test_without_effects_a_clip_is_decoded_as_it_is() -> None:
    model = make_clip()
    for clip_time in TIMES:
        found, plain = edited(model).decode(clip_time), model.decode(clip_time)
        for mine, theirs in zip(found.gaussians.tensors(), plain.tensors(), strict=True):
            assert torch.equal(mine, theirs)
        assert_same(found, truth_of(model).at((), clip_time))
        assert found.n_still == model.n_constant_rows()


def test_what_stands_still_differs_in_nothing_but_its_colours() -> None:
    clip = edited(make_clip())
    for action in ACTIONS.values():
        effects = effects_of(Effect(TARGETS["sphere"], action), Effect(TARGETS["picked"], Delete()))
        first, second = clip.decode(0.0, effects), clip.decode(3.5 / 6, effects)
        assert first.n_still == second.n_still > 0
        for mine, theirs in zip(first.gaussians.tensors()[:4], second.gaussians.tensors()[:4], strict=True):
            assert torch.equal(mine[: first.n_still], theirs[: first.n_still])
        np.testing.assert_array_equal(first.rows.number[: first.n_still], second.rows.number[: first.n_still])
        assert {first.rows.sets[place].role for place in first.rows.set_index[: first.n_still]} == {"static"}


def test_numbers_count_hidden_anchors() -> None:
    found = edited(make_clip()).decode(0.0)
    static = [found.rows.sets[place].role == "static" for place in found.rows.set_index]
    anchors = {int(number) // K for number in found.rows.number[static]}
    assert anchors == set(range(12)) - {0, 4, 11}


@pytest.mark.parametrize("is_inverted", [False, True])
def test_picks_from_before_a_clip_was_trained_anew_do_nothing(is_inverted: bool) -> None:
    model = make_clip()
    picked = Picked((PickedRows(2, "as it was before", "residual", pack_rows(np.arange(18))),))
    found = edited(model).decode(0.0, effects_of(Effect(picked, Delete(), is_inverted)))
    assert len(found.gaussians) == len(model.decode(0.0))


def test_picks_of_another_clip_are_in_none_of_this_one() -> None:
    model = make_clip()
    picked = Picked((PickedRows(7, "clip 7", "residual", pack_rows(np.arange(18))),))
    assert len(edited(model).decode(0.0, effects_of(Effect(picked, Hide()))).gaussians) == len(model.decode(0.0))
    assert len(edited(model).decode(0.0, effects_of(Effect(picked, Hide(), is_inverted=True))).gaussians) == 0


def test_damaged_picks_are_a_typed_error() -> None:
    picked = Picked((PickedRows(2, OWN, "residual", b"nonsense"),))
    with pytest.raises(ProjectError, match="cannot be applied"):
        edited(make_clip()).decode(0.0, effects_of(Effect(picked, Hide())))


@pytest.mark.parametrize("action", ACTIONS)
def test_numbers_that_are_not_finite_do_not_spread(action: str) -> None:
    model = make_clip()
    with torch.no_grad():
        model.anchor_set("moving").positions[2] = torch.nan
        model.anchor_set("static").positions[5] = torch.inf
    found = edited(model).decode(1 / 6, effects_of(Effect(TARGETS["box"], ACTIONS[action], is_inverted=True)))
    bad = np.asarray(~np.isfinite(found.gaussians.means.numpy()).all(1))
    roles = [
        (found.rows.sets[place].role, number // K)
        for place, number in zip(found.rows.set_index, found.rows.number, strict=True)
    ]
    assert {name for name, is_bad in zip(roles, bad, strict=True) if is_bad} <= {("moving", 2), ("static", 7)}
    for tensor in found.gaussians.tensors():
        assert np.isfinite(tensor.numpy()[~bad]).all()


# ---------------------------------------------------------------- what holds when


def test_scopes_decide_what_holds_between_frames_too() -> None:
    one = Edit(1, "one", Everything(), Hide(), Scope(2, 5))
    two = Edit(2, "two", Everything(), Expose(1.0), Scope(4))
    off = Edit(3, "off", Everything(), Hide(), is_on=False)
    stack = EditStack((one, two, off))
    held = {frame: [type(effect.action) for effect in stack.at(frame).all] for frame in (0, 1.99, 2, 4, 4.5, 5, 900)}
    assert held == {0: [], 1.99: [], 2: [Hide], 4: [Hide, Expose], 4.5: [Hide, Expose], 5: [Expose], 900: [Expose]}
    assert stack.at(0) == NO_EFFECTS
    assert stack.at(2) is stack.at(3.5)


def test_names_and_numbers_of_edits_are_no_part_of_what_they_do() -> None:
    one, other = (Edit(number, str(number), Everything(), Hide(), Scope(number)) for number in (1, 2))
    assert EditStack((one,)).at(5) == EditStack((other,)).at(5)
    assert hash(EditStack((one,)).at(5)) == hash(EditStack((other,)).at(5))
    assert EditStack((one,)).at(5) != EditStack((one, other)).at(5)


@pytest.mark.parametrize("action", ["delete", "move", "recolor", "hold", "smooth"])
def test_a_keyed_volume_acts_where_it_is_at_each_moment(action: str) -> None:
    model = make_clip()
    clip, truth = edited(model), truth_of(model)
    keys = (
        VolumeKey(11.0, Box((0.2, 0.4, 0.5), (0.2, 0.5, 0.6), TURN)),
        VolumeKey(12.0, Box((0.6, 0.5, 0.4), (0.3, 0.4, 0.6))),
        VolumeKey(13.5, Box((0.8, 0.2, 0.5), (0.5, 0.3, 0.2), TURN)),
    )
    stack = EditStack((Edit(1, "", KeyedVolume(keys), ACTIONS[action]), Edit(2, "", TARGETS["sphere"], Expose(1.0))))
    found = set()
    for frame in (10.0, 11.0, 11.3, 11.9, 12.0, 12.75, 13.5, 14.0):
        effects, clip_time = stack.at(frame), (frame - CLIP.start) / CLIP.clip_length
        target = effects.all[0].target
        assert isinstance(target, Box)
        found.add(target)
        assert_same(clip.decode(clip_time, effects), truth.at(effects.all, clip_time))
    assert len(found) == 6, "it rests before its first key and after its last one, and moves in between"


def test_a_stack_with_a_keyed_volume_is_exact_between_frames_and_knows_when_nothing_moves() -> None:
    keys = tuple(VolumeKey(frame, Sphere((frame, 0.0, 0.0), 1.0)) for frame in (2.0, 6.0))
    edits = (Edit(1, "", KeyedVolume(keys), Delete(), Scope(1, 9)), Edit(2, "", Everything(), Expose(1.0), Scope(4, 5)))
    stack = EditStack(edits)
    assert [len(stack.at(frame).all) for frame in (0.9, 1.0, 4.0, 4.9, 5.0, 8.9, 9.0)] == [0, 1, 2, 2, 1, 1, 0]
    assert stack.at(3.25).all[0].target == Sphere((3.25, 0.0, 0.0), 1.0)
    assert stack.at(1.0) is stack.at(1.5) is stack.at(2.0)
    assert stack.at(6.0) == stack.at(8.0) != stack.at(5.5)
    off = EditStack((Edit(1, "", KeyedVolume(keys), Delete(), is_on=False), edits[1]))
    assert off.at(4.0) is off.at(4.5)
