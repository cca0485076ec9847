"""Presets of training settings."""

from __future__ import annotations

from app.project.opening.project_access import read_settings
from engine.training.config import TrainConfig
from engine.training.presets import PRESETS, closest_preset, preset


def test_presets_are_valid_and_none_repeats_a_default_or_another():
    assert list(PRESETS) == ["toy", "small", "medium", "paper", "paper-long360", "paper-vru"]
    for name in PRESETS:
        assert TrainConfig(**preset(name)).difference() == preset(name)
        assert closest_preset(preset(name) | {"ssim_weight": 0.3}) == name
    assert preset("small") == {}
    preset("toy")["passes"] = 99
    assert preset("toy")["passes"] != 99


def test_the_published_sizes():
    config = TrainConfig(**preset("paper"))
    assert (config.static_feature_dim, config.dynamic_feature_dim, config.gaussians_per_anchor) == (64, 64, 10)
    assert (config.field_levels, config.field_channels, config.field_base_cells, config.field_growth) == (16, 4, 16, 2)
    assert config.gate == "off"
    n_pictures = 32 * 10
    assert config.n_joint_steps(n_pictures) == config.n_source_steps(n_pictures) == 34 * n_pictures == 10_880


def test_released_configurations_differ_in_their_tables_alone():
    for name, log2_entries in {"paper": 17, "paper-long360": 20, "paper-vru": 19}.items():
        assert preset(name) == preset("paper") | {"field_log2_entries": log2_entries}


def test_an_unknown_preset_ends_with_2_and_a_setting_changes_one(run, capture_folder, tmp_path):
    code, _, err = run("train", capture_folder, "--project", tmp_path / "p", "--preset", "nonsense")
    assert code == 2
    assert "toy, small, medium, paper" in err
    assert not (tmp_path / "p").exists()
    arguments = ("--preset", "toy", "--set", "passes=2", "--set", "joint_steps=6")
    assert run("train", capture_folder, "--project", tmp_path / "p", *arguments)[0] == 0
    assert read_settings(tmp_path / "p").overrides == preset("toy") | {"passes": 2.0, "joint_steps": 6}
