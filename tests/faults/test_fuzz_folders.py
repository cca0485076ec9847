"""The short version of the damaged folders; `python -m tests.faults.fuzz_folders` is the long one."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.project.opening import project_access
from engine.errors import ProjectError
from tests.faults.fuzz_folders import make_foreign, put, run_case, state_of, write_everything
from tests.faults.fuzz_project import make_project
from tests.faults.tally import run_cases


@pytest.mark.slow
def test_nothing_outside_of_a_project_is_touched_whatever_its_folders_are(tmp_path: Path) -> None:
    tally = run_cases("fuzz_folders", run_case, n_cases=80, seed=7, work_dir=tmp_path)
    assert [f"{outcome.verdict}: {outcome.what}: {outcome.detail}" for outcome in tally.faults] == []
    assert {outcome.verdict for outcome in tally.outcomes} == {"typed", "accepted"}


def test_the_script_sees_what_is_touched_outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A guard that cannot fail guards nothing."""
    for name in ("DATA", "CONFIG", "STATE"):
        monkeypatch.setenv(f"XDG_{name}_HOME", str(tmp_path / "home"))
    folder, foreign = tmp_path / "p", tmp_path / "foreign"
    make_project(folder)
    foreign.mkdir()
    make_foreign(foreign, folder)
    before = state_of(foreign)
    put(folder / "live", "link", foreign)
    with pytest.raises(ProjectError, match="symbolic link"):
        write_everything(folder)
    assert state_of(foreign) == before
    monkeypatch.setattr(project_access, "check_folders", lambda folder: None)
    write_everything(folder)
    assert state_of(foreign) != before
