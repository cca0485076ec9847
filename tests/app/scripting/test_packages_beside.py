"""`import clipgstream` in a folder that has packages of the names of the program's own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


def run_beside(folder: Path, script: str, *names: str) -> subprocess.CompletedProcess[str]:
    """Run a script of a folder in which there are packages, or modules, of these names."""
    for name in names:
        path = folder / name if name.endswith(".py") else folder / name / "__init__.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text("IS_MINE = True\n")
    (folder / "script.py").write_text(script)
    environment = {"PYTHONPATH": str(ROOT), "HOME": str(folder), "PATH": "/usr/bin:/bin"}
    return subprocess.run(
        [sys.executable, "script.py"], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
@pytest.mark.parametrize("names", [("app", "engine"), ("app.py",), ()])
def test_packages_of_the_same_names_are_not_in_the_way(tmp_path: Path, names: tuple[str, ...]) -> None:
    script = """
from clipgstream import ProjectError, open_project
import clipgstream, sys

try:
    open_project("nothing")
except ProjectError as error:
    print(type(error).__module__, error.message)
print(sys.path.count(str(__import__("pathlib").Path(clipgstream.__file__).parent)))
"""
    done = run_beside(tmp_path, script, *names)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == ["engine.errors There is no such folder.", "1"]  # PYTHONPATH alone names it


@pytest.mark.parametrize("names", [("app",), ("engine.py",)])
def test_one_that_was_imported_before_is_named(tmp_path: Path, names: tuple[str, ...]) -> None:
    name = names[0].removesuffix(".py")
    done = run_beside(tmp_path, f"import {name}\nassert {name}.IS_MINE\nimport clipgstream\n", *names)
    assert done.returncode == 1
    said = done.stderr.splitlines()[-1]
    assert said.startswith(f"ImportError: Another package called '{name}' is in use")
    assert said.endswith(str(tmp_path / names[0]))


@pytest.mark.slow
def test_child_processes_use_the_packages_of_the_program_too(tmp_path: Path) -> None:
    script = """
from pathlib import Path
import clipgstream
from engine.features.child import arrays_kind
from engine.children.process import run_child

run_child(arrays_kind("engine.features.matching:MATCHING", "", "The child"), Path("nowhere"))
"""
    done = run_beside(tmp_path, script, "app", "engine")
    assert "The child ended with code 1 (FileNotFoundError" in done.stderr, done.stdout + done.stderr
