"""ClipModel: gate in time, inheritance, round trips. Small hand-made clips, no pictures."""

import numpy as np
import pytest
import torch
from msgspec import to_builtins

from engine.backends.table import backend_called
from engine.clip_files.clip_header import FieldShape
from engine.clip_files.clip_state import ClipState
from engine.clip_files.roles import ROLES
from engine.errors import ProjectError
from engine.gate.reasons import NO_REASON, STILL, USER_DYNAMIC
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel, decoder_shape
from engine.model.decoder import HEADS, Decoder
from engine.model.field import SpatioTemporalField
from engine.model.reading import inherit, load_clip_model
from tests.clip_headers import make_header, with_header

N_FRAMES = 4
K = 3


def make_anchors(n: int, *, seed: int, presence: torch.Tensor | None) -> AnchorSet:
    generator = torch.Generator().manual_seed(seed)
    anchors = AnchorSet.from_cloud(
        torch.rand(n, 3, generator=generator),
        torch.rand(n, 3, generator=generator),
        spacing=0.1,
        feature_dim=8,
        presence=presence,
    )
    with torch.no_grad():
        anchors.features.normal_(generator=generator)
    return anchors


def make_field(seed: int) -> SpatioTemporalField:
    shape = FieldShape(
        n_knots=N_FRAMES,
        cells=(4, 7),
        n_entries=512,
        channels=4,
        hidden=16,
        feature_dim=6,
        bounds_min=(0.0, 0.0, 0.0),
        side=1.0,
    )
    return SpatioTemporalField(shape, torch.Generator().manual_seed(seed))


def make_reference() -> ClipModel:
    presence = torch.zeros(10, N_FRAMES, dtype=torch.bool)
    presence[:6, 0] = True
    presence[4:, 1] = True
    sets = {"static": make_anchors(20, seed=0, presence=None), "moving": make_anchors(10, seed=1, presence=presence)}
    decoder = Decoder(
        static_dim=8, dynamic_dim=6, gaussians_per_anchor=K, hidden=16, generator=torch.Generator().manual_seed(2)
    )
    return ClipModel(
        sets=sets,
        decoder=decoder,
        field=make_field(3),
        clip_length=N_FRAMES,
        n_frames=N_FRAMES,
        backend=backend_called("cpu"),
    )


def state_of(model: ClipModel, *, role: str, clip_index: int = 0, reference: ClipState | None = None) -> ClipState:
    assert model.field is not None
    header = make_header(
        role=role,
        clip_index=clip_index,
        step=1,
        n_steps=1,
        clip_length=N_FRAMES,
        n_frames=N_FRAMES,
        decoder=to_builtins(decoder_shape(model.decoder)),
        field=to_builtins(model.field.shape),
        reference_fingerprint=None if reference is None else reference.header.fingerprint,
    )
    return ClipState(model.own_arrays(), header).stamped()


def make_source(reference: ClipState) -> ClipModel:
    inherited = torch.ones(10, N_FRAMES, dtype=torch.bool)
    sets, decoder, still_decoder = inherit(reference, {"moving": inherited})
    sets["residual"] = make_anchors(5, seed=7, presence=torch.ones(5, N_FRAMES, dtype=torch.bool))
    return ClipModel(
        sets=sets,
        decoder=decoder,
        field=make_field(8),
        clip_length=N_FRAMES,
        n_frames=N_FRAMES,
        backend=backend_called("cpu"),
        still_decoder=still_decoder,
    )


def test_only_anchors_that_exist_are_decoded():
    model = make_reference()
    assert len(model.decode(0.0)) == (20 + 6) * K
    assert len(model.decode(2 / N_FRAMES)) == 20 * K
    # half way between frames 0 and 1 both frames' anchors are there
    assert len(model.decode(0.5 / N_FRAMES)) == (20 + 10) * K


def test_decoded_values_are_activated_and_finite():
    gaussians = make_reference().decode(0.0)
    assert all(torch.isfinite(tensor).all() for tensor in gaussians.tensors())
    assert (gaussians.scales > 0).all()
    for values in (gaussians.opacities, gaussians.colors):
        assert ((values >= 0) & (values <= 1)).all()


