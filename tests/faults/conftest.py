"""The training that the others are compared with."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.built_once import BuiltOnce
from tests.faults.trainings import FAST, Command, Kept, kept_clips


@pytest.fixture(scope="session")
def undisturbed_project(tmp_path_factory: pytest.TempPathFactory, built_once: BuiltOnce) -> Path:
    """A project with one clip, from a training that had time and room."""
    work = tmp_path_factory.mktemp("undisturbed")

    def train(folder: Path) -> None:
        (work / "scratch").mkdir()
        command = Command(folder / "project", work / "scratch", FAST, "0:1", every_s=None)
        assert command.wait(600), command.said()
        assert command.process.returncode == 0, command.said()

    return (
        built_once.copy("undisturbed", work / "kept", train, sources=["app", "tests/faults/trainings.py"]) / "project"
    )


@pytest.fixture(scope="session")
def undisturbed(undisturbed_project: Path) -> dict[int, Kept]:
    """Its clip."""
    return kept_clips(undisturbed_project)
