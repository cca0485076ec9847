"""Kills of a program that edits, a few of them; `python -m tests.faults.kill_editing` does many, and of the window."""

from __future__ import annotations

import random
import sys
from pathlib import Path

import pytest

from tests.faults.kill_editing import KillTest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a process that is killed there ends otherwise")


@pytest.mark.slow
def test_what_is_edited_outlives_a_kill(tmp_path: Path) -> None:
    test = KillTest(tmp_path, random.Random(3))
    test.run(6)
    assert test.tally.faults == []
    assert sum(test.tally.lost.values()) == 6
    assert test.tally.n_steps > 20


def test_the_script_sees_a_step_that_is_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A guard that cannot fail guards nothing."""
    test = KillTest(tmp_path, random.Random(3))
    said = [*(f"{word} {n}" for n in range(1, 4) for word in ("step", "kept"))]
    monkeypatch.setattr(test, "_kill", lambda seed: (said, "not at all"))
    test.run(1)
    assert "neither step 3 nor the one before; 3 were kept" in test.tally.faults[0]