def test_a_fresh_field_leaves_the_static_look_almost_unchanged():
    model = make_reference()
    rows = model.alive("moving", 0.0)
    assert model.field is not None
    dynamic = model.field(rows, model.field.corners(model.anchor_set("moving").positions), [(0, 1.0)])
    # tables start within 1e-3 and two layers of weights below 1 follow
    assert dynamic.abs().max() < 1e-2


def test_times_between_frames_interpolate_the_field():
    model = make_reference()
    assert model.knots(0.25) == [(1, 1.0)]
    (lower, a), (upper, b) = model.knots(1.25 / N_FRAMES)
    assert (lower, upper) == (1, 2)
    assert a == pytest.approx(0.75)
    assert b == pytest.approx(0.25)
    assert model.knots(0.999) == [(3, 1.0)]  # beyond the last frame its knot holds


def test_reference_round_trip_gives_the_same_gaussians():
    model = make_reference()
    again = load_clip_model(state_of(model, role="reference"), None, backend=backend_called("cpu"))
    for ours, theirs in zip(model.decode(0.25).tensors(), again.decode(0.25).tensors(), strict=True):
        assert torch.equal(ours, theirs)


def test_source_clip_freezes_everything_it_inherits_and_stores_only_its_own():
    reference = state_of(make_reference(), role="reference")
    source = make_source(reference)
    trainable = {name for name, parameter in source.named_parameters() if parameter.requires_grad}
    assert trainable
    assert all(name.startswith(("sets.residual.", "field.")) for name in trainable)
    assert not any(name.startswith(("decoder.", "sets.static", "sets.moving")) for name in source.own_arrays())
    again = load_clip_model(
        state_of(source, role="source", clip_index=1, reference=reference), reference, backend=backend_called("cpu")
    )
    for ours, theirs in zip(source.decode(0.5).tensors(), again.decode(0.5).tensors(), strict=True):
        assert torch.equal(ours, theirs)


def test_constant_sets_are_decoded_once_and_equal_the_plain_decode():
    reference = state_of(make_reference(), role="reference")
    source = make_source(reference)
    assert source.is_constant("static")
    assert not source.is_constant("moving")
    rows = {"static": torch.tensor([3, 1]), "moving": torch.zeros(0, dtype=torch.int64)}
    rows["residual"] = rows["moving"]
    cached = source.decode(0.0, rows)
    viewed = load_clip_model(reference, None, backend=backend_called("cpu"))
    assert viewed.is_constant("static")  # nothing learns in a clip that is only viewed
    learning = load_clip_model(reference, None, is_learning=True, backend=backend_called("cpu"))
    assert not learning.is_constant("static")
    plain = learning.decode(0.0, {"static": rows["static"], "moving": rows["moving"]})
    assert torch.allclose(cached.means, plain.means, atol=1e-6)  # the same sums in another order


def with_own_heads(model: ClipModel, change: float) -> ClipModel:
    """The same, after the heads of what moves have learned something."""
    model.freeze_still_parts(learns_heads=True)
    with torch.no_grad():
        for parameter in model.decoder.parameters():
            parameter.add_(change)
    return model


def test_heads_of_what_moves_learn_apart_and_leave_still_parts_to_the_bit():
    model = make_reference()
    before = model.static_gaussians("static")
    moving = model.decode(0.0)[20 * K :]
    with_own_heads(model, 0.1)
    after = model.decode(0.0)
    assert model.is_constant("static")
    for ours, theirs in zip(before.tensors(), after[: 20 * K].tensors(), strict=True):
        assert torch.equal(ours, theirs)
    assert (moving.colors - after[20 * K :].colors).abs().max() > 0.01
    learning = {name.split(".")[0] for name, parameter in model.named_parameters() if parameter.requires_grad}
    assert learning == {"sets", "decoder", "field"}
    assert not any(parameter.requires_grad for parameter in model.anchor_set("static").parameters())


