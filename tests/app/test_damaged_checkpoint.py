"""A damaged checkpoint costs what it held: the clip starts from the beginning, says so, and is trained to its end."""

from __future__ import annotations

import pytest

from app.training import messages as m
from tests.app.test_run import bench as bench


def flip(data: bytes) -> bytes:
    return data[:-1] + bytes([data[-1] ^ 1])


def change_header(data: bytes) -> bytes:
    assert b'\\"step\\": 3' in data
    return data.replace(b'\\"step\\": 3', b'\\"step\\": 4')


def cut(data: bytes) -> bytes:
    return data[: len(data) // 2]


@pytest.mark.parametrize("damage", [flip, change_header, cut])
def test_a_damaged_checkpoint_starts_its_clip_again_and_says_so(bench, damage):
    it = bench(n_steps=6)
    it.steps(4)
    it.commands.append(m.Stop(keep=True))
    it.steps(1)
    it.checkpoint.write_bytes(damage(it.checkpoint.read_bytes()))
    it.events.clear()
    it.start()
    assert it.steps(20) is False
    warning = it.of(m.WarningRaised)[0]
    assert warning.title == "Clip 0 starts from the beginning"
    assert "damaged" in warning.detail
    assert str(it.checkpoint) in warning.detail
    assert "train the clip again" not in warning.detail  # that is what happens
    assert it.of(m.StepReported)[0].step == 0
    assert isinstance(it.events[-1], m.ClipTrained)
