"""Clip files: round trip, damage, atomicity."""

import os

import numpy as np
import pytest

from engine.clip_files.clip_state import (
    ClipState,
    DamagedClip,
    look_at_clip,
    read_clip_header,
    read_clip_state,
    write_clip_state,
)
from engine.errors import ProjectError
from engine.storage.array_files import write_arrays
from tests.clip_headers import header_values, make_header, write_values


def make_state() -> ClipState:
    arrays = {"a": np.arange(6, dtype=np.float32).reshape(2, 3), "b": np.array([True, False]), "none": np.zeros((0, 3))}
    return ClipState(arrays, make_header(step=3))


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
    write_values(tmp_path / "new.safetensors", state.arrays, header_values(schema=99))
    with pytest.raises(ProjectError, match="schema 99"):
        read_clip_state(tmp_path / "new.safetensors")


def test_a_refused_write_leaves_nothing(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    with pytest.raises(ProjectError):
        write_clip_state(blocked / "0000.safetensors", make_state())
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_missing_and_damaged_are_told_apart(tmp_path):
    path = tmp_path / "0000.safetensors"
    assert look_at_clip(path) is None
    write_clip_state(path, make_state())
    assert look_at_clip(path) == make_state().header
    good = path.read_bytes()
    path.write_bytes(good[:100])
    assert isinstance(look_at_clip(path), DamagedClip)
    path.write_bytes(good.replace(b'\\"step\\": 3', b'\\"step\\": 4'))
    assert look_at_clip(path) == DamagedClip(path, "the header does not fit its checksum")
    assert read_clip_header(path) is None
    path.write_bytes(good[:-1] + bytes([good[-1] ^ 1]))
    assert look_at_clip(path) == make_state().header
    with pytest.raises(ProjectError, match="the numbers of b do not fit their checksum"):
        read_clip_state(path)
    path.unlink()
    os.mkfifo(path)
    assert look_at_clip(path) == DamagedClip(path, "it is a pipe or a device, not a file")


@pytest.mark.parametrize(
    "change",
    [
        *({"step": value} for value in ("word", None, -1, 1.5, True, 10**30)),
        *({"role": value} for value in (None, "none", ["reference"], {})),
        *({"spacing": value} for value in ([1], "1", 0, -1.0, float("nan"), float("inf"), 1e300)),
        *({"coverage": value} for value in ([], {"share": {}}, {"share": [1]}, "all")),
        *({"field": value} for value in ({}, [], {"n_knots": 2**23}, 3)),
        *({"decoder": value} for value in ([], {"hidden": -1}, {"hidden": "8"})),
        *({"metrics": value} for value in ([], 3, "none")),
        {"camera_names": [3]},
        {"camera_names": "cam"},
        {"n_anchors": {"static": "many"}},
        {"near_plane": None},
        {"fingerprint": 3},
        {"schema": 0},
        {"schema": "2"},
        {"schema": None},
    ],
)
def test_headers_with_entries_of_another_kind_are_damage(tmp_path, change):
    state, path = make_state(), tmp_path / "0000.safetensors"
    write_values(path, state.arrays, header_values(**change))
    with pytest.raises(ProjectError, match="damaged") as caught:
        read_clip_state(path)
    assert next(iter(change)) in caught.value.message
    assert isinstance(look_at_clip(path), DamagedClip)


@pytest.mark.parametrize(
    "text", ["null", "[]", "3", '"word"', "{", "[" * 100_000, '{"schema": 2' + "0" * 5000 + "}", "{}"]
)
def test_headers_that_are_no_object_are_damage(tmp_path, text):
    path = tmp_path / "0000.safetensors"
    write_arrays(path, {}, {"header": text}, what="It")
    with pytest.raises(ProjectError, match="damaged"):
        read_clip_state(path)
    assert isinstance(look_at_clip(path), DamagedClip)


def test_a_durable_clip_is_flushed(tmp_path, monkeypatch):
    flushed = []
    monkeypatch.setattr("engine.storage.files.os.fsync", flushed.append)
    write_clip_state(tmp_path / "live.safetensors", make_state())
    assert not flushed
    write_clip_state(tmp_path / "kept.safetensors", make_state(), is_durable=True)
    assert len(flushed) == 2  # the file before its rename, the folder after it
