"""Names of our modules: as they are in the repository, below `clipgstream` where they are loaded from there."""

from __future__ import annotations

import importlib.metadata
import os
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from engine import own_modules


@pytest.fixture
def below(tmp_path: Path) -> ModuleType:
    """The module as an installed program has it."""
    path = tmp_path / "site" / "clipgstream" / "engine" / "own_modules.py"
    path.parent.mkdir(parents=True)
    path.write_text(Path(own_modules.__file__).read_text())
    spec = spec_from_file_location("clipgstream.engine.own_modules", path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_names_in_the_repository_stay() -> None:
    assert own_modules.module_name("engine.text") == "engine.text"
    assert own_modules.import_own("engine.text") is sys.modules["engine.text"]


def test_names_in_an_installed_program_are_below_its_own(below: ModuleType) -> None:
    assert below.module_name("app.cli.cli") == "clipgstream.app.cli.cli"
    assert below.module_name("ui") == "clipgstream.ui"
    assert below.module_name("application.engine") == "application.engine"
    assert below.module_name("clipgstream.app.cli") == "clipgstream.app.cli"
    assert below.import_own("json") is sys.modules["json"]


def test_children_find_the_package_itself(below: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "theirs")
    root = Path(own_modules.__file__).parents[1]
    assert own_modules.python_path() == f"{root}{os.pathsep}theirs"
    assert below.python_path() == f"{tmp_path / 'site'}{os.pathsep}theirs"
    monkeypatch.delenv("PYTHONPATH")
    assert below.python_path() == str(tmp_path / "site")


def test_a_program_that_is_not_installed_has_no_version(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> str:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "version", missing)
    assert own_modules.program_version() == "unknown"
