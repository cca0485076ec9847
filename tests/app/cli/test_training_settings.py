"""The list of training settings on the command line."""

import pytest

from app.cli.training_settings import WIDTH, settings_lines
from engine.training.config import SETTINGS


@pytest.mark.parametrize("command", ["train", "ablate"])
def test_help_settings_lists_every_setting_and_trains_nothing(run, command):
    code, out, err = run(command, "--help-settings")
    assert (code, err) == (0, "")
    for setting in SETTINGS.values():
        assert f"  {setting.name}=" in out
    assert "gaussians_per_anchor=5             1 to 32 Gaussians" in out
    assert "gate=hull                          hull, images, static, off" in out


def test_lines_fit_a_terminal():
    assert max(map(len, settings_lines())) <= WIDTH
