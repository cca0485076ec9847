"""Which method settings describe: the product's own class unless a decision differs."""

from __future__ import annotations

from typing import cast

import pytest

from engine.clip_files.clip_state import ClipState
from engine.training.config import TrainConfig
from engine.training.preparation.method import Method
from engine.training.variants.variant_method import StreamingMethod, VariantMethod, method_of

BEFORE = cast(ClipState, object())
"""The clip before; only whether there is one counts here."""


@pytest.mark.parametrize(
    "settings", [{}, {"inherit": "moving"}, {"passes": 3.0}, {"independent": True}, {"field": "joint"}]
)
def test_numbers_and_which_clips_there_are_leave_the_method_as_it_is(settings):
    assert type(method_of(TrainConfig(**settings), previous=None)) is Method
    assert type(method_of(TrainConfig(**settings), previous=BEFORE)) is Method


@pytest.mark.parametrize(
    "settings",
    [
        {"gate": "static"},
        {"gate": "off"},
        {"tiles": "all"},
        {"inherit": "trainable"},
        {"inherit": "off"},
        {"residual": "none"},
        {"residual": "full"},
        {"decoder": "new"},
        {"decoder": "finetune"},
        {"field": "continue"},
        {"field_form": "published"},
        {"initial": "published"},
        {"schedule": "inherited"},
    ],
)
def test_any_other_decision_is_a_variant(settings):
    assert type(method_of(TrainConfig(**settings), previous=None)) is VariantMethod


def test_a_stream_goes_on_from_the_clip_before_where_there_is_one():
    config = TrainConfig(independent=True, start="previous")
    assert type(method_of(config, previous=None)) is Method
    going_on = method_of(config, previous=BEFORE)
    assert isinstance(going_on, StreamingMethod)
    assert going_on.learns_inherited
    assert going_on.keeps_unread_entries
