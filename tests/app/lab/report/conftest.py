"""A trained project whose report draws in no time."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.app.lab.report.made_up import draw_nothing, train


@pytest.fixture
def quick_charts(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests that look at words and numbers only."""
    draw_nothing(monkeypatch)


@pytest.fixture
def project(tmp_path: Path, capture_folder: Path, quick_charts: None) -> Path:
    return train(tmp_path / "p", capture_folder)
