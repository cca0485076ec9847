"""Settings: ranges, overrides, differences."""

import pytest

from engine.errors import ProjectError
from engine.training.config import TrainConfig, parse_overrides


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
        ("joint_steps=many", "is 'many', which is not a whole number"),
        ("feature_lr=fast", "is 'fast', which is not a number"),
        ("independent=maybe", "is 'maybe', which is not true or false"),
    ],
)
def test_bad_overrides_name_what_is_wrong(assignment, expected):
    with pytest.raises(ProjectError, match=expected):
        parse_overrides([assignment])


def test_values_outside_their_range_are_refused_with_the_range():
    with pytest.raises(ProjectError, match="between 0 and 20"):
        TrainConfig(field_log2_entries=40)


def test_a_choice_that_does_not_exist_is_refused_with_the_choices():
    with pytest.raises(ProjectError, match="color is 'matrix'; it has to be 'auto', 'gain' or 'off'"):
        TrainConfig(color="matrix")


def test_difference_lists_only_changes():
    assert TrainConfig().difference() == {}
    assert TrainConfig(joint_steps=5, gate="off").difference() == {"joint_steps": 5, "gate": "off"}
