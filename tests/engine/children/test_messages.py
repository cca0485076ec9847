"""Values of declared types cross between processes whole, and nothing else does."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import pytest

from engine.children.messages import decoded, encoded


@dataclass(frozen=True)
class Example:
    path: Path
    number: float
    array: np.ndarray


@pytest.mark.parametrize(
    "array", [np.zeros((2, 0, 3)), np.array(5), np.arange(6.0).reshape(2, 3).T, np.array([True]), np.array(["a"])]
)
@pytest.mark.parametrize("number", [float("inf"), -0.0, np.float32(0.5), np.float64(0.1)])
def test_paths_arrays_and_numbers_come_back(array, number) -> None:
    found = decoded(encoded(Example(Path("a/b"), number, array)), Example)
    assert (found.path, found.number) == (Path("a/b"), number)
    np.testing.assert_array_equal(found.array, array)
    assert found.array.dtype == array.dtype
    assert np.isnan(decoded(encoded(float("nan")), float))


def test_what_is_not_data_does_not_cross() -> None:
    for value in (object(), print, np.array([object()])):
        with pytest.raises(NotImplementedError, match="cannot cross"):
            encoded(value)
    with pytest.raises(msgspec.DecodeError):
        decoded(encoded(("|O", (1,), b"12345678")), np.ndarray)
    with pytest.raises(msgspec.DecodeError):
        decoded(encoded("text"), float)
