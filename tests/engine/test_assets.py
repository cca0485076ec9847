"""Shipped files are found, and nothing outside assets/ is."""

import pytest

from engine.assets import asset_path


def test_asset_path_points_at_the_shipped_folder() -> None:
    assert asset_path().is_dir()
    assert asset_path("sample", "cameras.json") == asset_path() / "sample" / "cameras.json"


def test_asset_path_refuses_to_leave_the_folder() -> None:
    with pytest.raises(ValueError, match="outside assets"):
        asset_path("..", "pyproject.toml")
