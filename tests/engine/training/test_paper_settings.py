"""Settings of the published method: each does what it says, in a training of a second."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from engine.clip_files.clip_state import read_clip_state
from engine.clip_files.compact import write_compact_clip
from engine.cloud.motion.dedup import mean_neighbor_distance, residual_rows
from engine.errors import ProjectError
from engine.model.host_array import host_array
from engine.training.clip_training import seed_of
from engine.training.config import TrainConfig
from engine.training.preparation.kept_clouds import CLOUD_FILES
from engine.training.presets import preset
from tests.engine.training.tiny_training import finish, same_arrays, stepwise, take_steps

pytestmark = pytest.mark.slow
PAPER = preset("paper") | {
    "static_feature_dim": 4,
    "dynamic_feature_dim": 4,
    "gaussians_per_anchor": 2,
    "field_levels": 3,
    "field_log2_entries": 10,
    "passes": 0.0,
    "joint_steps": 8,
    "source_steps": 5,
    "head_hidden": 16,
    "field_hidden": 16,
    "max_static_points": 400,
    "max_moving_points": 200,
}
"""The preset in the size of a test."""


@pytest.fixture(scope="module")
def paper_prep(tmp_path_factory):
    return tmp_path_factory.mktemp("paper")


@pytest.fixture(scope="module")
def reference(tiny, paper_prep):
    """Clip 0 of the preset, trained: as it is stored."""
    training = tiny.prepared(0, is_source=False, prep_dir=paper_prep, **PAPER)
    assert [name for name, _ in training.phases] == ["joint"]
    assert training.model.roles() == ["static"]
    start = training.model.anchor_set("static").positions.detach().clone()
    take_steps(training, training.n_steps)
    moved = (training.model.anchor_set("static").positions.detach() - start).norm(dim=1)
    assert moved.max() > 0, "positions learn"
    assert moved.max() < 0.05 * training.rig.extent
    stored = training.finish()
    assert same_arrays(stored.state.arrays, training.state().arrays), "storage=exact rounds nothing"
    return stored.state


def test_every_anchor_of_the_paper_preset_has_a_dynamic_feature(reference):
    static = reference.anchors["static"].own
    assert static.presence.all()
    assert not static.color_logits.any()
    assert reference.header.field.is_rectified
    assert max(reference.header.field.aspect) == 1.0
    assert min(reference.header.field.aspect) < 1.0


def test_a_source_clip_of_the_paper_preset_adds_what_no_inherited_anchor_covers(tiny, paper_prep, reference):
    training = tiny.prepared(1, reference=reference, prep_dir=paper_prep, **PAPER)
    assert training.model.roles() == ["static", "residual"]
    centers = reference.anchors["static"].own.positions
    residual = training.model.anchor_set("residual")
    assert residual_rows(host_array(residual.positions), centers, mean_neighbor_distance(centers)).all()
    assert not residual.features.any()
    coverage = training.state().header.coverage
    assert 0 < coverage.n_inherited < coverage.n_points
    both = np.concatenate([host_array(residual.positions), centers])
    squares = ((both[:1, None] - both[None]) ** 2).sum(-1)[0]
    expected = 0.5 * np.log(np.sort(squares)[1:4].mean())
    assert residual.log_base_scales.detach()[0] == pytest.approx(np.full(3, expected), abs=1e-5)
    finish(training)


def test_a_source_clip_of_the_paper_preset_learns_only_what_is_its_own(tiny, paper_prep, reference):
    training = tiny.prepared(1, reference=reference, prep_dir=paper_prep, **PAPER)
    model, start = training.model, _arrays_of(training)
    assert all(model.anchor_set(role).presence.all() for role in model.roles())
    assert model.light is None
    positions = np.concatenate([values for name, values in start.items() if name.endswith(".positions")])
    shape = model.field.shape  # from the first to the last anchor along every axis
    sides = shape.side * np.asarray(shape.aspect)
    assert shape.bounds_min == pytest.approx(positions.min(0), abs=1e-5)
    assert shape.bounds_min + sides == pytest.approx(positions.max(0), rel=1e-4, abs=1e-5)
    assert 0.9e-4 < np.abs(start["field.tables.0"]).max() <= 1e-4
    with torch.no_grad():
        corners = model.field.corners(model.anchor_set("static").positions.detach())
        features = model.field(torch.arange(len(corners.indices)), corners, [(0, 1.0)])
    assert float(features.min()) == 0.0 < float(features.max())
    finish(training)
    changed = {name for name, values in _arrays_of(training).items() if not np.array_equal(values, start[name])}
    own = {f"sets.residual.{name}" for name in ("positions", "features", "log_offset_scales", "log_base_scales")}
    assert changed == own | {"field.tables.0", "field.hidden.weight", "field.out.weight"}


def _arrays_of(training) -> dict[str, np.ndarray]:
    return {name: host_array(value).copy() for name, value in training.model.state_dict().items()}


def test_without_deduplication_points_of_still_things_become_anchors_too(tiny, paper_prep, reference):
    settings = PAPER | {"residual": "full"}
    training = tiny.prepared(1, reference=reference, prep_dir=paper_prep, **settings)
    coverage = training.state().header.coverage
    assert len(training.model.anchor_set("residual")) == coverage.n_points > 0


def test_a_clip_that_inherits_no_anchors_has_those_of_its_own_frames_alone(tiny, paper_prep, reference):
    training = tiny.prepared(1, reference=reference, prep_dir=paper_prep, **PAPER | {"inherit": "off"})
    assert training.model.roles() == ["residual"]
    coverage = training.state().header.coverage
    assert coverage.n_inherited == 0 < coverage.n_residual == len(training.model.anchor_set("residual"))
    finish(training)


def test_a_training_of_the_paper_preset_goes_on_exactly(tiny, paper_prep, reference, tmp_path):
    whole = finish(tiny.prepared(1, reference=reference, prep_dir=paper_prep, **PAPER))
    stopped = take_steps(tiny.prepared(1, reference=reference, prep_dir=paper_prep, **PAPER), 3)
    stopped.write_checkpoint(tmp_path / "kept.safetensors")
    resumed = tiny.training(1, reference=reference, prep_dir=paper_prep, **PAPER)
    resumed.restore_checkpoint(tmp_path / "kept.safetensors")
    assert finish(resumed).fingerprint == whole.fingerprint


def test_a_clip_stored_exactly_is_read_bit_for_bit(tiny, paper_prep, reference, tmp_path):
    training = tiny.prepared(1, reference=reference, prep_dir=paper_prep, **PAPER)
    take_steps(training, training.n_steps)
    stored = training.finish()
    write_compact_clip(tmp_path / "clip.clip", stored)
    assert same_arrays(read_clip_state(tmp_path / "clip.clip").arrays, stored.state.arrays)


def test_what_is_trained_is_what_is_shown_where_positions_learn(tiny, paper_prep, reference):
    """The field is read where the anchors are at the end, also after a clip was read from its file."""
    training = tiny.prepared(1, reference=reference, prep_dir=paper_prep, **PAPER)
    take_steps(training, training.n_steps)
    training.model.follow_positions()
    before = training.model.decode(0.0).means.detach()
    training.finish()
    assert torch.equal(training.model.decode(0.0).means.detach(), before)


def test_a_kept_cloud_is_of_pictures_in_the_same_exposure(tiny, paper_prep, reference):
    training = tiny.prepared(1, reference=reference, prep_dir=paper_prep, **PAPER)
    before = set(paper_prep.glob(CLOUD_FILES))
    drift = training.drift.copy()
    for gain in (1.0, 1.02):
        drift[0, 0] = gain
        training._preparation._frames_cloud(training.pictures, drift, spacing=reference.header.spacing)
    # unlike those of the clip itself, these are measured without gains
    assert len(set(paper_prep.glob(CLOUD_FILES)) - before) == 2


def test_frames_need_no_gate():
    with pytest.raises(ProjectError, match="cannot be combined with gate=hull"):
        TrainConfig(cloud="frames")


def test_backgrounds_of_a_clip_look_at_no_other_frame(tiny, tmp_path):
    capture = tiny.capture
    seen = []

    class Watched:
        def __getattr__(self, name):
            return getattr(capture, name)

        def frames_of(self, camera, frames):
            seen.extend(frames)
            return capture.frames_of(camera, frames)

    training = tiny.training(1, is_source=False, prep_dir=tmp_path, backgrounds="clip")
    training._preparation._capture = Watched()
    training.prepare()
    assert set(seen) == set(training.clip.frame_indices())


def test_independent_clips_have_a_seed_each(tiny):
    shared, own = TrainConfig(), TrainConfig(independent=True)
    assert [seed_of(shared, clip, 3) for clip in tiny.clips[:2]] == [3, 3]
    first, second = (seed_of(own, clip, 3) for clip in tiny.clips[:2])
    assert first == 3 != second


@pytest.mark.parametrize("volume", ["mean", "sum"])
def test_the_volume_term_is_what_it_says(tiny, volume):
    weight = 0.5
    plain, with_volume = (tiny.prepared(1, volume=volume, volume_weight=value, tiles="all") for value in (0.0, weight))
    scales = _scales_of_first_step(with_volume)
    products = scales.double().prod(1)
    spacing = with_volume.spacing
    without = plain.step()
    expected = products.sum() if volume == "sum" else products.sum() / spacing**3 / without.n_gaussians
    difference = with_volume.step().loss - without.loss
    # losses are float32 numbers of size 0.1
    assert difference == pytest.approx(float(weight * expected), rel=1e-3, abs=1e-6)


def _scales_of_first_step(training) -> torch.Tensor:
    order = type(training._order)(len(training._items), seed=training.seed + training._phase_index)
    camera_row, frame = divmod(training._items[order.draw()], training.clip.n_frames)
    view, clip_time = training._cameras.view(camera_row), frame / training.clip.clip_length
    return stepwise(training).active_picture(camera_row, view, clip_time).learning.scales.detach()
