"""Runs of ablations, and the command line around them."""

from __future__ import annotations

from functools import partial

import pytest

from app.cli import main
from engine.capture.capture import open_capture
from tests.app.ablation.runs import Runner
from tests.app.conftest import inline
from tests.app.fakes import make_fake


@pytest.fixture
def runner(tmp_path, capture_folder, monkeypatch) -> Runner:
    return Runner(tmp_path / "a", open_capture(capture_folder), monkeypatch)


@pytest.fixture
def run(capsys):
    def run_command(*arguments: object) -> tuple[int, str, str]:
        code = main([str(part) for part in arguments], launch=partial(inline, make_training=make_fake))
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run_command
