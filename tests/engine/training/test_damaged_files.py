"""Checkpoints and backgrounds that are damaged, or do not fit: the first are refused, the second count as missing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.array_files import write_arrays
from engine.errors import ProjectError
from engine.model.clip_state import ClipState, read_clip_state, write_clip_state
from engine.training.checkpoint import read_checkpoint
from engine.training.preparation import BACKGROUNDS_FILE, Backgrounds, read_backgrounds, write_backgrounds
from tests.engine.training.test_clip_training import setting as setting
from tests.engine.training.test_clip_training import source as source

KEY: dict[str, Any] = {"capture": "none", "cameras": ["a", "b"], "size": [13, 6], "frames": 5, "is_corrected": True}


def backgrounds() -> Backgrounds:
    rng = np.random.default_rng(3)
    return Backgrounds(rng.integers(0, 255, (2, 6, 13, 3)).astype(np.uint8), rng.random((2, 6, 13)) > 0.5)


def test_backgrounds_come_back_for_their_key_only(tmp_path: Path) -> None:
    write_backgrounds(tmp_path, backgrounds(), KEY)
    found = read_backgrounds(tmp_path, KEY)
    assert found is not None
    assert found.equals(backgrounds())
    assert read_backgrounds(tmp_path, KEY | {"frames": 6}) is None
    assert read_backgrounds(tmp_path / "none", KEY) is None


def test_backgrounds_with_one_changed_bit_are_made_again(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_backgrounds(tmp_path, backgrounds(), KEY)
    path = tmp_path / BACKGROUNDS_FILE
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    assert read_backgrounds(tmp_path, KEY) is None
    assert str(path) in caplog.text


@pytest.mark.parametrize(
    ("images", "packed"),
    [
        (np.zeros((2, 13, 6, 3), np.uint8), np.zeros((2, 13, 1), np.uint8)),  # height and width exchanged
        (np.zeros((3, 6, 13, 3), np.uint8), np.zeros((3, 6, 2), np.uint8)),
        (np.zeros((2, 6, 13), np.uint8), np.zeros((2, 6, 2), np.uint8)),
        (np.zeros((2, 6, 13, 3), np.float32), np.zeros((2, 6, 2), np.uint8)),
        (np.zeros((2, 6, 13, 3), np.uint8), np.zeros((2, 6, 1), np.uint8)),
    ],
)
def test_backgrounds_that_do_not_fit_the_cameras_are_made_again(tmp_path: Path, images, packed) -> None:
    texts = {"key": json.dumps(KEY, sort_keys=True)}
    write_arrays(tmp_path / BACKGROUNDS_FILE, {"images": images, "is_stable": packed}, texts, what="It")
    assert read_backgrounds(tmp_path, KEY) is None


def damaged_states(state: ClipState) -> dict[str, ClipState]:
    """A checkpoint as versions without checksums could have left it, with one thing wrong each."""
    arrays, header, resume = state.arrays, state.header, state.header["resume"]
    moment = next(name for name in arrays if name.endswith(".exp_avg"))
    gains, images = arrays["resume.gains"], arrays["resume.backgrounds"]
    return {
        "not JSON": ClipState(arrays, header | {"resume": "{"}),
        "no place": ClipState(arrays, {name: value for name, value in header.items() if name != "resume"}),
        "list": ClipState(arrays, header | {"resume": []}),
        "phase 99": ClipState(arrays, header | {"resume": resume | {"phase_index": 99}}),
        "words for steps": ClipState(arrays, header | {"resume": resume | {"steps_in_phase": "many"}}),
        "no order": ClipState(arrays, header | {"resume": resume | {"order": {}}}),
        "no random numbers": ClipState(arrays, header | {"resume": resume | {"generator": [1, 2]}}),
        "no gains": ClipState({name: array for name, array in arrays.items() if name != "resume.gains"}, header),
        "gains of others": ClipState(arrays | {"resume.gains": gains[:2]}, header),
        "gains NaN": ClipState(arrays | {"resume.gains": gains * np.float32("nan")}, header),
        "turned pictures": ClipState(arrays | {"resume.backgrounds": images.swapaxes(1, 2)}, header),
        "short moments": ClipState(arrays | {moment: arrays[moment].reshape(-1)[:1]}, header),
        "no anchors": ClipState({name: a for name, a in arrays.items() if "residual.positions" not in name}, header),
        "no spacing": ClipState(arrays, {name: value for name, value in header.items() if name != "spacing"}),
    }


@pytest.mark.slow
def test_every_damage_to_a_checkpoint_is_an_error_that_names_the_file(source, tmp_path: Path) -> None:
    training = source()
    training.prepare()
    training.step()
    kept = tmp_path / "kept.safetensors"
    training.write_checkpoint(kept)
    good, state = kept.read_bytes(), read_clip_state(kept)
    other = source()
    for name, bad in damaged_states(state).items():
        write_clip_state(kept, bad)
        with pytest.raises(ProjectError) as caught:
            other.restore_checkpoint(kept)
        assert (name, caught.value.path) == (name, kept)
    rng = np.random.default_rng(1)
    for at in rng.integers(0, len(good), 20):
        kept.write_bytes(good[:at] + bytes([good[at] ^ 0x10]) + good[at + 1 :])
        with pytest.raises(ProjectError):
            read_checkpoint(kept, {})
    write_clip_state(kept, ClipState(state.arrays, state.header | {"resume": json.dumps(state.header["resume"])}))
    other = source()
    other.restore_checkpoint(kept)  # as the version before wrote it
    training.step()
    other.step()
    assert other.state().fingerprint == training.state().fingerprint
