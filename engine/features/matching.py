"""Matches of two cameras: matches of SIFT features, checked for some epipolar geometry, but not for a known one.

So a camera whose calibration is wrong has as many matches as the others, and they show that it is wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from engine.features.child import arrays_kind, work_on_arrays
from engine.features.sift_memory import n_at_once, sift_bytes

MAX_FEATURES = 1536
"""Limit of features of one picture: a pair of cameras needs no more to be judged."""
MAX_SIFT_BYTES = 300 << 20
"""Limit of the memory of pictures whose key points are looked for."""
CHILD_BYTES = 170 << 20
"""The child's memory apart from that, and from the pictures: its libraries, and matching."""
MATCHING = arrays_kind("engine.features.matching:MATCHING", "engine.features.match_child:main", "the matching process")


@dataclass(frozen=True, slots=True)
class PairMatches:
    """The matches of two pictures.

    Attributes:
        first, second: Rows of the pictures.
        pixels: In the first, x and y, centres at +0.5. [M, 2] float64
        other_pixels: In the second. [M, 2] float64
        features: Numbers of the features in both pictures; the same number is the same place. [M, 2] int64
    """

    first: int
    second: int
    pixels: np.ndarray
    other_pixels: np.ndarray
    features: np.ndarray

    def __len__(self) -> int:
        return len(self.pixels)


@dataclass(frozen=True, slots=True)
class Matches:
    """Of several pairs of pictures. n_features: of each picture. [C]"""

    pairs: tuple[PairMatches, ...]
    n_features: np.ndarray


def matching_bytes(n: int, width: int, height: int) -> int:
    """The memory of `match_pairs`'s child process for n pictures of this size, roughly."""
    at_once = min(n_at_once(width, height, MAX_SIFT_BYTES), n)
    return CHILD_BYTES + 3 * n * width * height + at_once * sift_bytes(width, height)


def match_pairs(
    images: np.ndarray,
    pairs: Sequence[tuple[int, int]],
    *,
    alive: Callable[[], None] = lambda: None,
    max_features: int = MAX_FEATURES,
) -> Matches:
    """Match SIFT features between pairs of pictures.

    Args:
        images: [C, H, W, 3] uint8
        pairs: Rows of two pictures, each pair once.
        alive: Called several times a second; what it raises ends the work.
    Returns:
        As many pairs as were asked for, in their order; those without matches are empty.
    Raises:
        ChildFailed: pycolmap's process gave no result; says why.
        DiskError: There is no room for the pictures that it reads.
    """
    listed = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    limits = {"max_features": np.array(max_features), "max_bytes": np.array(MAX_SIFT_BYTES)}
    arrays = {"images": images, "pairs": listed, **limits}
    answer = work_on_arrays(MATCHING, arrays, alive=alive)
    ends = np.cumsum(answer["counts"])
    found = []
    for (first, second), start, end in zip(listed.tolist(), ends - answer["counts"], ends, strict=True):
        pixels = answer["pixels"][start:end].astype(np.float64)
        found.append(PairMatches(first, second, pixels[:, :2], pixels[:, 2:], answer["rows"][start:end]))
    return Matches(tuple(found), answer["n_features"])