@pytest.mark.parametrize("is_learning", [False, True])
def test_both_sets_of_heads_come_back_from_a_file_and_reach_later_clips(is_learning):
    model = with_own_heads(make_reference(), 0.1)
    state = state_of(model, role="reference")
    again = load_clip_model(state, None, backend=backend_called("cpu"), is_learning=is_learning)
    assert again.own_arrays().keys() == model.own_arrays().keys()
    source = with_own_heads(make_source(state), -0.2)
    assert not any(name.startswith("decoder.") for name in source.own_arrays())
    stored = state_of(source, role="source", clip_index=1, reference=state)
    read = load_clip_model(stored, state, backend=backend_called("cpu"), is_learning=is_learning)
    assert read.own_arrays().keys() == source.own_arrays().keys()
    for ours, theirs in ((model, again), (source, read)):
        for mine, other in zip(ours.decode(0.25).tensors(), theirs.decode(0.25).tensors(), strict=True):
            assert torch.equal(mine, other)
    for mine, other in zip(model.decode(0.25)[: 20 * K].tensors(), read.decode(0.25)[: 20 * K].tensors(), strict=True):
        assert torch.equal(mine, other)  # still parts are those of the reference clip


def test_united_heads_are_those_of_still_parts_and_stored_with_the_clip():
    state = state_of(with_own_heads(make_reference(), 0.1), role="reference")
    source = make_source(state)
    assert not any("decoder." in name for name in source.own_arrays())  # both are inherited
    source.unite_heads()
    stored = state_of(source, role="source", clip_index=1, reference=state)
    assert any(name.startswith("decoder.") for name in stored.arrays)
    assert not any(name.startswith("moving_decoder.") for name in stored.arrays)
    read = load_clip_model(stored, state, backend=backend_called("cpu"))
    for mine, other in zip(source.decode(0.25).tensors(), read.decode(0.25).tensors(), strict=True):
        assert torch.equal(mine, other)


def test_a_source_clip_refuses_a_missing_or_another_reference():
    reference = state_of(make_reference(), role="reference")
    state = state_of(make_source(reference), role="source", clip_index=1, reference=reference)
    with pytest.raises(ProjectError, match="missing reference"):
        load_clip_model(state, None, backend=backend_called("cpu"))
    other = with_header(reference, fingerprint="0" * 16)
    with pytest.raises(ProjectError, match="0000"):
        load_clip_model(state, other, backend=backend_called("cpu"))


@pytest.mark.parametrize("name", ["sets.static.features", "decoder.first.color", "field.hidden.weight"])
@pytest.mark.parametrize("damage", ["missing", "wrong shape"])
def test_incomplete_states_are_named_and_not_a_fault_of_the_program(name, damage):
    state = state_of(make_reference(), role="reference")
    arrays = dict(state.arrays)
    if damage == "missing":
        del arrays[name]
    else:
        arrays[name] = arrays[name][:1, :1].copy()
    with pytest.raises(ProjectError, match="clip 0 is incomplete"):
        load_clip_model(ClipState(arrays, state.header), None, backend=backend_called("cpu")).decode(0.0)


def test_anchor_view_separates_inherited_from_own():
    reference = state_of(make_reference(), role="reference")
    source = make_source(reference)
    view = source.anchors()
    assert view.inherited_positions.shape == (30, 3)
    assert view.own_positions.shape == (5, 3)
    assert np.bincount(view.inherited_roles).tolist() == [20, 10]
    assert (view.own_roles == ROLES.index("residual")).all()
    assert (view.own_reasons == NO_REASON).all()
    assert not view.has_changing_static
    source.anchor_set("static").presence = torch.ones(20, N_FRAMES, dtype=torch.bool)  # as with gate=off
    assert source.anchors().has_changing_static


