"""Clip files written again with some rows gone: what is read is exactly what was given, in no more bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_numpy

from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state, write_coded_arrays
from engine.clip_files.coding import CodingError, decode_array, encode_array, encode_on_grid_of
from engine.clip_files.rewriting import rewrite_clip
from tests.clip_headers import make_header

FLOATS = st.floats(-1e6, 1e6, width=32, allow_nan=False)
ROWS = st_numpy.arrays(np.float32, st.tuples(st.integers(1, 12), st.integers(1, 3)), elements=FLOATS)


@settings(max_examples=60, deadline=None)
@given(ROWS, st.sampled_from([2, 6, 7, 8, 16]), st.integers(0, 2**12 - 1))
def test_rows_of_what_was_read_lie_on_its_grid(array, bits, kept):
    coded = encode_array(array, "steps", bits=bits)
    read = decode_array(coded.payload, coded.spec)
    rows = read[[row for row in range(len(read)) if kept >> row & 1]]
    try:
        again = encode_on_grid_of(rows, coded)
    except CodingError:  # numbers too large for the grid to be exact: they are stored as they are
        assert np.abs(read).max() > 1e3 * np.ptp(read, axis=0).min()
        return
    assert decode_array(again.payload, again.spec).tobytes() == rows.tobytes()
    assert (again.spec["codec"], again.spec["shape"]) == ("steps", list(rows.shape))


def test_positions_stay_on_their_lattice():
    steps = np.random.default_rng(0).integers(-40, 40, (50, 3))
    positions = (np.array([0.3, -1.2, 7.0]) + 0.05 * steps).astype(np.float32)
    coded = encode_array(positions, "lattice", spacing=0.05)
    read = decode_array(coded.payload, coded.spec)
    again = encode_on_grid_of(read[::3], coded)
    assert decode_array(again.payload, again.spec).tobytes() == read[::3].tobytes()


def test_what_lies_beside_the_grid_is_refused():
    coded = encode_array(np.linspace(0, 1, 30, dtype=np.float32).reshape(10, 3), "steps", bits=6)
    with pytest.raises(CodingError):
        encode_on_grid_of(np.full((2, 3), 0.123456, np.float32), coded)
    with pytest.raises(CodingError):
        encode_on_grid_of(np.zeros((2, 4), np.float32), coded)
    with pytest.raises(CodingError):
        encode_on_grid_of(np.zeros((2, 3), np.float32), encode_array(np.zeros((2, 3), np.float32), "half"))


@pytest.mark.parametrize("is_coded", [False, True])
def test_a_file_is_written_in_the_form_that_it_had(tmp_path: Path, is_coded: bool):
    rows = np.linspace(0, 1, 18, dtype=np.float32).reshape(6, 3)
    arrays = {f"sets.static.{name}": rows for name in ("positions", "color_logits", "log_offset_scales")}
    arrays |= {"sets.static.features": np.tile(rows, 4), "sets.static.log_base_scales": rows - 2.0}
    arrays |= {"decoder.first.color": np.ones((4, 4), np.float32)}
    header = make_header()
    if is_coded:
        codecs = {"positions": ("steps", {"bits": 8}), "features": ("half", {})}
        coded = {
            name: encode_array(
                array,
                codecs.get(name.rpartition(".")[2], ("exact", {}))[0],
                **codecs.get(name.rpartition(".")[2], ("", {}))[1],
            )
            for name, array in arrays.items()
        }
        write_coded_arrays(tmp_path / "a", coded, header)
    else:
        write_clip_state(tmp_path / "a", ClipState(arrays, header))
    state = read_clip_state(tmp_path / "a")
    changed = {name: array[::2] if name.startswith("sets.") else array for name, array in state.arrays.items()}
    changed["inherited.moving.is_hidden"] = np.array([True, False, True])
    new = ClipState(changed, header).stamped()
    rewrite_clip(tmp_path / "a", tmp_path / "b", new)
    found = read_clip_state(tmp_path / "b")
    assert found.fingerprint == new.fingerprint == found.header.fingerprint
    assert (tmp_path / "b").stat().st_size <= (tmp_path / "a").stat().st_size + 400
