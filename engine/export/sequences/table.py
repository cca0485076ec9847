"""The file formats that hold a whole sequence of Gaussians."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from engine.export.sequences import fourdgs_reader, fourdgs_writer, usd
from engine.export.sequences.sequence import SequenceReader, SequenceStretch, SequenceTiming


def _can_always() -> None:
    """Nothing is needed that may be missing."""


def _is_valid(path: Path) -> tuple[str, ...]:
    """Of a format without a validator."""
    return ()


class SequenceFormat(NamedTuple):
    """One file format.

    Attributes:
        title: Its name for users.
        use: Its purpose, in a few words.
        suffix: With its point.
        min_psnr_db: A frame that was read back looks this much like the scene, or something went wrong.
        still_bytes: Of a Gaussian that stands still, once; for a forecast.
        moving_bytes: Of a Gaussian that moves, per frame; for a forecast.
        limits: What it cannot hold, as sentences for the user.
        write: Writes stretches, which follow one another without a gap, and returns sentences about what it could not
            store as it is. The path has the right suffix and is replaced.
        open: Opens a file to read frames from it. Raises ProjectError where it is damaged, of an unknown version, or
            asks for more memory than a limit.
        has_sound: Whether it can hold sound.
        up: One of engine.export.world.AXES: up in the file where the user does not say; None as in the capture.
        check: Raises ProjectError where something is missing that it is written and read with.
        problems: What the format's own validator says is wrong with a file.
    """

    title: str
    use: str
    suffix: str
    min_psnr_db: float
    still_bytes: float
    moving_bytes: float
    limits: tuple[str, ...]
    write: Callable[[Iterable[SequenceStretch], SequenceTiming, Path], tuple[str, ...]]
    open: Callable[[Path], SequenceReader]
    has_sound: bool = False
    up: str | None = None
    check: Callable[[], None] = _can_always
    problems: Callable[[Path], tuple[str, ...]] = _is_valid


_USD = SequenceFormat(
    "USD",
    "for programs with OpenUSD 26.03 or later, such as usdview and Omniverse",
    ".usdc",
    45.0,
    56.0,
    35.0,
    usd.LIMITS,
    usd.write,
    usd.UsdReader,
    up="+y",
    check=usd.check,
)
SEQUENCES: dict[str, SequenceFormat] = {
    "4dgs": SequenceFormat(
        "4DGS",
        "small and quick to seek, with sound, for players of .4dgs",
        ".4dgs",
        45.0,
        8.5,
        2.2,
        fourdgs_writer.LIMITS,
        fourdgs_writer.write,
        fourdgs_reader.FourdgsReader,
        has_sound=True,
        problems=fourdgs_reader.problems,
    ),
    "usd": _USD,
    "usda": _USD._replace(
        title="USD as text",
        use="the same to look into, several times as large",
        suffix=".usda",
        still_bytes=160.0,
        moving_bytes=100.0,
    ),
}
"""By the name that the command line has for it, in the order in which they are offered."""
