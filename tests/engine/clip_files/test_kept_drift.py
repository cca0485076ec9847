"""The exposure that a clip file holds, read without the rest."""

import numpy as np
import pytest

from engine.clip_files.clip_state import ClipState, write_clip_state
from engine.clip_files.kept_drift import mean_change, read_drift
from engine.errors import ProjectError
from tests.clip_headers import make_header

DRIFT = np.exp(np.random.default_rng(0).normal(0, 0.03, (2, 4, 3))).astype(np.float32)


def write(path, **arrays: np.ndarray) -> None:
    write_clip_state(path, ClipState(arrays, make_header(camera_names=["a", "b"], n_frames=4)))


def test_it_is_what_was_written(tmp_path):
    path = tmp_path / "clip.safetensors"
    write(path, log_drift=np.log(DRIFT), other=np.zeros(9, np.float32))
    assert read_drift(path) == pytest.approx(DRIFT)
    write(path, other=np.zeros(9, np.float32))
    assert read_drift(path) is None


def test_damage_of_other_arrays_does_not_matter_and_that_of_its_own_does(tmp_path):
    path = tmp_path / "clip.safetensors"
    write(path, log_drift=np.log(DRIFT), zeros=np.full(999, 0.75, np.float32))
    whole = path.read_bytes()
    other, own = whole.rindex(np.float32(0.75).tobytes()), whole.index(np.log(DRIFT).tobytes())
    for place, is_read in ((other, True), (own, False)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        if is_read:
            assert read_drift(path) == pytest.approx(DRIFT)
        else:
            with pytest.raises(ProjectError, match="do not fit their checksum"):
                read_drift(path)


def test_one_that_does_not_fit_the_clip_is_refused(tmp_path):
    path = tmp_path / "clip.safetensors"
    write(path, log_drift=np.log(DRIFT[:, :3]))
    with pytest.raises(ProjectError, match="exposure of the cameras"):
        read_drift(path)


def test_the_mean_change_has_no_sign():
    assert mean_change(None) == 0.0
    assert mean_change(np.array([[[1.1] * 3], [[1 / 1.1] * 3]])) == pytest.approx(0.1)
