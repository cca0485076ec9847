"""Headers are read once for as long as their file stays as it is."""

import numpy as np
import pytest

from app.project.clips import header_cache
from app.project.clips.header_cache import HeaderCache
from engine.clip_files.clip_state import ClipState, write_clip_state
from tests.app.made_projects import clip_header
from tests.clip_headers import make_header


def write(path, step: int) -> None:
    write_clip_state(path, ClipState({"values": np.zeros(step, np.float32)}, clip_header(0, step=step)))


def test_a_header_is_read_again_only_where_its_file_has_changed(tmp_path, monkeypatch):
    looked_at = []
    original = header_cache.look_at_clip
    monkeypatch.setattr(header_cache, "look_at_clip", lambda path: looked_at.append(path) or original(path))
    cache, path = HeaderCache(), tmp_path / "a.safetensors"
    assert cache.read(path) is None
    write(path, 1)
    for _ in range(3):
        found = cache.read(path)
        assert found is not None
        assert found.header is not None
        assert (found.header.step, found.n_bytes, found.damage) == (1, path.stat().st_size, "")
    assert len(looked_at) == 1
    write(path, 2)
    found = cache.read(path)
    assert found is not None
    assert found.header is not None
    assert found.header.step == 2
    assert len(looked_at) == 2
    path.unlink()
    assert cache.read(path) is None


def test_a_damaged_file_says_so_and_is_not_read_over_and_over(tmp_path):
    cache, path = HeaderCache(), tmp_path / "a.safetensors"
    path.write_bytes(b"not a clip")
    found = cache.read(path)
    assert found is not None
    assert found.header is None
    assert found.damage.startswith("The file is damaged (")
    assert cache.read(path) is found


def test_the_exposure_of_a_finished_clip_is_known(tmp_path):
    cache, path = HeaderCache(), tmp_path / "a.safetensors"
    drift = np.full((2, 3, 3), 1.04, np.float32)

    def found(arrays, **entries) -> float | None:
        header = make_header(camera_names=["a", "b"], n_frames=3, **entries)
        write_clip_state(path, ClipState(arrays, header))
        read = cache.read(path)
        assert read is not None
        assert read.header is not None
        return read.exposure_change

    finished = {"metrics": {"held_out_psnr": 30.0}}
    assert found({"log_drift": np.log(drift)}, **finished) == pytest.approx(0.04)
    assert found({"value": np.zeros(1, np.float32)}, **finished) == 0.0
    assert found({"log_drift": np.log(drift), "value": np.zeros(9, np.float32)}) is None, "a snapshot"
    assert found({"log_drift": np.zeros((1, 3, 3), np.float32)}, **finished) is None, "damaged"
