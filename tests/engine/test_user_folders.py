"""The user's folders follow the XDG variables, and a user without a home gets a folder that cannot be made."""

from __future__ import annotations

import sys
from pathlib import Path
from unittest.mock import Mock

import pytest

from engine.user_folders import cache_dir, config_dir, data_dir

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have other places")

FOLDERS = {"XDG_DATA_HOME": data_dir, "XDG_CONFIG_HOME": config_dir, "XDG_CACHE_HOME": cache_dir}
BELOW_HOME = {data_dir: ".local/share", config_dir: ".config", cache_dir: ".cache"}


@pytest.mark.parametrize("variable", FOLDERS)
def test_the_variable_of_the_system_decides(variable, monkeypatch, tmp_path):
    monkeypatch.setenv(variable, str(tmp_path))
    assert FOLDERS[variable]() == tmp_path / "ClipGStream"


@pytest.mark.parametrize("empty", [None, ""])
@pytest.mark.parametrize("variable", FOLDERS)
def test_without_it_they_lie_in_the_usual_places_below_home(variable, empty, monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv(variable, raising=False)
    if empty is not None:
        monkeypatch.setenv(variable, empty)
    folder = FOLDERS[variable]
    assert folder() == tmp_path / BELOW_HOME[folder] / "ClipGStream"


@pytest.mark.parametrize("variable", FOLDERS)
def test_without_any_home_nothing_is_made_where_the_program_stands(variable, monkeypatch):
    for name in (variable, "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("pwd.getpwuid", Mock(side_effect=KeyError("no such user")))
    folder = FOLDERS[variable]()
    assert folder == Path("/nonexistent/ClipGStream")
    assert not folder.exists()
