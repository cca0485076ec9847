"""Files of a project on a disk that refuses: typed errors, nothing left behind. /dev/full is a disk without room."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open

from engine.clip_files.clip_state import ClipState, write_clip_state
from engine.errors import DiskError
from engine.storage.array_files import write_arrays
from engine.storage.files import checked_path, partial_path
from engine.training.preparation.cloud_preparation import BACKGROUNDS_FILE, Backgrounds, write_backgrounds
from tests.clip_headers import make_header

needs_full = pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")


def without_room(path: Path) -> Path:
    """Make the draft of a file end on a full disk."""
    partial_path(path).symlink_to("/dev/full")
    return path


@needs_full
def test_a_clip_that_does_not_fit_is_a_typed_error_and_leaves_nothing(tmp_path):
    path = without_room(tmp_path / "0000.safetensors")
    with pytest.raises(DiskError, match=r"The clip could not be written \(No space left on device\)"):
        write_clip_state(path, ClipState({"value": np.zeros(100_000, np.float32)}, make_header()))
    assert not list(tmp_path.iterdir())


@needs_full
def test_backgrounds_that_do_not_fit_are_a_typed_error(tmp_path):
    without_room(tmp_path / BACKGROUNDS_FILE)
    backgrounds = Backgrounds(np.zeros((2, 60, 80, 3), np.uint8), np.ones((2, 60, 80), bool))
    with pytest.raises(DiskError, match="No space left"):
        write_backgrounds(tmp_path, backgrounds, {})
    assert not list(tmp_path.iterdir())


def test_a_rename_that_fails_is_a_typed_error_and_keeps_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "kept"
    path.write_text("old")

    def fail(*_args):
        raise OSError(116, "Stale file handle")

    monkeypatch.setattr("engine.storage.files.os.replace", fail)
    with pytest.raises(DiskError, match="Stale file handle"), checked_path(path, what="It") as partial:
        partial.write_text("new")
    assert [entry.name for entry in tmp_path.iterdir()] == ["kept"]
    assert path.read_text() == "old"


def test_arrays_of_every_kind_read_back_as_they_were(tmp_path):
    rng = np.random.default_rng(0)
    arrays = {
        "bits": rng.random((3, 5)) > 0.5,
        "bytes": rng.integers(0, 255, 7).astype(np.uint8),
        "counts": rng.integers(-9, 9, (2, 3)),
        "half": rng.normal(size=9).astype(np.float16),
        "nothing": np.zeros((0, 3), np.float32),
        "one": np.float64(0.5).reshape(()),
        "turned": rng.normal(size=(4, 6)).astype(np.float32).T,
    }
    path = tmp_path / "a.safetensors"
    write_arrays(path, arrays, {"said": "ü"}, what="It")
    with safe_open(path, framework="numpy") as file:
        assert file.metadata()["said"] == "ü"
        assert set(file.keys()) == set(arrays)
        for name, array in arrays.items():
            read = file.get_tensor(name)
            assert (read.dtype, read.shape) == (array.dtype, array.shape)
            np.testing.assert_array_equal(read, array)
