"""The wheel: one package, which works next to packages of the user's that are called as ours are."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
BUILT_FROM = ("app", "engine", "ui", "assets", "clipgstream.py", "setup.py", "pyproject.toml", "README.md", "LICENSE")


def _below_one_name() -> Callable[[bytes, str], bytes]:
    spec = spec_from_file_location("setup_of_clipgstream", ROOT / "setup.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.below_one_name


below_one_name = _below_one_name()


def test_imports_are_rewritten_and_nothing_else() -> None:
    source = '''"""See app.session; `from app import x`."""
import numpy, engine.text as text, os  # from app import y
from app.cli.cli import (
    main,  # from ui import z
)
from application import engine
if TYPE_CHECKING:
    é = 1; from ui.shell import window
def late():
\tfrom engine import assets as engine
    \tapp.session("engine.children", engine.assets)
from . import app
'''.replace("\n    \tapp", "\n\tapp")
    expected = source
    for before, after in (
        ("engine.text as", "clipgstream.engine.text as"),
        ("from app.cli", "from clipgstream.app.cli"),
        ("from ui.shell", "from clipgstream.ui.shell"),
        ("from engine import assets", "from clipgstream.engine import assets"),
    ):
        expected = expected.replace(before, after)
    assert below_one_name(source.encode(), "x.py").decode() == expected


@pytest.mark.parametrize(
    "source", ["import app", "import os, engine.text", "from \\\n app import x", "from  ui import x"]
)
def test_what_cannot_be_rewritten_is_refused(source: str) -> None:
    with pytest.raises(ValueError, match=r"x\.py, line \d: write"):
        below_one_name(source.encode(), "x.py")


def test_every_import_can_be_rewritten() -> None:
    unnamed = re.compile(r"^\s*import (?:[\w.]+, )*(?:app|engine|ui)\b(?!.* as )", re.MULTILINE)
    assert unnamed.search("    import os, engine.text")
    paths = [path for name in ("app", "engine", "ui") for path in (ROOT / name).rglob("*.py")]
    assert len(paths) > 1000, "the packages were not found"
    assert [str(path) for path in paths if unnamed.search(path.read_text("utf-8"))] == []


# ---------------------------------------------------------------- built and used


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy of the tree, without a network."""
    folder = tmp_path_factory.mktemp("wheel")
    tree = folder / "tree"
    tree.mkdir()
    ignored = shutil.ignore_patterns("__pycache__")
    for name in BUILT_FROM:
        source = ROOT / name
        shutil.copytree(source, tree / name, ignore=ignored) if source.is_dir() else shutil.copy(source, tree)
    (tree / "build" / "lib" / "clipgstream" / "app").mkdir(parents=True)
    (tree / "build" / "lib" / "clipgstream" / "app" / "left_by_an_earlier_build.py").touch()
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--no-build-isolation", "--no-deps"]
    subprocess.run([*pip, "--no-index", "-q", "-w", folder, tree], check=True, timeout=900, capture_output=True)
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def run_beside(
    wheel: Path, tmp_path_factory: pytest.TempPathFactory
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs Python with the wheel's package and hostile ones on its path, in a folder with hostile ones."""
    folder = tmp_path_factory.mktemp("beside")
    site = folder / "site"
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--no-index", "--no-deps", "-q"]
    subprocess.run([*pip, "--target", site, wheel], check=True, timeout=900, capture_output=True)
    theirs = folder / "theirs"
    for name in ("app", "engine", "ui", "assets"):
        (theirs / name).mkdir(parents=True)
        (theirs / name / "__init__.py").write_text(f"raise SystemExit('{name} of somebody else was imported')\n")

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        paths = os.pathsep.join(map(str, (theirs, site)))
        environment = {**os.environ, "PYTHONPATH": paths, "XDG_DATA_HOME": str(folder / "data")}
        environment.pop("DISPLAY", None)
        words = [sys.executable, *map(str, arguments)]
        return subprocess.run(
            words, cwd=theirs, env=environment, capture_output=True, text=True, timeout=600, check=False
        )

    return run


PROGRAM = ("-c", "import sys; from clipgstream import main; sys.exit(main())")
"""What pip's script of the entry point runs."""


@pytest.mark.slow
def test_the_wheel_has_one_package_with_everything(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        info = wheel.name.removesuffix("-py3-none-any.whl") + ".dist-info"
        assert {name.split("/")[0] for name in names} == {"clipgstream", info}
        assert archive.read(f"{info}/top_level.txt").split() == [b"clipgstream"]
        assert b"clipgstream = clipgstream:main" in archive.read(f"{info}/entry_points.txt")
    inside = {name.removeprefix("clipgstream/") for name in names if name.startswith("clipgstream/")}
    ignored = shutil.ignore_patterns("__pycache__")
    expected = {
        path.relative_to(ROOT).as_posix()
        for name in ("app", "engine", "ui", "assets")
        for path in (ROOT / name).rglob("*")
        if path.is_file() and not ignored(str(path.parent), list(path.relative_to(ROOT).parts))
    }
    assert inside == expected | {"__init__.py"}


@pytest.mark.slow
def test_it_works_next_to_packages_of_the_same_names(
    run_beside: Callable[..., subprocess.CompletedProcess[str]], tiny_capture: Path, tmp_path: Path
) -> None:
    said = run_beside(*PROGRAM, "--version")
    assert (said.returncode, said.stderr) == (0, "")
    assert said.stdout.startswith("clipgstream ")
    project = tmp_path / "project"
    steps = [word for name in ("static_steps=3", "joint_steps=3") for word in ("--set", name)]
    chosen = ["--project", project, "--clips", "0:1", "--preset", "toy", *steps]
    trained = run_beside(*PROGRAM, "train", tiny_capture, *chosen)
    assert trained.returncode == 0, trained.stderr
    exported = run_beside(*PROGRAM, "export", project, "--format", "ply", "--frames", "0", "--out", tmp_path / "out")
    assert exported.returncode == 0, exported.stderr
    assert list((tmp_path / "out").glob("*.ply"))


SCRIPT = """
import sys
import clipgstream
assert "clipgstream.app.scripting" not in sys.modules, "children import the package, too"
from clipgstream import ProjectError, open_project
try:
    open_project("nothing")
except ProjectError as error:
    print(type(error).__module__, error.message)
names = {}
exec("from clipgstream import *", names)
assert set(clipgstream.__all__) <= names.keys() & set(dir(clipgstream))
try:
    clipgstream.nothing
except AttributeError as error:
    print(error)
assert not {"app", "engine", "ui"} & sys.modules.keys()
"""


@pytest.mark.slow
def test_scripts_have_the_same_api(run_beside: Callable[..., subprocess.CompletedProcess[str]]) -> None:
    said = run_beside("-c", SCRIPT)
    assert said.returncode == 0, said.stderr
    assert said.stdout.splitlines() == [
        "clipgstream.engine.errors There is no such folder.",
        "module 'clipgstream.app.scripting' has no attribute 'nothing'",
    ]
