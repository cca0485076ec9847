"""A preparation that was interrupted goes on behind its finished pieces and gives the same bits."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from engine.training.clip_training import ClipTraining
from engine.training.preparation import stages
from engine.training.preparation.stages import Stages, remove_stages, stage_files
from tests.engine.training.tiny_training import finish, same_arrays

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def depth_maps_once() -> None:
    """Here they are found each time: they are among what is kept."""


class Killed(BaseException):
    """In place of a kill: nothing handles it."""


class Slow:
    """A clock that runs only where the test lets work take time."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.n_done: dict[str, int] = {}

    def work(self, name: str, value: float, *, seconds: float):
        def do():
            self.now_s += seconds
            self.n_done[name] = self.n_done.get(name, 0) + 1
            return {"value": np.array([value]), "image": np.full((2, 3), value, np.uint8)}

        return do


@pytest.fixture
def slow() -> Slow:
    return Slow()


def _stages(folder: Path, slow: Slow, *, key=None, said=None, clip_index=0) -> Stages:
    told = [] if said is None else said
    report = lambda progress: told.append(progress.message)  # noqa: E731
    return Stages(folder, clip_index, key or {"capture": "a"}, report, clock=lambda: slow.now_s)


def test_what_took_long_is_not_done_again(tmp_path, slow):
    first = _stages(tmp_path, slow)
    for name in ("a", "b", "c"):
        first.keep(name, slow.work(name, ord(name), seconds=stages.WRITE_AFTER_S / 2))
    said: list[str] = []
    second = _stages(tmp_path, slow, said=said)
    kept = second.keep("b", slow.work("b", 0, seconds=1))
    assert kept["value"][0] == ord("b")
    assert kept["image"].dtype == np.uint8
    second.keep("c", slow.work("c", ord("c"), seconds=1))  # too little had gathered to be written
    assert slow.n_done == {"a": 1, "b": 1, "c": 2}
    assert said == ["2 steps of the preparation are reused from an earlier attempt"]


def test_no_more_work_gathers_unwritten_than_is_said(tmp_path, slow):
    keeper = _stages(tmp_path, slow)
    for i in range(100):
        keeper.keep(f"piece {i}", slow.work("piece", i, seconds=0.4))
    n_kept = len({name for path in stage_files(tmp_path, 0) for name in stages.read_metadata(path, ("key",))[1]}) / 2
    assert (100 - n_kept) * 0.4 <= stages.WRITE_AFTER_S
    assert len(stage_files(tmp_path, 0)) <= 100 * 0.4 / stages.WRITE_AFTER_S


def test_pieces_of_other_settings_are_removed_with_a_word(tmp_path, slow):
    _stages(tmp_path, slow).keep("a", slow.work("a", 1, seconds=9))
    said: list[str] = []
    other = _stages(tmp_path, slow, key={"capture": "b"}, said=said)
    assert other.keep("a", slow.work("a", 2, seconds=0))["value"][0] == 2
    assert "are outdated" in said[0]
    assert stage_files(tmp_path, 0) == []


def test_pieces_of_a_setting_that_is_retired_are_taken_over(tmp_path, slow):
    before, now = {"config": {"backend": "reference", "tiles": "all"}}, {"config": {"tiles": "all"}}
    _stages(tmp_path, slow, key=before).keep("a", slow.work("a", 1, seconds=9))
    assert _stages(tmp_path, slow, key=now).keep("a", slow.work("a", 2, seconds=9))["value"][0] == 1


def test_the_code_that_made_a_piece_counts(tmp_path, slow, monkeypatch):
    _stages(tmp_path, slow).keep("a", slow.work("a", 1, seconds=9))
    monkeypatch.setattr(stages, "VERSION", stages.VERSION + 1)
    assert _stages(tmp_path, slow).keep("a", slow.work("a", 2, seconds=0))["value"][0] == 2


@pytest.mark.parametrize("at", [20, -2], ids=["header", "arrays"])
def test_a_damaged_piece_is_done_again_with_a_word(tmp_path, slow, at):
    _stages(tmp_path, slow).keep("a", slow.work("a", 1, seconds=9))
    (path,) = stage_files(tmp_path, 0)
    data = bytearray(path.read_bytes())
    data[at] ^= 4
    path.write_bytes(data)
    said: list[str] = []
    again = _stages(tmp_path, slow, said=said)
    assert again.keep("a", slow.work("a", 1, seconds=9))["value"][0] == 1
    assert any("is damaged" in line and path.name in line for line in said)
    assert slow.n_done == {"a": 2}


def test_a_full_disk_costs_the_pieces_and_is_told_once(tmp_path, slow, monkeypatch):
    def refuse(*_args):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("os.replace", refuse)
    said: list[str] = []
    keeper = _stages(tmp_path, slow, said=said)
    for name in ("a", "b", "c"):
        assert keeper.keep(name, slow.work(name, ord(name), seconds=9))["value"][0] == ord(name)
    assert len(said) == 1
    assert "No space left on device" in said[0]
    assert not list(tmp_path.iterdir())


def test_a_finished_clip_forgets_its_own_pieces_only(tmp_path, slow):
    for clip_index in (0, 1):
        _stages(tmp_path, slow, clip_index=clip_index).keep("a", slow.work("a", 1, seconds=9))
    remove_stages(tmp_path, 0)
    assert (len(stage_files(tmp_path, 0)), len(stage_files(tmp_path, 1))) == (0, 1)


@pytest.mark.parametrize("kind", ["reference", "source", "inherit=off"])
def test_interrupted_anywhere_the_clip_is_the_same_bit_for_bit(tiny, tmp_path, monkeypatch, kind):
    """Interrupted after every piece in turn, in the preparation and in the change of phase."""
    settings = {"inherit=off": {"inherit": "off"}}.get(kind, {})
    is_source = kind in ("source", "inherit=off")

    def make(folder: Path) -> ClipTraining:
        return tiny.training(int(is_source), is_source=is_source, prep_dir=folder, **settings)

    def train(folder: Path) -> ClipTraining:
        training = make(folder)
        training.prepare()
        finish(training)
        return training

    expected = train(tmp_path / "straight").state()
    monkeypatch.setattr(stages, "WRITE_AFTER_S", 0.0)  # every piece is written
    write, budget = Stages._write, [0]
    done: list[str] = []

    def write_and_die(self) -> None:
        done.extend(self._pending)
        write(self)
        budget[0] -= 1
        if budget[0] == 0:
            raise Killed

    monkeypatch.setattr(Stages, "_write", write_and_die)
    folder = tmp_path / "killed"
    n_killed, training = 0, None
    while training is None:
        budget[0] = 6  # pieces further in each attempt
        try:
            training = train(folder)
        except Killed:
            n_killed += 1
    assert n_killed >= 2
    assert len(done) == len(set(done))  # nothing was done twice
    assert same_arrays(training.state().arrays, expected.arrays)
    assert training.state().header == expected.header
