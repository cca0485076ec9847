"""Presets of training settings."""

from __future__ import annotations

from app.project.opening.project_access import read_settings
from engine.training.config import TrainConfig
from engine.training.presets import PRESETS, preset


def test_presets_are_four_and_valid():
    assert set(PRESETS) == {"toy", "small", "medium", "paper"}
    for name in PRESETS:
        assert TrainConfig(**preset(name)).difference() == preset(name)  # none repeats a default
    assert preset("small") == {}
    preset("toy")["passes"] = 99
    assert preset("toy")["passes"] != 99


def test_the_published_sizes():
    config = TrainConfig(**preset("paper"))
    assert (config.static_feature_dim, config.dynamic_feature_dim, config.gaussians_per_anchor) == (64, 64, 10)
    assert (config.field_levels, config.field_channels, config.field_base_cells, config.field_growth) == (16, 4, 16, 2)
    assert 17 <= config.field_log2_entries <= 20
    assert config.gate == "off"
    n_pictures = 32 * 10
    assert config.n_joint_steps(n_pictures) == config.n_source_steps(n_pictures) == 34 * n_pictures == 10_880


def test_an_unknown_preset_ends_with_2_and_a_setting_changes_one(run, capture_folder, tmp_path):
    code, _, err = run("train", capture_folder, "--project", tmp_path / "p", "--preset", "nonsense")
    assert code == 2
    assert "toy, small, medium, paper" in err
    assert not (tmp_path / "p").exists()
    arguments = ("--preset", "toy", "--set", "passes=2", "--set", "joint_steps=6")
    assert run("train", capture_folder, "--project", tmp_path / "p", *arguments)[0] == 0
    assert read_settings(tmp_path / "p").overrides == preset("toy") | {"passes": 2.0, "joint_steps": 6}
