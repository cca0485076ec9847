"""The arrows between the packages hold, and the guard that says so can fail.

Static rules are import-linter contracts (pyproject.toml); what a fresh interpreter really loads is looked at here too,
because a contract cannot see an import made through a library.
"""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow  # left out by make check, as the file takes seconds as a whole

ROOT = Path(__file__).resolve().parents[2]
WINDOW_LIBRARIES = {"pyglet", "moderngl", "imgui_bundle"}


def lint_imports(root: Path) -> subprocess.CompletedProcess[str]:
    """Run the import contracts of `root` in a child, which sees the packages below `root` only."""
    code = "import sys; sys.path.insert(0, '.'); from importlinter.cli import lint_imports; sys.exit(lint_imports())"
    return subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=root, capture_output=True, text=True, timeout=600, check=False
    )


def loaded_modules(statement: str) -> set[str]:
    """Top-level modules that a fresh interpreter holds after `statement`."""
    code = f"import json, sys\n{statement}\nprint(json.dumps(sorted({{name.split('.')[0] for name in sys.modules}})))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


@pytest.fixture
def copied_tree(tmp_path: Path) -> Path:
    """A copy of the packages and their contracts that a test may spoil."""
    for package in ("app", "engine", "ui"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def test_import_contracts_hold() -> None:
    done = lint_imports(ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("bad_file", "bad_import", "broken_contract"),
    [
        ("engine/images/seeded.py", "import app.session.seeded_target", "Arrows point one way"),
        ("engine/images/seeded.py", "from ui.shell import seeded_target", "Arrows point one way"),
        ("app/session/seeded.py", "def late():\n    import ui.shell.seeded_target", "Arrows point one way"),
        ("app/session/seeded.py", "import moderngl", "app and engine know no window"),
        ("engine/images/seeded.py", "from pyglet import window", "app and engine know no window"),
        ("ui/style/seeded.py", "import torch", "ui imports no torch"),
        ("engine/training/seeded.py", "import engine.training.variants.variant_method", "Only the job of a training"),
        ("engine/capture/seeded.py", "import engine.training.config", "Layers of engine:"),
        ("engine/homeless.py", "", "Layers of engine:"),
        ("app/homeless.py", "", "Layers of app:"),
        ("ui/homeless.py", "", "Layers of ui:"),
        ("app/project/seeded.py", "import app.session.session", "Layers of app:"),
        ("app/session/seeded.py", "import app.lab.report.page.tables", "Layers of app:"),
        ("ui/gl/seeded.py", "import ui.panels.state", "Layers of ui:"),
        ("ui/panels/seeded.py", "import app.training.service", "The window talks to the session"),
        ("engine/cloud/background/seeded.py", "import engine.cloud.stereo.depth.sweep", "Layers of engine.cloud:"),
        ("engine/training/step/seeded.py", "import engine.training.preparation.stages", "Layers of engine.training:"),
    ],
)
def test_contracts_refuse_a_seeded_bad_import(
    copied_tree: Path, bad_file: str, bad_import: str, broken_contract: str
) -> None:
    for package in ("app/session", "ui/shell"):
        (copied_tree / package / "seeded_target.py").write_text("")
    assert lint_imports(copied_tree).returncode == 0, "the copy must be clean before it is spoiled"
    (copied_tree / bad_file).write_text(bad_import + "\n")
    done = lint_imports(copied_tree)
    assert done.returncode == 1, done.stdout + done.stderr
    broken = [line for line in done.stdout.splitlines() if " BROKEN" in line]
    assert len(broken) == 1, done.stdout
    assert broken_contract in broken[0]


def test_the_capture_doctor_loads_no_torch() -> None:
    loaded = loaded_modules(
        "import app.session.examining_process, app.cli.captures.inspect_command, engine.doctor.doctor\n"
        "from app.background.kernels import use_threads\n"
        "use_threads(None, with_torch=False)"
    )
    assert "numba" in loaded
    assert "torch" not in loaded


def test_importing_ui_main_loads_no_torch_and_no_window_library() -> None:
    assert not loaded_modules("import ui.main") & (WINDOW_LIBRARIES | {"torch"})


def test_the_window_draws_before_it_loads_what_computes() -> None:
    loaded = loaded_modules(
        "import pyglet\npyglet.options.headless = True\nimport ui.shell.window, app.session.session\n"
        "import app.session.projects.preferences, app.project.opening.project_choices"
    )
    assert {"pyglet", "imgui_bundle"} <= loaded
    assert not loaded & {"cv2", "fourdgs", "matplotlib", "numba", "open3d", "scipy", "torch"}


def test_importing_the_command_line_loads_no_window_library() -> None:
    assert not loaded_modules("import app.cli.cli") & WINDOW_LIBRARIES


def test_loaded_modules_sees_an_import() -> None:
    assert "moderngl" in loaded_modules("import moderngl"), "the probe of this file must be able to see a bad import"


def test_tests_of_the_engine_import_nothing_from_above_it() -> None:
    # the generator of captures is the exception: it is part of the lab, and itself imports nothing but the engine
    upper = re.compile(r"^\s*(?:from|import) (?:tests\.)?(?!app\.lab\.synthetic\b)(?:app|ui)\b.*", re.MULTILINE)
    assert upper.search("import app.project") is not None
    files = sorted((ROOT / "tests" / "engine").rglob("*.py"))
    assert len(files) > 50, "the tests were not found"
    assert [(path.name, found[0]) for path in files if (found := upper.search(path.read_text("utf-8")))] == []
    generator = sorted((ROOT / "app" / "lab" / "synthetic").glob("*.py"))
    assert len(generator) > 5
    assert [(path.name, found[0]) for path in generator if (found := upper.search(path.read_text("utf-8")))] == []
