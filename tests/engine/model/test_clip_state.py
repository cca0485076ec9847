"""Clip files: round trip, damage, atomicity."""

import numpy as np
import pytest

from engine.errors import ProjectError
from engine.model.clip_header import SCHEMA
from engine.model.clip_state import ClipState, read_clip_state, write_clip_state


def make_state() -> ClipState:
    arrays = {"a": np.arange(6, dtype=np.float32).reshape(2, 3), "b": np.array([True, False]), "none": np.zeros((0, 3))}
    return ClipState(arrays, {"schema": SCHEMA, "role": "reference", "clip_index": 0, "step": 3})


def test_round_trip_keeps_arrays_and_header(tmp_path):
    state = make_state()
    write_clip_state(tmp_path / "0000.safetensors", state)
    found = read_clip_state(tmp_path / "0000.safetensors")
    assert found.header == state.header
    assert all(np.array_equal(found.arrays[name], array) for name, array in state.arrays.items())
    assert found.fingerprint == state.fingerprint
    assert [p.name for p in tmp_path.iterdir()] == ["0000.safetensors"]


def test_fingerprint_sees_every_array():
    state = make_state()
    changed = ClipState(state.arrays | {"b": np.array([True, True])}, state.header)
    assert changed.fingerprint != state.fingerprint


@pytest.mark.parametrize("content", [b"", b"not a clip", b"\xff" * 100])
def test_damaged_files_are_named(tmp_path, content):
    path = tmp_path / "0000.safetensors"
    path.write_bytes(content)
    with pytest.raises(ProjectError, match="damaged") as caught:
        read_clip_state(path)
    assert caught.value.path == path


def test_a_missing_file_and_a_newer_schema_are_told_apart(tmp_path):
    with pytest.raises(ProjectError, match="does not exist"):
        read_clip_state(tmp_path / "none.safetensors")
    state = make_state()
    write_clip_state(tmp_path / "new.safetensors", ClipState(state.arrays, state.header | {"schema": 99}))
    with pytest.raises(ProjectError, match="schema 99"):
        read_clip_state(tmp_path / "new.safetensors")


def test_a_refused_write_leaves_nothing(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    with pytest.raises(ProjectError):
        write_clip_state(blocked / "0000.safetensors", make_state())
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
