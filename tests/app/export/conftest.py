"""A made project with two clips of three frames that can be rendered."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.evaluation.headless import TrainedProject, open_trained
from app.project.opening.project_access import open_project
from tests.app.residuals.conftest import make_project


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """The project's folder; frames 0 to 5 of four cameras."""
    return make_project(tmp_path)


@pytest.fixture
def opened(project: Path) -> TrainedProject:
    """The project, opened for reading."""
    return open_trained(open_project(project, is_writable=False))
