"""A disk that fills up under a real training; `python -m tests.faults.full_disk` tries many sizes."""

from __future__ import annotations

import pytest

from tests.faults.full_disk import can_mount, fill, sizes_kb
from tests.faults.trainings import FAST, Command, Kept, kept_clips

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not can_mount(), reason="needs root, to mount small disks")]


@pytest.fixture(scope="module")
def with_room(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Kept]:
    """The clip of a training that had room."""
    work = tmp_path_factory.mktemp("reference")
    (work / "scratch").mkdir()
    command = Command(work / "project", work / "scratch", FAST, "0:1", every_s=None)
    assert command.wait(300), command.said()
    return kept_clips(work / "project")


@pytest.mark.parametrize("size_kb", [sizes_kb(20)[8]])
def test_training_on_a_disk_that_fills_up_loses_nothing(with_room, tmp_path, size_kb):
    tally = fill(tmp_path, [size_kb], settings=FAST, clips="0:1", expected=with_room)
    assert tally.faults == []
    assert sum(tally.endings.values()) == 1
