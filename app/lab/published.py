"""Figures that others have published of data that can be trained here too, with their sources and caveats.

All are of the Panoptic Sports sequences as Dynamic 3D Gaussians cut them: 150 frames, 640 x 360 px, 27 cameras trained
on and cameras 0, 10, 15 and 30 tested, colours taken to be as rendered. None was read in the papers themselves, whose
tables were not at hand: they are copied from texts that copy them.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

SEQUENCES = ("juggle", "boxes", "softball", "tennis", "football", "basketball")
HOLDOUT = ("0", "10", "15", "30")
SIZE = (640, 360)
N_FRAMES = 150
LAYOUT = "panoptic"


@dataclass(frozen=True, slots=True)
class Published:
    """One figure of one method and sequence; raw colours.

    Attributes:
        method: As its authors call it.
        sequence: One of SEQUENCES.
        psnr: dB.
        ssim, lpips: None where not printed. LPIPS is the authors' own.
        source: Where it is printed.
        caveat: Why it is hard to compare; may be empty.
        n_frames: Frames of the sequence that it covers; None where not stated.
    """

    method: str
    sequence: str
    psnr: float
    ssim: float | None
    lpips: float | None
    source: str
    caveat: str = ""
    n_frames: int | None = None


CAVEATS = (
    "Published figures are of all 150 frames where a number stands next to them; S4D's text does not say. "
    "That their colours are raw follows from the authors' training code and "
    "is not stated by them: it learns a gain and an offset of each training camera at the first frame, and none of a "
    "test camera. No code of their evaluation was ever published; re-runs by others differ from the printed figures by "
    "up to 1.7 dB per sequence. Copied from texts that copy the papers' tables. Compare raw PSNR, of all 150 frames; "
    "never PSNR after the colour fit. The highest mean over the six sequences that is known here is 29.83 dB "
    "(PaMoSplat, arXiv 2605.10307, quoted by a list on the web; not verified, scenes not named)."
)
_LUITEN = "Luiten et al., Dynamic 3D Gaussians (3DV 2024), table 1"
_S4D = "S4D, table 4"
_RERUN = "a re-run by others"


def _row(method: str, source: str, caveat: str, *figures: tuple[float, float, float]) -> tuple[Published, ...]:
    return tuple(
        Published(method, sequence, *values, source, caveat, N_FRAMES)
        for sequence, values in zip(SEQUENCES, figures, strict=True)
    )


PUBLISHED = (
    *_row(
        "Dynamic 3D Gaussians",
        _LUITEN,
        "",
        (29.48, 0.92, 0.15),
        (29.46, 0.91, 0.17),
        (28.43, 0.91, 0.19),
        (28.11, 0.91, 0.17),
        (28.49, 0.91, 0.19),
        (28.22, 0.91, 0.18),
    ),
    *_row(
        "3GS-O",
        _LUITEN,
        "3D Gaussian splatting trained on from frame to frame",
        (28.19, 0.91, 0.15),
        (28.74, 0.91, 0.15),
        (28.77, 0.91, 0.14),
        (28.03, 0.90, 0.16),
        (28.49, 0.90, 0.16),
        (27.02, 0.89, 0.18),
    ),
    Published("Dynamic 3D Gaussians", "basketball", 28.54, 0.9032, 0.1812, _S4D, _RERUN),
    Published("Dynamic 3D Gaussians", "softball", 26.93, None, None, _S4D, _RERUN),
    Published("Dynamic 3D Gaussians", "boxes", 27.79, None, None, _S4D, _RERUN),
    Published("S4D (GoS2)", "basketball", 27.72, 0.9203, 0.1423, _S4D),
)


def is_protocol(layout: str, holdout: Collection[str], sizes: Collection[tuple[int, int]]) -> bool:
    """Whether a project is of this kind of data and held out the same cameras at the same size.

    Args:
        layout: Of the capture, as `clipgstream inspect` prints it.
        holdout: Names of held-out cameras.
        sizes: Of the pictures that were worked with, px, of all cameras.
    """
    return layout == LAYOUT and set(holdout) == set(HOLDOUT) and set(sizes) == {SIZE}


def sequence_of(capture: Path) -> str | None:
    """Which sequence a capture is by its folder's name, or that of a folder above; None where none says."""
    return next((part.lower() for part in reversed(capture.parts) if part.lower() in SEQUENCES), None)


def published_of(sequence: str | None) -> list[Published]:
    """Figures of a sequence, or of all where it is not known."""
    return [one for one in PUBLISHED if sequence in (None, one.sequence)]
