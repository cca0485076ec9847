"""Kills of a real training, a few of them; `python -m tests.faults.kill_training` does many."""

from __future__ import annotations

import random
import shutil
import sys
from pathlib import Path

import pytest

from tests.faults import kill_training
from tests.faults.kill_training import KillTest, Tally
from tests.faults.trainings import FAST, Kept, kept_clips

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are found in /proc"),
]


def _test(work: Path, longest_s: float = 4.0) -> KillTest:
    rng = random.Random(1)
    return KillTest(work, settings=FAST, clips="0:1", every_s=0.5, rng=rng, longest_s=longest_s, after_step_s=1.0)


@pytest.mark.parametrize("kind", ["group", "restart at once", "Ctrl+C"])
def test_a_killed_training_goes_on_and_gives_the_same_bits(undisturbed, tmp_path, monkeypatch, kind):
    monkeypatch.setattr(kill_training, "KINDS", (kind,))
    test = _test(tmp_path)
    test.run(1, undisturbed)
    assert test.tally.faults == []
    assert sum(test.tally.kills.values()) == 1


def test_the_script_sees_a_clip_that_has_changed(undisturbed, undisturbed_project, tmp_path):
    """A guard that cannot fail guards nothing."""
    test = _test(tmp_path)
    other = {0: Kept("other", undisturbed[0].header)}
    test.run(0, other)  # no round: nothing to see
    assert test.tally.faults == []
    project = tmp_path / "project"
    shutil.copytree(undisturbed_project, project)
    test._check(project, {}, other, "here")
    assert "the arrays of clip 0 differ" in test.tally.faults[0]
    (project / "clips" / "0000.safetensors").unlink()
    test.tally = Tally()
    test._check(project, undisturbed, undisturbed, "here")
    assert "has changed or is gone" in test.tally.faults[0]
    assert kept_clips(project) == {}
