"""The end of a clip on a disk that refuses: what was trained is still there; the next attempt gives the same bits."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from engine.errors import DiskError
from engine.training.clip_training import ClipTraining
from engine.training.preparation.cloud_preparation import BACKGROUNDS_FILE
from tests.engine.training.tiny_training import finish, same_arrays

pytestmark = pytest.mark.slow


def _reference(tiny, folder: Path) -> ClipTraining:
    return tiny.training(0, is_source=False, prep_dir=folder)


@pytest.mark.parametrize("is_source", [False, True])
def test_a_checkpoint_of_a_finished_clip_only_has_to_be_written(tiny, tmp_path, is_source):
    def make() -> ClipTraining:
        return tiny.training(1) if is_source else _reference(tiny, tmp_path)

    training = make()
    training.prepare()
    finish(training)
    compact = training.finish()
    training.write_checkpoint(tmp_path / "kept.safetensors")
    resumed = make()
    resumed.restore_checkpoint(tmp_path / "kept.safetensors")
    assert resumed.is_finished
    assert same_arrays(resumed.finish().state.arrays, compact.state.arrays)


def test_backgrounds_that_cannot_be_kept_hold_up_the_end_of_the_reference_and_nothing_else(tiny, tmp_path, monkeypatch):
    replace = os.replace

    def refuse(source, target):
        if Path(target).name == BACKGROUNDS_FILE:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        replace(source, target)

    monkeypatch.setattr("os.replace", refuse)
    training = tiny.training(0, is_source=False, prep_dir=tmp_path)
    training.prepare()
    trained = finish(training)
    with pytest.raises(DiskError, match="No space left"):
        training.finish()
    assert training.state().fingerprint == trained.fingerprint
    monkeypatch.undo()
    training.finish()
    assert (tmp_path / BACKGROUNDS_FILE).read_bytes() == (tiny.prep_dir / BACKGROUNDS_FILE).read_bytes()
