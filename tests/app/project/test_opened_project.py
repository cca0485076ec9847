"""OpenedProject: one value that says what is open."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import FrozenInstanceError, replace

import pytest

from app.project.opening.opened_project import OpenedProject, opened_project


def test_it_follows_the_settings_of_the_project(make_opened: Callable[..., OpenedProject]):
    opened = make_opened()
    assert [clip.start for clip in opened.clips] == [0, 3]
    assert (opened.holdout, opened.reference_index, opened.rig) == ((0,), 0, opened.capture.rig)
    opened.project.update(replace(opened.project.settings, clip_length=2, holdout=("2",)))
    changed = opened_project(opened.capture, opened.project, opened.generation)
    assert [clip.start for clip in changed.clips] == [0, 2, 4]
    assert (changed.holdout, changed.generation) == ((2,), opened.generation)
    assert [clip.start for clip in opened.clips] == [0, 3], "whoever holds the value before is not surprised"


def test_a_hold_out_that_the_capture_does_not_have_is_left_out(make_opened: Callable[..., OpenedProject]):
    opened = make_opened()
    opened.project.update(replace(opened.project.settings, holdout=("2", "gone")))
    assert opened_project(opened.capture, opened.project, 1).holdout == (2,)


def test_clips_inherit_from_the_reference_and_it_from_nothing(make_opened: Callable[..., OpenedProject]):
    opened = make_opened()
    assert opened.inherited_path(0) is None
    assert opened.inherited_path(1) == opened.project.clip_path(0)


def test_nothing_in_it_can_be_replaced(make_opened: Callable[..., OpenedProject]):
    with pytest.raises(FrozenInstanceError):
        make_opened().generation = 2  # type: ignore[misc]
