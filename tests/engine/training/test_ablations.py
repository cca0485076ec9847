"""With all that is inherited frozen, a switch changes only what it names: what learns, what stays, what is stored."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from engine.backends.table import backend_called
from engine.capture.clip import split_clips
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from engine.errors import ProjectError
from engine.model.reading import load_clip_model
from engine.training.clip_training import ClipTraining
from engine.training.config import TrainConfig
from engine.training.optimizer.optimizer import named_parameters
from engine.training.variants.variant_method import merged
from tests.clip_headers import with_header
from tests.engine.training.tiny_training import Tiny, finish, live_picture, picture, same_arrays, take_steps

pytestmark = pytest.mark.slow

SWITCHES: dict[str, dict[str, str]] = {
    "full": {},
    "heads": {"decoder": "moving"},
    "finetune": {"decoder": "finetune"},
    "new": {"decoder": "new"},
    "none": {"residual": "none"},
    "all_points": {"residual": "full"},
    "trainable": {"inherit": "trainable"},
    "moving": {"inherit": "moving", "motion": "stay"},
    "travel": {"inherit": "moving"},
    "off": {"inherit": "off"},
    "both": {"inherit": "trainable", "residual": "full"},
    "continue": {"field": "continue"},
    "schedule": {"schedule": "inherited"},
    "per_frame": {"field_tables": "per_frame"},
}
LEARNS: dict[str, set[str]] = {
    "full": {"residual", "field"},
    "heads": {"residual", "field", "decoder"},
    "finetune": {"residual", "field", "decoder"},
    "new": {"residual", "field", "decoder"},
    "none": {"field"},
    "all_points": {"residual", "field"},
    "trainable": {"static", "moving", "residual", "field"},
    "moving": {"adapted", "residual", "field"},
    "travel": {"residual", "field"},
    "off": {"static", "residual", "field"},
    "both": {"static", "moving", "residual", "field"},
    "continue": {"residual", "field"},
    "schedule": {"residual", "field"},
    "per_frame": {"residual", "field"},
}
"""What a source clip learns, and so what it stores, with each switch."""
STORES = LEARNS | {
    "heads": {"residual", "field", "moving_decoder"},
    **{name: LEARNS[name] | {"decoder"} for name in ("trainable", "off", "both")},
}
"""Where what moves in the reference clip has heads of its own, clips that learn still parts store those of these."""


def arguments_of(tiny: Tiny, name: str) -> dict:
    return (
        {"inherit": "frozen", "decoder": "frozen"}
        | SWITCHES[name]
        | ({"previous": tiny.reference} if name == "continue" else {})
    )


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory) -> Path:
    """Folder of a checkpoint of clip 1 with each switch, from halfway; see source_trainings."""
    return tmp_path_factory.mktemp("checkpoints")


@pytest.fixture(scope="module")
def source_trainings(tiny, checkpoints) -> dict[str, ClipTraining]:
    """Clip 1 with each switch, at its end."""
    trainings = {name: take_steps(tiny.prepared(1, **arguments_of(tiny, name)), 3) for name in SWITCHES}
    for name, training in trainings.items():
        training.write_checkpoint(checkpoints / f"{name}.safetensors")
        finish(training)
    return trainings


@pytest.fixture(scope="module")
def source_clips(source_trainings) -> dict[str, ClipState]:
    """What these leave."""
    return {name: training.state() for name, training in source_trainings.items()}


def learned_parts(names) -> set[str]:
    return {name.split(".")[1] if name.startswith("sets.") else name.split(".")[0] for name in names}


@pytest.mark.parametrize("name", SWITCHES)
def test_a_switch_trains_and_changes_only_what_it_names(tiny, name):
    training = tiny.prepared(1, **arguments_of(tiny, name))
    chosen = named_parameters(training.model, training.gains, training.config)
    assert learned_parts(chosen) == LEARNS[name]
    is_learning = {id(parameter) for parameter, _ in chosen.values()}
    before = {key: value.clone() for key, value in training.model.state_dict().items()}
    gains = training.gains.detach().clone()
    take_steps(training, 4)
    frozen = {k for k, v in training.model.named_parameters() if id(v) not in is_learning}
    for key, value in training.model.state_dict().items():
        if key in frozen or key.endswith(("positions", "color_logits", "presence")):
            assert torch.equal(value, before[key]), key
    changed = {k for k, v in training.model.named_parameters() if not torch.equal(v, before[k])}
    assert learned_parts(changed) == LEARNS[name]  # and all of it moves
    assert torch.equal(training.gains, gains)
    assert all(parameter.grad is None for key, parameter in training.model.named_parameters() if key in frozen)


@pytest.mark.parametrize("name", SWITCHES)
def test_a_clip_stores_what_it_learned_and_nothing_it_inherits(source_clips, name):
    arrays = source_clips[name].arrays
    assert learned_parts(key for key in arrays if not key.startswith("inherited.")) == STORES[name]
    inherited = {key for key in arrays if key.startswith("inherited.")}
    if name != "off":  # static anchors in the light of the clip
        inherited.discard("inherited.static.light")
    is_kept = not {"moving", "adapted"} & LEARNS[name] and name not in ("off", "travel")
    assert inherited == ({"inherited.moving.presence"} if is_kept else set())


def test_no_switch_reaches_into_the_reference(tiny, source_clips):
    assert tiny.reference.header.fingerprint == tiny.reference.fingerprint  # of the arrays as they are now
    assert {state.header.reference_fingerprint for state in source_clips.values()} == {tiny.reference.fingerprint}


def test_every_switch_gives_a_clip_of_its_own(source_clips):
    assert len({state.fingerprint for state in source_clips.values()}) == len(SWITCHES)


@pytest.mark.parametrize("name", SWITCHES)
def test_a_checkpoint_goes_on_exactly(tiny, source_clips, checkpoints, name):
    resumed = tiny.training(1, **arguments_of(tiny, name))
    resumed.restore_checkpoint(checkpoints / f"{name}.safetensors")
    assert resumed.steps_done == 3
    chosen = named_parameters(resumed.model, resumed.gains, resumed.config)
    assert learned_parts(chosen) == LEARNS[name]
    assert finish(resumed).fingerprint == source_clips[name].fingerprint


# ---------------------------------------------------------------- decoder


def decoder_of(state: ClipState) -> dict[str, np.ndarray]:
    return {name: array for name, array in state.arrays.items() if name.startswith("decoder.")}


def test_a_finetuned_decoder_starts_as_the_reference_has_it_and_a_new_one_does_not(tiny):
    finetuned, new, full = (tiny.prepared(1, decoder=choice) for choice in ("finetune", "new", "frozen"))
    inherited = decoder_of(tiny.reference)
    assert same_arrays(decoder_of(finetuned.state()), inherited)
    started = decoder_of(new.state())
    assert started.keys() == inherited.keys()
    assert not any(np.array_equal(started[name], inherited[name]) for name in inherited)
    # but for the heads of what moves, which are frozen apart
    assert finetuned.held_out_psnr() == pytest.approx(full.held_out_psnr(), abs=0.02)
    assert new.held_out_psnr() != finetuned.held_out_psnr()


@pytest.mark.parametrize("has_backgrounds", [True, False])
@pytest.mark.parametrize("choice", ["finetune", "new"])
def test_another_decoder_leaves_anchors_and_field_as_they_start(tiny, tmp_path, choice, has_backgrounds):
    prep_dir = tiny.prep_dir if has_backgrounds else tmp_path
    full, other = (tiny.prepared(1, decoder=value, prep_dir=prep_dir).state() for value in ("frozen", choice))
    without = {name: array for name, array in other.arrays.items() if not name.startswith("decoder.")}
    assert same_arrays(full.arrays, without)


# ---------------------------------------------------------------- residual and inherited anchors


def n_residual(state: ClipState) -> int:
    return len(state.arrays.get("sets.residual.positions", ()))


def test_residual_anchors_are_none_the_uncovered_or_all(source_clips):
    none, dedup, full = (n_residual(source_clips[name]) for name in ("none", "full", "all_points"))
    assert 0 == none < dedup < full
    # nothing is inherited there, so everything is uncovered; no light is measured either, which changes some masks
    assert n_residual(source_clips["off"]) == pytest.approx(full, rel=0.15)
    kept = {tuple(row) for row in source_clips["full"].arrays["sets.residual.positions"]}
    assert kept < {tuple(row) for row in source_clips["all_points"].arrays["sets.residual.positions"]}
    presence = [source_clips[name].arrays["inherited.moving.presence"] for name in ("none", "full", "all_points")]
    assert np.array_equal(presence[0], presence[1])
    assert np.array_equal(presence[1], presence[2])


def test_inherited_anchors_that_learn_start_as_the_reference_has_them(tiny, source_clips):
    started = tiny.prepared(1, inherit="trainable").state().arrays
    for role in ("static", "moving"):
        for name in ("positions", "color_logits", "features", "log_base_scales", "log_offset_scales"):
            key = f"sets.{role}.{name}"
            assert np.array_equal(started[key], tiny.reference.arrays[key]), key
    learned = source_clips["trainable"].arrays
    assert not np.array_equal(learned["sets.static.features"], tiny.reference.arrays["sets.static.features"])


def test_moving_anchors_that_learn_on_are_those_that_the_clip_uses(tiny, source_clips):
    """The static part stays as it is; the others begin as the reference has them, in the frames they are used in."""
    presence = source_clips["full"].arrays["inherited.moving.presence"]
    is_used = presence.any(1)
    assert 0 < is_used.sum() < len(is_used)
    model = tiny.prepared(1, inherit="moving", motion="stay").model
    assert model.roles() == ["static", "residual", "adapted"]
    adapted = model.anchor_set("adapted")
    for name in ("positions", "color_logits", "features", "log_base_scales", "log_offset_scales"):
        value = getattr(adapted, name).detach().numpy()
        assert np.array_equal(value, tiny.reference.arrays[f"sets.moving.{name}"][is_used]), name
    assert np.array_equal(adapted.presence.numpy(), presence[is_used])
    learned = source_clips["moving"].arrays
    assert np.array_equal(learned["sets.adapted.positions"], adapted.positions.numpy())
    assert not np.array_equal(learned["sets.adapted.features"], adapted.features.detach().numpy())
    shown = load_clip_model(source_clips["moving"], tiny.reference, backend=backend_called("cpu"))
    assert shown.roles() == ["static", "residual", "adapted"]
    assert np.array_equal(
        shown.anchors().inherited_positions, tiny.reference.arrays["sets.static.positions"]
    )  # no moving anchor occurs twice


@pytest.mark.parametrize("gate", ["off", "static"])
def test_without_a_gate_in_time_all_moving_anchors_learn_on(tiny, gate):
    model = tiny.prepared(1, inherit="moving", gate=gate).model
    adapted = model.anchor_set("adapted")
    assert len(adapted) == len(tiny.reference.arrays["sets.moving.positions"])
    assert adapted.presence.all()


def test_without_inheritance_no_anchor_of_the_reference_is_shown(tiny, source_clips):
    model = load_clip_model(source_clips["off"], tiny.reference, backend=backend_called("cpu"))
    assert model.roles() == ["static", "residual"]
    assert len(model.anchors().inherited_positions) == 0
    inherited = tiny.reference.arrays["sets.static.positions"]
    assert model.anchor_set("static").positions.shape != inherited.shape or not np.array_equal(
        model.anchor_set("static").positions.numpy(), inherited
    )


# ---------------------------------------------------------------- field


def test_a_continued_field_starts_as_the_clip_before_left_it(tiny, source_clips):
    training = tiny.prepared(2, field="continue", previous=source_clips["continue"])
    assert training.model.field is not None
    assert training.model.field.shape == source_clips["continue"].header.field
    started, left = ({k: v for k, v in s.arrays.items() if k.startswith("field.")} for s in (
        training.state(), source_clips["continue"]))  # fmt: skip
    assert same_arrays(started, left)
    assert not same_arrays(left, {k: v for k, v in tiny.reference.arrays.items() if k.startswith("field.")})


def test_a_field_per_clip_starts_new(tiny, source_clips):
    started = tiny.prepared(1, previous=tiny.reference).state().arrays  # the clip before does not matter
    assert same_arrays(started, tiny.prepared(1).state().arrays)
    assert not np.array_equal(started["field.hidden.weight"], tiny.reference.arrays["field.hidden.weight"])


def test_a_field_cannot_go_on_in_a_longer_clip(tiny, streamed):
    frame = streamed[0]
    assert frame.header.field.n_knots == 1
    training = tiny.training(1, field="continue", reference=frame, previous=frame)
    with pytest.raises(ProjectError, match="clip 0 has 1 frames, clip 1 has 4") as caught:
        training.prepare()
    assert "field=per_clip" in caught.value.hint


@pytest.mark.parametrize(("tables", "n_tables"), [("shared", 1), ("per_frame", 4)])
def test_a_table_for_all_frames_or_one_for_each(tiny, tables, n_tables):
    state = tiny.prepared(1, field_tables=tables).state()
    assert sum(name.startswith("field.tables.") for name in state.arrays) == n_tables
    assert state.header.field.is_shared == (tables == "shared")


def first_move(training: ClipTraining) -> float:
    """How far the first step moves the parameter that it moves farthest: about the highest rate."""
    before = {name: parameter.detach().clone() for name, parameter in training.model.named_parameters()}
    take_steps(training, 1)
    return max(float((p.detach() - before[name]).abs().max()) for name, p in training.model.named_parameters())


def test_a_source_clip_can_stay_at_the_rates_that_the_reference_clip_ended_with(tiny, tmp_path):
    anew, inherited = (first_move(tiny.prepared(1, schedule=name)) for name in ("per_clip", "inherited"))
    assert inherited == pytest.approx(TrainConfig().final_lr_ratio * anew, rel=1e-3)
    reference = tiny.prepared(0, is_source=False, schedule="inherited", prep_dir=tmp_path)
    assert reference.method.inherits_schedule
    assert first_move(reference) == first_move(tiny.prepared(0, is_source=False, prep_dir=tmp_path))


# ---------------------------------------------------------------- clips on their own


def test_an_independent_clip_is_a_reference_clip_and_loads_without_another(tiny, tmp_path):
    state = tiny.trained(0, is_source=False, independent=True, prep_dir=tmp_path)
    assert state.is_reference
    assert state.header.reference_fingerprint is None
    assert same_arrays(state.arrays, tiny.reference.arrays)
    other = with_header(tiny.reference, fingerprint="another")
    assert np.array_equal(picture(tiny, state, None), picture(tiny, state, other))  # it is not looked at


def test_independent_clips_share_neither_a_start_nor_a_background(tiny, tmp_path):
    first, second = (
        tiny.prepared(i, is_source=False, independent=True, backgrounds="clip", prep_dir=tmp_path) for i in (0, 1)
    )
    assert first.seed != second.seed
    assert not torch.equal(first.model.decoder.first["color"], second.model.decoder.first["color"])
    assert not np.array_equal(first.backgrounds.images, second.backgrounds.images)
    again = tiny.prepared(1, is_source=False, independent=True, backgrounds="clip", prep_dir=tmp_path)
    assert torch.equal(again.model.decoder.first["color"], second.model.decoder.first["color"])


@pytest.fixture(scope="module")
def streamed(tiny, tmp_path_factory) -> list[ClipState]:
    """The first three frames, each trained from where the one before ended."""
    prep_dir = tmp_path_factory.mktemp("stream")
    clips = split_clips(tiny.capture.n_frames, 1)
    settings = {"independent": True, "start": "previous", "is_source": False, "prep_dir": prep_dir}
    states: list[ClipState] = []
    for i in range(3):
        states.append(tiny.trained(i, clip=clips[i], previous=states[-1] if states else None, **settings))
    return states


def test_streaming_goes_on_from_everything_the_frame_before_learned(tiny, streamed, tmp_path):
    clips = split_clips(tiny.capture.n_frames, 1)
    settings = {"independent": True, "start": "previous", "is_source": False, "clip": clips[2]}
    training = tiny.prepared(2, previous=streamed[1], prep_dir=tmp_path, **settings)
    started, before = training.state().arrays, merged(streamed[1]).arrays
    for name, array in started.items():
        if not name.startswith("sets.residual.") and not name.endswith("presence"):
            assert np.array_equal(array, before[name]), name
    assert training.phases == [("source", 6)]
    take_steps(training, 3).write_checkpoint(tmp_path / "kept.safetensors")
    chosen = named_parameters(training.model, training.gains, training.config)
    assert learned_parts(chosen) >= {"static", "moving", "field", "decoder"}
    resumed = tiny.training(2, previous=streamed[1], prep_dir=tmp_path, **settings)
    resumed.restore_checkpoint(tmp_path / "kept.safetensors")
    assert finish(resumed).fingerprint == finish(training).fingerprint


def test_a_streamed_frame_needs_no_other_to_be_shown(streamed):
    for state in streamed:
        assert state.is_reference
        assert state.header.config["start"] == "previous"  # as the project says, not as it is carried out
        assert load_clip_model(state, None, backend=backend_called("cpu")).n_frames == 1


def test_merging_makes_residual_anchors_moving_ones(streamed):
    state = streamed[1]
    n_moving, n_new = (len(state.arrays[f"sets.{role}.positions"]) for role in ("moving", "residual"))
    assert n_new > 0
    after = merged(state)
    assert not any(name.startswith("sets.residual.") for name in after.arrays)
    for name in ("positions", "features", "presence"):
        first, second = (state.arrays[f"sets.{role}.{name}"] for role in ("moving", "residual"))
        assert np.array_equal(after.arrays[f"sets.moving.{name}"], np.concatenate([first, second]))
    assert len(after.arrays["sets.moving.positions"]) == n_moving + n_new
    assert "sets.residual.positions" in state.arrays  # the state itself is left alone


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"independent": True, "field": "continue"}, "cannot continue"),
        ({"independent": True, "decoder": "new", "inherit": "off"}, "decoder=new, inherit=off would have no effect"),
        ({"independent": True, "residual": "full"}, "residual=full would have no effect"),
        ({"independent": True, "schedule": "inherited"}, "schedule=inherited would have no effect"),
        ({"inherit": "off", "residual": "none"}, "with nothing that moves"),
        ({"start": "previous"}, "needs independent=true"),
        ({"decoder": "fresh"}, "'frozen', 'finetune' or 'new'"),
        ({"passes": -1.0}, "passes is -1.0"),
    ],
)
def test_wrong_combinations_and_values_are_named(settings, expected):
    with pytest.raises(ProjectError, match=expected):
        TrainConfig(**settings)


# ---------------------------------------------------------------- which clips


def test_any_clip_can_be_the_reference(tiny, tmp_path):
    reference = tiny.trained(1, is_source=False, prep_dir=tmp_path)
    states: dict[int, ClipState] = {}
    for order in ((0, 2), (2, 0)):
        for i in order:
            state = tiny.trained(i, reference=reference, prep_dir=tmp_path)
            assert state.header.reference_fingerprint == reference.fingerprint
            assert states.setdefault(i, state).fingerprint == state.fingerprint  # the star holds: order is nothing
            assert np.isfinite(picture(tiny, state, reference)).all()
    with pytest.raises(ProjectError, match="was trained on reference"):
        load_clip_model(states[0], tiny.reference, backend=backend_called("cpu"))


@pytest.mark.parametrize("name", ["full", "trainable", "off", "continue"])
def test_a_partial_last_clip_has_the_times_of_its_frames(tiny, name):
    clip = tiny.clips[7]
    assert (clip.n_frames, clip.clip_length) == (2, 4)
    state = tiny.trained(7, **arguments_of(tiny, name))
    presence = state.arrays.get("sets.residual.presence", state.arrays.get("inherited.moving.presence"))
    assert presence.shape[1] == 2
    model = load_clip_model(state, tiny.reference, backend=backend_called("cpu"))
    assert model.knots(clip.clip_time(29)) == [(1, 1.0)]
    pictures = [picture(tiny, state, tiny.reference, frame=frame) for frame in (0, 1)]
    assert all(np.isfinite(image).all() for image in pictures)


def test_switches_need_no_gate(tiny, tmp_path):
    ungated = tiny.trained(0, is_source=False, gate="off", prep_dir=tmp_path)
    for settings in ({}, {"inherit": "off", "decoder": "new"}):
        state = tiny.trained(1, reference=ungated, gate="off", prep_dir=tmp_path, source_steps=2, **settings)
        model = load_clip_model(state, ungated, backend=backend_called("cpu"))
        n_anchors = sum(len(model.anchor_set(role)) for role in model.roles())
        assert len(model.decode(0.25)) == n_anchors * 5
        assert np.isfinite(picture(tiny, state, ungated)).all()


@pytest.mark.parametrize("name", SWITCHES)
def test_a_clip_saved_with_a_switch_shows_the_pixels_it_was_trained_to(tiny, source_trainings, tmp_path, name):
    training = source_trainings[name]
    write_clip_state(tmp_path / "clip.safetensors", training.state())
    again = read_clip_state(tmp_path / "clip.safetensors")
    assert np.array_equal(picture(tiny, again, tiny.reference), live_picture(tiny, training))
