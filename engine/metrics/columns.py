"""The table of all figures: name, unit, direction and definition of every column of an evaluation."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Column:
    """One figure of a picture.

    Attributes:
        name: Key in rows and means.
        unit: "dB", or "1" for a number without unit.
        is_higher_better: Direction; None for a figure of the capture, which has none.
        is_quick: Whether `metrics="quick"` has it too.
        definition: One sentence.
    """

    name: str
    unit: str
    is_higher_better: bool | None
    is_quick: bool
    definition: str


_BASES = (
    Column("psnr", "dB", True, True, "20 log10(1 / RMSE), one RMSE over the three channels"),
    Column("ssim", "1", True, True, "SSIM, 11 x 11 window, sigma 1.5, zero padding, data range 1, mean of channels"),
    Column("dssim1", "1", False, True, "(1 - SSIM) / 2, data range 1"),
    Column("dssim_range2", "1", False, False, "(1 - SSIM) / 2, constants of data range 2 for pictures in 0..1"),
    Column("dssim_ms", "1", False, False, "(1 - MS-SSIM) / 2, five scales; sides of 176 px and more"),
    Column("flip", "1", False, False, "mean LDR-FLIP, 67 pixels per degree"),
)
_MASKED = ("psnr", "ssim", "flip")
"""Figures that exist per pixel, so that they can be taken of a part of the picture."""


def _table() -> dict[str, Column]:
    found = []
    for base in _BASES:
        for fit, fit_words in (("", ""), ("_fit", ", after the colour fit")):
            parts = (("", ""), ("_moving", ", moving pixels"), ("_rest", ", pixels that do not move"))
            for part, part_words in parts if base.name in _MASKED else parts[:1]:
                words = base.definition + part_words + fit_words
                name = base.name + fit + part
                found.append(Column(name, base.unit, base.is_higher_better, base.is_quick, words))
        if base.name == "psnr":
            words = f"{base.definition}, after gsplat's affine colour correction: per channel the gain and offset that "
            words += "lead from the truth to the picture, undone; less generous than the colour fit"
            found.append(Column("cc_psnr", "dB", True, True, words))
    words = f"{_BASES[0].definition}, after the colour fit and a fit of smooth local brightness: a factor per block of "
    words += "a grid of 16 blocks across the picture, from pixels that do not move"
    found.append(Column("psnr_light", "dB", True, True, words))
    words = "share of the pixels that differ from the camera's own background"
    found.append(Column("moving_share", "1", None, True, words))
    return {column.name: column for column in found}


FIGURES_VERSION = 5
"""Raised when a figure of the same picture changes: kept figures of earlier versions are not mixed with new ones."""
COLUMNS = _table()
"""Every column by name, in the order of a row. Raw figures have no suffix; `_fit` is after the colour fit, `_light`
after a fit of smooth local brightness too, `_moving` and `_rest` are of a part of the pixels."""
