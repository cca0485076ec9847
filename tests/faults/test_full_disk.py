"""A disk that fills up under a real training; `python -m tests.faults.full_disk` tries many sizes."""

from __future__ import annotations

import pytest

from tests.faults.full_disk import can_mount, fill, sizes_kb
from tests.faults.trainings import FAST, PATIENCE

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not can_mount(), reason="needs root, to mount small disks")]


@pytest.mark.parametrize("size_kb", [sizes_kb(20)[8]])
def test_training_on_a_disk_that_fills_up_loses_nothing(undisturbed, tmp_path, monkeypatch, size_kb):
    monkeypatch.setenv(PATIENCE, "3")
    tally = fill(tmp_path, [size_kb], settings=FAST, clips="0:1", expected=undisturbed)
    assert tally.faults == []
    assert sum(tally.endings.values()) == 1
