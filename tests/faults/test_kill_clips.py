"""Kills of `train --clip` as a scheduler runs it, a few of them; `python -m tests.faults.kill_clips` does many."""

from __future__ import annotations

import random
import sys
from pathlib import Path

import pytest

from tests.faults import kill_clips
from tests.faults.kill_clips import ClipKills

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are found in /proc"),
]


def test_clips_of_killed_processes_are_trained_once_each(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kill_clips, "N_CLIPS", 3)
    test = ClipKills(tmp_path, [tmp_path / "projects"], random.Random(1), n_at_once=2)
    test.run(4, test.reference())
    assert test.tally.faults == []
    assert test.tally.n_kills >= 4
