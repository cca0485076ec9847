"""Documents with edits of every kind, and names that are hard to quote."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from hypothesis import strategies as st

from engine.editing.actions import Delete, Expose, Hide, Hold, Recolor, Smooth, Transform
from engine.editing.edit import (
    Box,
    Edit,
    Everything,
    KeyedVolume,
    Picked,
    PickedRows,
    Prism,
    Scope,
    Sphere,
    VolumeKey,
)
from engine.editing.picks import pack_rows

HARD_NAMES = (
    "plain",
    "two words",
    'it\'s "quoted"',
    "100 % $HOME `date` \\ !",
    "a\nb\tc",
    "-x",
    "--delete",
    "",
    "ä ß 漢字 🎥",
    "END_OF_INPUT",
    "a;b|c&d>e<f*?[x]{y}~#",
    "\u2018curly\u2019",
)
_SIGNS = st.characters(exclude_categories=("Cs",), exclude_characters="\0")
NAMES = st.sampled_from(HARD_NAMES) | st.text(_SIGNS, max_size=20)
_NUMBERS = st.floats(-1e6, 1e6) | st.sampled_from((1e-7, -3e-5, 1e11, -0.0))
_POSITIVE = st.floats(1e-6, 1e6)
_VECTORS = st.tuples(_NUMBERS, _NUMBERS, _NUMBERS)
_SHARES = st.floats(0.0, 1.0)
_TINTS = st.tuples(_SHARES, _SHARES, _SHARES)


def _unit(numbers: tuple[float, float, float, float]) -> tuple[float, ...]:
    length = math.hypot(*numbers)
    return tuple(number / length for number in numbers)


_QUATS = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 1e-3).map(_unit)
_ROWS = st.lists(st.integers(0, 100_000), min_size=1, max_size=30).map(lambda rows: pack_rows(np.array(rows)))
_TARGETS: Any = st.one_of(
    st.just(Everything()),
    st.builds(Sphere, _VECTORS, _POSITIVE),
    st.builds(Box, _VECTORS, st.tuples(_POSITIVE, _POSITIVE, _POSITIVE), _QUATS),
    st.lists(st.integers(-4, 400), min_size=1, max_size=4, unique=True).map(
        lambda frames: KeyedVolume(
            tuple(VolumeKey(frame / 4, Box((frame / 7, 0.0, 1e-7), (1.0, 2.0, 3.0))) for frame in sorted(frames))
        )
    ),
    st.builds(
        Prism,
        _VECTORS,
        st.tuples(_POSITIVE, _POSITIVE, _POSITIVE),
        st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=3, max_size=9).map(tuple),
        _QUATS,
        st.none() | st.floats(1.01, 100.0),
    ),
    st.lists(st.builds(PickedRows, st.integers(0, 9), st.just("abc"), st.just("static"), _ROWS), max_size=2).map(
        lambda sets: Picked(tuple(sets))
    ),
)
_ACTIONS: Any = st.one_of(
    st.just(Hide()),
    st.just(Delete()),
    st.builds(Transform, _VECTORS, _QUATS, _POSITIVE, _VECTORS),
    st.builds(Recolor, _TINTS, _SHARES, st.floats(0, 100), st.just((1.0, 0.5, 2.0)), _SHARES),
    st.builds(Expose, st.floats(-16, 16)),
    st.builds(Hold, st.integers(0, 2**31 - 1)),
    st.builds(Smooth, st.floats(0.1, 100)),
)
_SCOPES = st.builds(
    lambda first, n, is_reference: Scope(first, None if n is None else first + n, is_reference),
    st.integers(0, 1000),
    st.none() | st.integers(1, 1000),
    st.booleans(),
)
EDITS = st.builds(Edit, st.just(0), NAMES.map(str.strip), _TARGETS, _ACTIONS, _SCOPES, st.booleans(), st.booleans())
"""Edits without a number of their own."""
STACKS = st.lists(EDITS, max_size=4)
