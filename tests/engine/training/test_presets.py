"""Presets: the published settings of "paper", rate by rate. That all are valid: tests/app/lab/ablation."""

from collections.abc import Iterable

import pytest
import torch
from torch import nn

from engine.backends.table import backend_called
from engine.model.reading import load_clip_model
from engine.training.config import TrainConfig
from engine.training.optimizer.optimizer import named_parameters
from engine.training.presets import preset
from engine.training.variants.variant_method import method_of

# start and end of the rates as released; the field's is before its scene scale
PUBLISHED = {
    "sets.static.features": (7.5e-3, 7.5e-3),
    "sets.moving.log_offset_scales": (7e-3, 7e-3),
    "sets.moving.log_base_scales": (7e-3, 7e-3),
    "field.tables.0": (2e-4, 2e-6),
    "field.hidden": (2e-4, 2e-6),
    "field.out": (2e-4, 2e-6),
    "decoder.opacity.0": (2e-3, 2e-5),
    "decoder.shape.3": (4e-3, 4e-3),
    "decoder.color.1": (8e-3, 5e-5),
    "decoder.offset.2": (8e-3, 5e-5),
}


def final_ratios(names: Iterable[str], config: TrainConfig) -> dict[str, float]:
    """Of all these parameters."""
    return dict.fromkeys(names, config.final_lr_ratio) | method_of(config, previous=None).final_ratios(names, config)


def test_rates_of_the_paper_preset_start_and_end_as_published(tiny):
    config = TrainConfig(**preset("paper"))
    model, gains = (
        load_clip_model(tiny.reference, None, is_learning=True, backend=backend_called("cpu")),
        nn.Parameter(torch.ones(1, 3)),
    )
    model.requires_grad_(requires_grad=True)  # still parts of a finished clip no longer learn
    rates = {name: rate for name, (_, rate) in named_parameters(model, gains, config).items()}
    ends = {name: rates[name] * ratio for name, ratio in final_ratios(rates, config).items()}
    assert {name: rates[name] for name in PUBLISHED} == {name: start for name, (start, _) in PUBLISHED.items()}
    assert {name: ends[name] for name in PUBLISHED} == pytest.approx(
        {name: end for name, (_, end) in PUBLISHED.items()}
    )


def test_other_settings_of_the_paper_preset_are_the_published_ones():
    config = TrainConfig(**preset("paper"))
    assert (config.ssim_weight, config.volume_weight) == (0.2, 0.01)
    assert (config.gate, config.color, config.decoder) == ("off", "off", "frozen")
    assert min(config.max_static_points, config.max_moving_points) > 100_000


def test_every_rate_ends_where_the_default_says_unless_it_has_an_end_of_its_own():
    names = [*PUBLISHED, "gains"]
    assert set(final_ratios(names, TrainConfig(final_lr_ratio=0.3)).values()) == {0.3}
    config = TrainConfig(final_lr_ratio=0.3, field_final_ratio=0.5, color_head_final_ratio=1.0)
    found = final_ratios(names, config)
    assert {name for name, ratio in found.items() if ratio == 0.5} == {"field.tables.0", "field.hidden", "field.out"}
    assert {name for name, ratio in found.items() if ratio == 1.0} == {"decoder.color.1"}
