"""Features apart: each half is zero, nothing else changes and nothing is copied."""

import copy

import pytest
import torch

from engine.metrics.clips.features_apart import with_features
from engine.model.clip_model import ClipModel
from engine.raster.gaussians import Gaussians
from tests.engine.metrics.tiny_clips import CLIP_LENGTH, make_model

NAMES = ("means", "quats", "scales", "opacities", "colors")
TIMES = [frame / CLIP_LENGTH for frame in range(CLIP_LENGTH)]


def same(a: Gaussians, b: Gaussians, *, atol: float = 0.0) -> bool:
    return all(torch.allclose(getattr(a, name), getattr(b, name), rtol=0, atol=atol) for name in NAMES)


@pytest.fixture
def model() -> ClipModel:
    return make_model(has_motion=True)


@pytest.mark.parametrize("clip_time", TIMES)
def test_static_is_a_field_of_zero(model, clip_time):
    silent = copy.deepcopy(model)
    assert silent.field is not None
    with torch.no_grad():
        silent.field.out.weight.zero_()
    found = with_features(model, "static").decode(clip_time)
    assert same(found, silent.decode(clip_time))
    has_moving_anchors = clip_time != TIMES[1]
    assert same(found, model.decode(clip_time)) != has_moving_anchors


@pytest.mark.parametrize("clip_time", [*TIMES, 0.1])
def test_dynamic_is_static_features_of_zero(model, clip_time):
    bare = copy.deepcopy(model)
    with torch.no_grad():
        for role in bare.roles():
            bare.anchor_set(role).features.zero_()
    found = with_features(model, "dynamic").decode(clip_time)
    assert same(found, bare.decode(clip_time))
    assert not same(found, model.decode(clip_time))


def test_both_is_the_model_itself(model):
    assert with_features(model, "both") is model


@pytest.mark.parametrize("features", ["static", "dynamic"])
def test_nothing_is_copied_and_the_model_stays_as_it_was(model, features):
    before, learning = model.decode(0.0), {name: p.requires_grad for name, p in model.named_parameters()}
    model.decoder.requires_grad_(requires_grad=True)
    variant = with_features(model, features)
    assert variant.decoder is model.decoder
    for role in model.roles():
        mine, theirs = variant.anchor_set(role), model.anchor_set(role)
        assert mine.positions.data_ptr() == theirs.positions.data_ptr()
        assert mine.log_base_scales.data_ptr() == theirs.log_base_scales.data_ptr()
        assert theirs.features.abs().sum() > 0
    assert all(p.requires_grad for p in model.decoder.parameters())
    model.decoder.requires_grad_(requires_grad=False)
    assert {name: p.requires_grad for name, p in model.named_parameters()} == learning
    assert same(model.decode(0.0), before)


def test_an_untrained_field_shows_the_static_features(model):
    """Acceptance check 2 of the method: a clip at step 0 looks like its static features alone."""
    assert model.field is not None
    with torch.no_grad():
        for table in model.field.tables:
            table.mul_(1 / 2000)  # as a fresh field starts
    assert same(model.decode(0.0), with_features(model, "static").decode(0.0), atol=5e-3)
    assert not same(model.decode(0.0), with_features(model, "static").decode(0.0))
