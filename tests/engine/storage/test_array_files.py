import os
import stat
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from engine.storage.array_files import ArraysError, read_arrays, read_metadata, write_arrays

ARRAYS = {
    "flags": np.array([True, False, True]),
    "none": np.zeros((0, 3), np.float16),
    "one": np.float32(0.5).reshape(()),
    "turned": np.arange(12, dtype=np.float64).reshape(3, 4).T,
}
TEXTS = {"header": '{"a": 1}', "coding": "ü"}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "a.safetensors"
    write_arrays(path, ARRAYS, TEXTS, what="It")
    return path


def same(found: dict[str, np.ndarray]) -> bool:
    return found.keys() == ARRAYS.keys() and all(
        (found[name].dtype, found[name].shape) == (array.dtype, array.shape) and np.array_equal(found[name], array)
        for name, array in ARRAYS.items()
    )


def test_arrays_and_texts_come_back_without_the_checksum(path: Path) -> None:
    arrays, texts = read_arrays(path, TEXTS)
    assert same(arrays)
    assert texts == TEXTS
    texts, sizes = read_metadata(path, TEXTS)
    assert (texts, sizes) == (TEXTS, {name: array.nbytes for name, array in ARRAYS.items()})


@pytest.mark.slow
def test_every_changed_bit_is_refused_or_changes_nothing(path: Path) -> None:
    good = path.read_bytes()
    n_accepted = 0
    for at in range(len(good)):
        for bit in range(8):
            bad = bytearray(good)
            bad[at] ^= 1 << bit
            path.write_bytes(bad)
            try:
                arrays, texts = read_arrays(path, TEXTS)
            except (ArraysError, OSError):
                continue
            n_accepted += 1
            assert same(arrays)
            assert texts == TEXTS
    assert n_accepted < 20  # spaces behind the header that became other white space


@pytest.mark.parametrize("n_bytes", [0, 7, 8, 50, -1])
def test_a_file_that_was_cut_off_is_refused(path: Path, n_bytes: int) -> None:
    path.write_bytes(path.read_bytes()[:n_bytes])
    with pytest.raises(ArraysError):
        read_metadata(path, TEXTS)


def test_a_changed_text_is_seen_without_reading_arrays(path: Path) -> None:
    path.write_bytes(path.read_bytes().replace(b'{\\"a\\": 1}', b'{\\"a\\": 7}'))
    with pytest.raises(ArraysError, match="header does not fit its checksum"):
        read_metadata(path, TEXTS)


def test_changed_numbers_are_named(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[data.index(np.float64(7.0).tobytes())] ^= 1
    path.write_bytes(data)
    assert read_metadata(path, TEXTS)[0] == TEXTS
    with pytest.raises(ArraysError, match="the numbers of turned do not fit their checksum"):
        read_arrays(path, TEXTS)


def test_files_of_earlier_versions_have_no_checksum_and_are_read(path: Path) -> None:
    save_file({name: np.ascontiguousarray(array) for name, array in ARRAYS.items()}, path, metadata=TEXTS)
    arrays, texts = read_arrays(path, TEXTS)
    assert np.array_equal(arrays["turned"], ARRAYS["turned"])
    assert texts == TEXTS


def test_number_types_that_numpy_does_not_know_are_refused(path: Path) -> None:
    text = b'{"a":{"dtype":"F8_E4M3","shape":[4],"data_offsets":[0,4]}}      '
    path.write_bytes(len(text).to_bytes(8, "little") + text + bytes(4))
    with pytest.raises(ArraysError, match="F8_E4M3"):
        read_arrays(path, TEXTS)


def test_pipes_and_folders_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="a pipe or a device"):
        read_arrays(tmp_path / "pipe", TEXTS)
    with pytest.raises(OSError, match="a folder"):
        read_arrays(tmp_path, TEXTS)


def test_others_may_read_what_the_umask_allows(tmp_path: Path) -> None:
    before = os.umask(0o022)
    try:
        write_arrays(tmp_path / "a.safetensors", ARRAYS, TEXTS, what="It")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.safetensors").stat().st_mode) == 0o644
