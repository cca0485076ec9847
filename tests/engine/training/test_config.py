"""Settings: ranges, overrides, differences."""

import subprocess
import sys

import pytest

from engine.errors import ProjectError
from engine.training.config import SETTINGS, TrainConfig, config_of, parse_overrides


def test_overrides_become_typed_values():
    assert parse_overrides(["joint_steps=12", "feature_lr = 0.5", "gate=off"]) == {
        "joint_steps": 12,
        "feature_lr": 0.5,
        "gate": "off",
    }


@pytest.mark.parametrize(
    ("assignment", "expected"),
    [
        ("joint_steps", "no '='"),
        ("steps=3", "does not exist"),
        ("joint_steps=many", "is 'many'; it has to be a whole number between 0 and 1000000"),
        ("feature_lr=fast", "is 'fast'; it has to be a number between 0 and 1"),
        ("independent=maybe", "is 'maybe'; it has to be true or false"),
    ],
)
def test_bad_overrides_name_what_is_wrong(assignment, expected):
    with pytest.raises(ProjectError, match=expected):
        parse_overrides([assignment])


def test_difference_lists_only_changes():
    assert TrainConfig().difference() == {}
    assert TrainConfig(joint_steps=5, gate="off").difference() == {"joint_steps": 5, "gate": "off"}


@pytest.mark.parametrize("setting", SETTINGS.values(), ids=lambda setting: setting.name)
def test_every_setting_is_declared_completely(setting):
    setting.check(setting.default)
    assert setting.meaning.endswith(".")
    assert setting.group
    is_number = setting.kind in (int, float)
    assert (setting.bounds is not None, bool(setting.choices)) == (is_number, setting.kind is str)
    assert all(setting.choices.values())
    assert not setting.label or setting.kind is int  # the window has fields for whole numbers


@pytest.mark.parametrize(
    "value", [4.5, "5", True, None, float("nan"), 0, 33], ids=["fraction", "text", "bool", "none", "nan", "low", "high"]
)
def test_values_of_the_wrong_kind_and_beyond_the_range_are_refused(value):
    with pytest.raises(ProjectError, match=r"gaussians_per_anchor is .*; it has to be a whole number between 1 and 32"):
        TrainConfig(gaussians_per_anchor=value)


def test_a_whole_number_is_a_number_but_nan_and_true_are_not():
    assert TrainConfig(passes=8).passes == 8
    for value in (float("nan"), True, "8"):
        with pytest.raises(ProjectError, match="passes is"):
            config_of({"passes": value})


def test_an_unknown_setting_is_named():
    with pytest.raises(ProjectError, match="no training setting called speed"):
        config_of({"speed": 3, "passes": 2})
    assert config_of({"passes": 2}) == TrainConfig(passes=2)


def test_settings_can_be_imported_without_torch():
    code = "import sys, engine.training.config; sys.exit('torch' in sys.modules or 'numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
