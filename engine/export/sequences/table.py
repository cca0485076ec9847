"""The file formats that hold a whole sequence of Gaussians."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import BinaryIO, NamedTuple

from engine.export.sequences.sequence import SequenceReader, SequenceStretch, SequenceTiming


class SequenceFormat(NamedTuple):
    """One file format.

    Attributes:
        title: Its name for users.
        use: Its purpose, in a few words.
        suffix: With its point.
        min_psnr_db: A frame that was read back looks this much like the scene, or something went wrong.
        write: Writes stretches, which follow one another without a gap, and returns sentences about what it could not
            store as it is.
        open: Opens a file to read frames from it. Raises ProjectError where it is damaged, of an unknown version, or
            asks for more memory than a limit.
    """

    title: str
    use: str
    suffix: str
    min_psnr_db: float
    write: Callable[[Iterable[SequenceStretch], SequenceTiming, BinaryIO], tuple[str, ...]]
    open: Callable[[Path], SequenceReader]


SEQUENCES: dict[str, SequenceFormat] = {}
"""By the name that the command line has for it, in the order in which they are offered."""
