"""docs/examples/clean_scene.py does what it says, on a project in which one clip is not trained yet."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from app.project.opening.project_access import open_project
from app.scripting.scripted_project import open_scripted
from tests.app.conftest import inline
from tests.app.residuals.conftest import make_project

ROOT = Path(__file__).resolve().parents[3]
EXAMPLE = ROOT / "docs" / "examples" / "clean_scene.py"


def check(project: Path, out: Path) -> None:
    assert sorted(path.name for path in out.iterdir()) == ["frames", "player.html", "turn"]
    assert len(list((out / "turn").iterdir())) == 2
    assert len(list((out / "frames").glob("*.spz"))) == 2
    kept = open_project(project, is_writable=False)
    assert [edit.name for edit in kept.document.edits] == ["faint specks", "nothing far away", ""]
    assert kept.history.undo_name.startswith("remove edit: expose everything")


def test_the_example_of_the_documents(tmp_path, capsys, monkeypatch):
    project = make_project(tmp_path)
    (project / "clips" / "0001.safetensors").unlink()
    clean = runpy.run_path(str(EXAMPLE))["clean"]
    with open_scripted(project, launch=inline) as opened:
        real = opened.select
        monkeypatch.setattr(  # no Gaussian of the made project is faint
            type(opened), "select", lambda self, where, **options: real(where.replace("<0.02", "<0.9"), **options)
        )
        clean(opened, tmp_path / "out")
    said = capsys.readouterr().out
    assert "clip 0: skipped, 6 steps" in said
    assert "clip 1: trained, 6 steps" in said
    check(project, tmp_path / "out")


def test_the_program_on_the_page_of_scripts(tmp_path, monkeypatch):
    """As it stands there, on a project of six frames; only its place is another."""
    project = make_project(tmp_path)
    [program] = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "scripting.md").read_text(), re.DOTALL)
    (tmp_path / "program.py").write_text(program)
    project.rename(tmp_path / "my-project")
    monkeypatch.chdir(tmp_path)
    runpy.run_path("program.py", run_name="__main__")
    assert (tmp_path / "turn.mp4").is_file()
    assert len(list((tmp_path / "frames").glob("*.spz"))) == 2


@pytest.mark.slow
def test_it_says_why_it_cannot(tmp_path):
    environment = {"PYTHONPATH": str(ROOT), "XDG_DATA_HOME": str(tmp_path), "PATH": "/usr/bin:/bin"}
    done = subprocess.run(
        [sys.executable, str(EXAMPLE), str(tmp_path / "nothing"), str(tmp_path / "out")],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("There is no such folder. Check the path.")
