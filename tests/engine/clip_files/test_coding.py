"""Codecs: what comes back is within the stated error, in few bytes; damage is noticed before anything is unpacked."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_numpy

from engine.clip_files.coding import MAX_BYTES, CodingError, decode_array, encode_array

FLOATS = st.floats(width=32, allow_nan=False, allow_infinity=False)  # denormals and 3e38 included
ROWS = st_numpy.arrays(np.float32, st.tuples(st.integers(0, 9), st.integers(1, 3)), elements=FLOATS)
TABLES = st_numpy.arrays(
    np.float32,
    st.tuples(st.integers(1, 2), st.integers(1, 9), st.integers(1, 3)),
    elements=FLOATS | st.just(0.0),
)


def round_trip(array: np.ndarray, codec: str, **options) -> np.ndarray:
    """Encode, decode, and see that every value is within what was stated."""
    coded = encode_array(array, codec, **options)
    found = decode_array(coded.payload, coded.spec)
    assert (found.shape, found.dtype) == (array.shape, array.dtype)
    if array.dtype.kind == "f":
        errors = np.abs(found.astype(np.float64) - array)
        assert (errors <= coded.bounds).all()
        assert errors.max(initial=0.0) <= coded.spec["max_error"]
    return found


@settings(max_examples=80, deadline=None)
@given(ROWS, st.sampled_from([2, 6, 7, 8, 16]))
def test_steps_are_within_half_a_step_per_channel(array, bits):
    found = round_trip(array, "steps", bits=bits)
    if len(array):
        values = array.astype(np.float64)
        step = np.ptp(values, axis=0) / (2**bits - 2)
        rounding = np.abs(values).max(0) * 2.0**-23 + 2.0**-148  # of float32
        assert (np.abs(found.astype(np.float64) - values).max(0) <= 0.5001 * step + rounding).all()
        assert (found[:, step == 0] == array[:, step == 0]).all()  # a constant channel is exact


@settings(max_examples=50, deadline=None)
@given(TABLES)
def test_zero_rows_of_a_table_stay_zero_and_the_others_near(array):
    found = round_trip(array, "steps", bits=7)
    assert not found[(array == 0).all(-1)].any()


def test_zero_rows_of_a_table_cost_a_bit_and_not_a_value():
    table = np.zeros((2, 4096, 4), np.float32)
    table[:, ::8] = np.random.default_rng(0).normal(size=(2, 512, 4))
    coded = encode_array(table, "steps", bits=8)
    assert len(coded.payload) < 2 * 512 * 4 + 2 * 4096 / 8 + 300  # bytes of values, bits of rows, sizes of steps


def test_few_bits_take_few_bytes():
    values = np.random.default_rng(0).normal(size=(4000, 16)).astype(np.float32)
    n_bytes = {bits: len(encode_array(values, "steps", bits=bits).payload) for bits in (8, 7, 6, 4)}
    assert n_bytes[8] < values.nbytes / 4
    assert n_bytes[4] < n_bytes[6] < n_bytes[7] < n_bytes[8]


def test_one_wild_value_costs_its_own_channel_only():
    values = np.random.default_rng(0).normal(size=(100, 2)).astype(np.float32)
    values[3, 0] = 1e30
    found = round_trip(values, "steps", bits=8)
    assert np.abs(found[:, 1] - values[:, 1]).max() < 0.02


@settings(max_examples=80, deadline=None)
@given(
    st_numpy.arrays(
        np.float32, st_numpy.array_shapes(max_dims=3, min_side=0), elements=st.floats(-65504, 65504, width=32)
    )
)
def test_half_precision_is_within_its_rounding(array):
    round_trip(array, "half")


@settings(max_examples=30, deadline=None)
@given(st_numpy.arrays(np.bool_, st_numpy.array_shapes(max_dims=3, min_side=0)))
def test_bits_are_exact(array):
    assert np.array_equal(round_trip(array, "bits"), array)


@pytest.mark.parametrize("dtype", ["bool", "uint8", "int32", "int64", "float16", "float32", "float64"])
@pytest.mark.parametrize("shape", [(), (0, 3), (1,), (5, 3), (2, 3, 4)])
def test_exact_is_exact(dtype, shape):
    array = (np.random.default_rng(0).normal(size=shape) * 100).astype(dtype)
    assert np.array_equal(round_trip(array, "exact"), array)


@settings(max_examples=30, deadline=None)
@given(
    st_numpy.arrays(np.int64, st.tuples(st.integers(0, 30), st.just(3)), elements=st.integers(-400, 400)),
    st.floats(1e-4, 1e3),
    st.floats(-1e3, 1e3),
)
def test_positions_on_a_lattice_come_back_to_float_rounding(steps, spacing, origin):
    positions = (origin + (steps + 0.5) * spacing).astype(np.float32)
    if len(steps) and np.abs(positions).max() * 2.0**-20 > spacing:
        return  # neighbours on such a lattice are hardly apart in float32
    given_spacing = float(np.float32(spacing))  # as a header may have it
    coded = encode_array(positions, "lattice", spacing=given_spacing)
    found = decode_array(coded.payload, coded.spec)
    reach = np.abs(positions).max(initial=0.0)
    assert np.abs(found - positions).max(initial=0.0) <= coded.spec["max_error"] <= reach * 2.0**-21 + 1e-40


def test_positions_beside_the_lattice_are_refused():
    positions = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    with pytest.raises(CodingError, match="beside a lattice"):
        encode_array(positions, "lattice", spacing=0.1)


@pytest.mark.parametrize("codec", ["exact", "half", "steps"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_none_are_refused(codec, bad):
    with pytest.raises(CodingError, match="not finite"):
        encode_array(np.array([[1.0], [bad]], np.float32), codec)


def test_what_a_codec_cannot_hold_is_refused():
    for array, codec in (
        (np.full((2, 2), 1e5, np.float32), "half"),
        (np.zeros((2, 2)), "steps"),
        (np.zeros(4, np.float32), "steps"),
        (np.zeros(4, np.float32), "bits"),
        (np.zeros(4, np.complex64), "exact"),
    ):
        with pytest.raises(CodingError):
            encode_array(array, codec)


@pytest.mark.parametrize(
    "damage",
    [
        {"shape": [9, 4]},
        {"shape": [-1, 4]},
        {"shape": [1 << 40, 4]},
        {"shape": "wide"},
        {"shape": [32]},
        {"dtype": "O"},
        {"dtype": "<f8"},
        {"dtype": 7},
        {"n_bytes": 5},
        {"n_bytes": float("inf")},
        {"n_bytes": MAX_BYTES + 1},
        {"n_bytes": 1 << 20},
        {"crc32": 1},
        {"codec": "pickle"},
        {"codec": "lattice"},
        {"codec": "half"},
        {"bits": 12},
        {"bits": None},
    ],
)
def test_a_description_that_lies_is_refused(damage):
    coded = encode_array(np.random.default_rng(0).normal(size=(8, 4)).astype(np.float32), "steps")
    with pytest.raises(CodingError):
        decode_array(coded.payload, coded.spec | damage)


def test_damaged_bytes_are_refused():
    coded = encode_array(np.random.default_rng(0).normal(size=(200, 4)).astype(np.float32), "steps")
    for n in (0, 1, len(coded.payload) // 2, len(coded.payload) - 1):
        with pytest.raises(CodingError):
            decode_array(coded.payload[:n], coded.spec)
    for at in range(0, len(coded.payload), 37):
        changed = coded.payload.copy()
        changed[at] ^= 0x55
        with pytest.raises(CodingError):
            decode_array(changed, coded.spec)


def test_a_small_file_that_unpacks_to_much_stops_at_its_promise():
    coded = encode_array(np.zeros((1 << 20,), np.uint8), "exact")
    assert len(coded.payload) < 1000
    with pytest.raises(CodingError, match="of 64 bytes"):
        decode_array(coded.payload, coded.spec | {"n_bytes": 64, "shape": [64]})