def test_anchors_say_what_the_gate_said_of_them():
    reference = state_of(make_reference(), role="reference")
    source = make_source(reference)
    is_hidden = torch.zeros(20, dtype=torch.bool)
    is_hidden[[2, 5]] = True
    taken = source.take_out("static", is_hidden)
    presence = torch.ones(2, N_FRAMES, dtype=torch.bool)
    source.add_set("replacing", taken.subset(torch.ones(2, dtype=torch.bool), presence=presence, is_trainable=True))
    source.attach_field(make_field(8))
    state = state_of(source, role="source", reference=reference)
    reasons = np.full(20, STILL, np.uint8)
    reasons[[2, 5]] = USER_DYNAMIC
    loaded = load_clip_model(
        ClipState(state.arrays | {"gate.static": reasons}, state.header), reference, backend=backend_called("cpu")
    )
    view = loaded.anchors()
    assert (view.own_reasons[view.own_roles == ROLES.index("replacing")] == USER_DYNAMIC).all()
    assert (view.inherited_reasons[view.inherited_roles == ROLES.index("static")] == STILL).all()
    assert (view.inherited_roles == ROLES.index("static")).sum() == 18
    whole = load_clip_model(reference, None, backend=backend_called("cpu")).constant_gaussians("static")
    kept = np.repeat(~is_hidden.numpy(), K)
    for ours, theirs in zip(loaded.constant_gaussians("static").tensors(), whole.tensors(), strict=True):
        assert torch.equal(ours, theirs[torch.from_numpy(kept)])


def test_every_head_changes_the_output():
    model = make_reference()
    before = [tensor.clone() for tensor in model.decode(0.0).detach().tensors()]
    for head in HEADS:
        with torch.no_grad():
            model.decoder.second_bias[head] += 0.3
        after = model.decode(0.0).detach().tensors()
        assert any(not torch.equal(a, b) for a, b in zip(before, after, strict=True)), head
        before = [tensor.clone() for tensor in after]
    assert np.isfinite(before[0].numpy()).all()


def test_light_changes_static_colours_from_the_start_to_the_end_and_nothing_else():
    reference = state_of(make_reference(), role="reference")
    source = make_source(reference)
    plain = {clip_time: source.decode(clip_time) for clip_time in (0.0, 0.5)}
    source.light = torch.zeros(20, 2)
    source.light[:8, 0], source.light[:8, 1] = 0.2, -0.4
    n_lit, n_static = 8 * K, 20 * K
    for clip_time, factor in ((0.0, np.exp(0.2)), (0.5, (np.exp(0.2) + np.exp(-0.4)) / 2)):
        lit = source.decode(clip_time)
        torch.testing.assert_close(lit.colors[:n_lit], plain[clip_time].colors[:n_lit] * float(factor))
        assert torch.equal(lit.colors[n_lit:n_static], plain[clip_time].colors[n_lit:n_static])  # to the bit
        assert torch.equal(lit.colors[n_static:], plain[clip_time].colors[n_static:])
        assert torch.equal(lit.means, plain[clip_time].means)
    assert source.has_light
    assert not make_reference().has_light  # its static anchors learn


def test_light_is_stored_and_comes_back():
    reference = state_of(make_reference(), role="reference")
    source = make_source(reference)
    source.light = torch.linspace(-0.3, 0.3, 40).reshape(20, 2)
    state = state_of(source, role="source", clip_index=1, reference=reference)
    loaded = load_clip_model(state, reference, backend=backend_called("cpu"))
    assert loaded.light is not None
    assert torch.equal(loaded.light, source.light)
    with torch.no_grad():
        assert torch.equal(loaded.decode(0.5).colors, source.decode(0.5).colors)


@pytest.mark.parametrize(
    "light",
    [
        np.zeros((19, 2), np.float32),
        np.zeros((20, 3), np.float32),
        np.full((20, 2), np.nan, np.float32),
        np.zeros((20, 2)),
    ],
    ids=["rows", "columns", "not finite", "float64"],
)
def test_light_that_does_not_fit_is_a_damaged_clip(light):
    reference = state_of(make_reference(), role="reference")
    state = state_of(make_source(reference), role="source", clip_index=1, reference=reference)
    damaged = ClipState(state.arrays | {"inherited.static.light": light}, state.header)
    with pytest.raises(ProjectError, match="light"):
        load_clip_model(damaged, reference, backend=backend_called("cpu"))
