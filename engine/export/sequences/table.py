"""The file formats that hold a whole sequence of Gaussians."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from engine.export.sequences import fourdgs_reader, fourdgs_writer
from engine.export.sequences.sequence import SequenceReader, SequenceTiming, Stretch


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
    write: Callable[[Iterable[Stretch], SequenceTiming, Path], tuple[str, ...]]
    open: Callable[[Path], SequenceReader]
    has_sound: bool = False
    check: Callable[[], None] = _can_always
    problems: Callable[[Path], tuple[str, ...]] = _is_valid


SEQUENCES: dict[str, SequenceFormat] = {
    "4dgs": SequenceFormat(
        "4DGS",
        "small and quick to seek, with sound, for players of .4dgs",
        ".4dgs",
        45.0,
        9.0,
        3.5,
        fourdgs_writer.LIMITS,
        fourdgs_writer.write,
        fourdgs_reader.FourdgsReader,
        has_sound=True,
        problems=fourdgs_reader.problems,
    ),
}
"""By the name that the command line has for it, in the order in which they are offered."""
