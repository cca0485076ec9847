"""Compares a picture with a stored one: a tolerance per channel, and a number of pixels that may exceed it.

The tolerance is never zero, because drivers compile to different code on different processors; the allowance is small,
because a moved line fails many pixels at once. New golden pictures are written by `--update-golden` and looked at.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
GOLDEN_FOLDER = ROOT / "tests" / "golden"
FAILURE_FOLDER = ROOT / "out" / "golden"
TOLERANCE = 3
"""Of 255, per channel. Half-float blending and driver rounding stay within 2 on the machines seen so far."""
MAX_FAILING_SHARE = 4e-4
"""Of all pixels: room for some pixels at an edge that fall to the other side."""


@dataclass(frozen=True)
class Comparison:
    """How two pictures of one size differ.

    Attributes:
        difference: Largest difference over the channels. [H, W] int
        tolerance: A pixel fails above this.
    """

    difference: np.ndarray
    tolerance: int

    @property
    def n_failing(self) -> int:
        """Pixels above the tolerance."""
        return int((self.difference > self.tolerance).sum())

    @property
    def worst(self) -> int:
        """Largest difference anywhere."""
        return int(self.difference.max(initial=0))


def compare_images(actual: np.ndarray, expected: np.ndarray, *, tolerance: int = TOLERANCE) -> Comparison:
    """Compare two pictures [H, W, 3] uint8 pixel by pixel.

    Raises:
        AssertionError: They differ in size, or the actual one is not such a picture.
    """
    assert actual.dtype == np.uint8, f"a golden picture is uint8, got {actual.dtype}"
    assert actual.shape == expected.shape, f"the picture is {actual.shape}, the golden one {expected.shape}"
    difference = np.abs(actual.astype(np.int64) - expected.astype(np.int64)).max(axis=2)
    return Comparison(difference, tolerance)


def assert_matches_golden(
    actual: np.ndarray,
    name: str,
    *,
    update: bool,
    tolerance: int = TOLERANCE,
    max_failing_share: float = MAX_FAILING_SHARE,
    golden_folder: Path = GOLDEN_FOLDER,
    failure_folder: Path = FAILURE_FOLDER,
) -> None:
    """Fail unless a picture equals the stored one, or store it.

    On failure the picture, the golden one and their difference, brightened, are written to the failure folder.

    Args:
        actual: [H, W, 3] uint8
        name: File name without extension, of the form test-file_what.
        update: Write the golden picture instead of comparing: the fixture update_golden.
        tolerance: Of 255, per channel.
        max_failing_share: Of all pixels.
        golden_folder: Where golden pictures are kept.
        failure_folder: Where to explain a failure.
    """
    golden_path = golden_folder / f"{name}.png"
    if update:
        golden_folder.mkdir(parents=True, exist_ok=True)
        Image.fromarray(actual).save(golden_path, optimize=True)
        return
    assert golden_path.is_file(), f"no golden picture {golden_path}; write it with --update-golden and look at it"
    with Image.open(golden_path) as stored:
        expected = np.asarray(stored.convert("RGB"))
    comparison = compare_images(actual, expected, tolerance=tolerance)
    allowed = int(max_failing_share * comparison.difference.size)
    if comparison.n_failing <= allowed:
        return
    paths = _write_failure(name, actual, expected, comparison, failure_folder)
    raise AssertionError(
        f"{comparison.n_failing} pixels differ by more than {tolerance}/255 (worst {comparison.worst}), "
        f"{allowed} may; see {paths}, or accept with --update-golden"
    )


def _write_failure(name: str, actual: np.ndarray, expected: np.ndarray, comparison: Comparison, folder: Path) -> str:
    folder.mkdir(parents=True, exist_ok=True)
    brightened = np.clip(comparison.difference * 8, 0, 255).astype(np.uint8)
    for kind, image in (("actual", actual), ("golden", expected), ("difference", brightened)):
        Image.fromarray(image).save(folder / f"{name}-{kind}.png")
    return str(folder / f"{name}-*.png")
