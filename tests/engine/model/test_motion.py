"""Anchors that travel: where they are, what is decoded there, and what is kept of them."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from engine.backends.table import backend_called
from engine.clip_files.anchor_record import AnchorRecord, RecordError, StoredAnchors, read_records
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.model.clip_view import visible_rows
from engine.model.motion import AnchorMotion
from engine.training.plan.synthetic_clip import ClipRecipe, make_clip, make_view
from engine.training.step.visible_anchors import Sight

N = 5


def travelling(n: int = N, *, velocity: float = 1.0, n_frames: int = 4) -> AnchorSet:
    generator = torch.Generator().manual_seed(2)

    def random(*size: int) -> torch.Tensor:
        return torch.rand(*size, generator=generator)

    return AnchorSet.from_cloud(
        random(n, 3),
        random(n, 3),
        spacing=0.1,
        feature_dim=3,
        presence=torch.ones(n, n_frames, dtype=torch.bool),
        motion=AnchorMotion(torch.arange(n).float() % n_frames, velocity * random(n, 3), 0.1 * velocity * random(n, 3)),
    )


def test_anchors_are_at_their_positions_at_birth_and_on_a_parabola_before_and_after():
    anchors = travelling()
    motion = anchors.motion
    assert motion is not None
    for frame in (0.0, 1.5, 3.0):
        since = (frame - motion.birth_frames)[:, None]
        expected = anchors.positions + motion.velocities * since + motion.accelerations * since**2
        torch.testing.assert_close(anchors.positions_at(frame), expected)
    for row, birth in enumerate(motion.birth_frames.tolist()):
        assert torch.equal(anchors.positions_at(birth)[row], anchors.positions[row])


def test_a_subset_travels_on_and_a_set_that_stays_keeps_its_positions():
    anchors = travelling()
    some = anchors.subset(torch.tensor([True, False, True, False, False]))
    torch.testing.assert_close(some.positions_at(2.5), anchors.positions_at(2.5)[[0, 2]])
    assert {name for name, _ in some.named_parameters()} >= {"velocities", "accelerations"}
    anchors.stay()
    assert anchors.motion is None
    assert torch.equal(anchors.positions_at(2.5), anchors.positions)
    assert "velocities" not in dict(anchors.named_parameters())


def test_tensors_of_different_lengths_are_refused():
    anchors = travelling()
    short = AnchorMotion(torch.zeros(N), torch.zeros(N - 1, 3), torch.zeros(N, 3))
    with pytest.raises(ValueError, match="different numbers of rows"):
        AnchorSet(
            positions=anchors.positions,
            color_logits=anchors.color_logits,
            features=anchors.features,
            log_offset_scales=anchors.log_offset_scales,
            log_base_scales=anchors.log_base_scales,
            presence=anchors.presence,
            is_trainable=True,
            motion=short,
        )


def clip(*, velocity: float) -> ClipModel:
    """A source clip whose residual anchors travel along x."""
    model = make_clip(ClipRecipe(40, is_source=True, n_static=10), backend=backend_called("cpu"))
    anchors, field = model.anchor_set("residual"), model.field
    assert field is not None
    speed = torch.zeros(len(anchors), 3)
    speed[:, 0] = velocity
    moving = AnchorSet(
        positions=anchors.positions,
        color_logits=anchors.color_logits,
        features=anchors.features.detach(),
        log_offset_scales=anchors.log_offset_scales.detach(),
        log_base_scales=anchors.log_base_scales.detach(),
        presence=anchors.presence,
        is_trainable=True,
        motion=AnchorMotion(torch.full((len(anchors),), 2.0), speed, torch.zeros_like(speed)),
    )
    model.sets["residual"] = moving
    model.attach_field(field)
    return model


def test_gaussians_are_carried_along_and_change_in_nothing_else():
    still, moving = clip(velocity=0.0), clip(velocity=0.3)
    for frame in (2, 3, 6.5):
        one, other = still.decode(frame / 10), moving.decode(frame / 10)
        n_static = still.decoder.gaussians_per_anchor * 10
        shift = torch.zeros(len(one), 3)
        shift[n_static:, 0] = 0.3 * (frame - 2)
        torch.testing.assert_close(other.means, one.means + shift, rtol=1e-5, atol=1e-5)
        for name in ("quats", "scales", "opacities", "colors"):
            assert torch.equal(getattr(one, name), getattr(other, name))


def test_motion_learns_from_where_gaussians_should_be():
    model = clip(velocity=0.0)
    model.decode(0.5).means[:, 0].sum().backward()
    anchors, k = model.anchor_set("residual"), model.decoder.gaussians_per_anchor
    expected = torch.zeros(len(anchors), 3)
    expected[:, 0] = k * 3.0  # three frames from birth
    torch.testing.assert_close(anchors.velocities.grad, expected)
    torch.testing.assert_close(anchors.accelerations.grad, 3.0 * expected)
    model.zero_grad()
    model.decode(0.2).means.sum().backward()
    assert anchors.velocities.grad is not None
    assert not anchors.velocities.grad.any()


def test_cameras_look_where_anchors_are():
    model, view = clip(velocity=5.0), make_view(ClipRecipe(40))
    sight = Sight(model, [view], reach=0.1)
    for clip_time, is_there in ((0.2, True), (0.9, False)):  # 35 units to the right of the picture
        for rows in (sight.rows(0, clip_time), visible_rows(model, view, clip_time, reach=0.1)):
            assert bool(len(rows["residual"])) == is_there
        shown = model.anchors(clip_time)
        places = host_positions(model, clip_time)
        np.testing.assert_array_equal(shown.own_positions[-len(places) :], places)


def test_what_cameras_see_is_decided_when_a_phase_begins_also_where_it_is_taken_up_again():
    model, view = clip(velocity=0.0), make_view(ClipRecipe(40))
    sight, anchors = Sight(model, [view], reach=0.1), model.anchor_set("residual")
    rows = sight.rows(0, 0.9)["residual"]
    assert len(rows)
    with torch.no_grad():
        anchors.velocities.fill_(50.0)
    assert sight.rows(0, 0.9)["residual"] is rows
    assert torch.equal(Sight(model, [view], reach=0.1, reaches=sight.reaches).rows(0, 0.9)["residual"], rows)
    assert not len(Sight(model, [view], reach=0.1).rows(0, 0.9)["residual"])


def host_positions(model: ClipModel, clip_time: float) -> np.ndarray:
    return model.anchor_set("residual").positions_at(10 * clip_time).detach().numpy()


def stored(*, travels: bool) -> StoredAnchors:
    model = clip(velocity=0.2)
    if not travels:
        model.anchor_set("residual").stay()
    own = read_records(model.own_arrays())["residual"].own
    assert own is not None
    return own


def test_what_a_clip_keeps_of_motion_and_what_it_refuses():
    own = stored(travels=True)
    assert own.velocities is not None
    assert own.velocities[:, 0].tolist() == pytest.approx([0.2] * len(own))
    arrays = AnchorRecord(own=own).arrays("residual")
    assert {name.rpartition(".")[2] for name in arrays} >= {"birth_frames", "velocities", "accelerations"}
    del arrays["sets.residual.accelerations"]
    with pytest.raises(RecordError, match="have no accelerations"):
        read_records(arrays)
    assert stored(travels=False).velocities is None


def test_anchors_joined_travel_if_both_do():
    moving, still = stored(travels=True), stored(travels=False)
    both = moving.joined(moving)
    assert both.velocities is not None
    assert len(both.velocities) == 2 * len(moving)
    assert moving.joined(still).velocities is None
    assert still.joined(moving).velocities is None
