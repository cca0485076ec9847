"""Runs of ablations."""

from __future__ import annotations

import pytest

from engine.capture.capture import open_capture
from tests.app.lab.ablation.runs import Runner


@pytest.fixture
def runner(tmp_path, capture_folder, monkeypatch) -> Runner:
    return Runner(tmp_path / "a", open_capture(capture_folder), monkeypatch)
