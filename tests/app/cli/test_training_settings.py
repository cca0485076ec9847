"""Training settings on the command line: what was chosen, and the list of all."""

import pytest

from app.cli.arguments import PlainParser, parse
from app.cli.training_settings import WIDTH, add_training_settings, overrides_of, settings_lines
from engine.training.config import SETTINGS
from engine.training.presets import preset


@pytest.mark.parametrize("command", ["train", "ablate"])
def test_help_settings_lists_every_setting_and_trains_nothing(run, command):
    code, out, err = run(command, "--help-settings")
    assert (code, err) == (0, "")
    for setting in SETTINGS.values():
        assert f"  {setting.name}=" in out
    assert "gaussians_per_anchor=5             1 to 32 Gaussians" in out
    assert "gate=hull                          hull, static, off" in out


def test_lines_fit_a_terminal():
    assert max(map(len, settings_lines())) <= WIDTH


def test_settings_of_the_command_line_go_before_those_of_the_preset():
    parser = PlainParser()
    add_training_settings(parser)
    options = parse(parser, ["--preset", "toy", "--set", "static_steps=7", "--set", "gaussians_per_anchor=2"])
    assert overrides_of(options) == preset("toy") | {"static_steps": 7, "gaussians_per_anchor": 2}
