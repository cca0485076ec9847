"""Settings that all clips share, as commands change them."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from app.project.opening.opened_project import OpenedProject
from app.session.projects.setting_changes import changed_settings
from app.session.projects.setting_commands import SetClipLength, SetHoldout, SetPreset, SettingCommand, SetTrainSetting
from engine.errors import EngineError
from engine.training.presets import PRESETS


@pytest.fixture
def opened(make_opened: Callable[..., OpenedProject]) -> OpenedProject:
    return make_opened()


def change(opened: OpenedProject, *commands: SettingCommand):
    settings = opened.project.settings
    for command in commands:
        settings = changed_settings(settings, command, opened.rig)
    return settings


def test_cameras_are_held_out_by_name_in_order_and_once(opened: OpenedProject):
    assert change(opened, SetHoldout((2, 1, 2, 99, -1))).holdout == ("1", "2")
    assert change(opened, SetHoldout(())).holdout == ()


def test_the_project_itself_stays_as_it_is(opened: OpenedProject):
    before = opened.project.settings
    assert change(opened, SetClipLength(2)).clip_length == 2
    assert opened.project.settings is before
    assert before.clip_length == 3


def test_of_the_training_only_what_differs_from_the_defaults_is_kept(opened: OpenedProject):
    assert change(opened, SetTrainSetting("joint_steps", 50)).overrides == {"joint_steps": 50}
    assert change(opened, SetTrainSetting("joint_steps", 50), SetTrainSetting("joint_steps", 0)).overrides == {}


@pytest.mark.parametrize("name", list(PRESETS))
def test_a_preset_replaces_what_was_set(opened: OpenedProject, name: str):
    assert change(opened, SetTrainSetting("joint_steps", 50), SetPreset(name)).overrides == PRESETS[name]


@pytest.mark.parametrize(
    "command", [SetTrainSetting("speed", 3), SetTrainSetting("joint_steps", -1), SetPreset("huge")]
)
def test_what_cannot_be_is_refused(opened: OpenedProject, command: SettingCommand):
    with pytest.raises(EngineError):
        change(opened, command)
