"""The file formats that hold a whole sequence of Gaussians."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from engine.export.sequences.sequence import SequenceReader, SequenceStretch, SequenceTiming
from engine.own_modules import import_own


def _later(place: str) -> Callable[..., Any]:
    """A function or class of a codec, which is imported when it is called: the window lists formats before its first
    picture. place: "module:name"."""
    module, _, name = place.partition(":")

    def call(*arguments: Any) -> Any:
        return getattr(import_own(f"engine.export.sequences.{module}"), name)(*arguments)

    return call


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
        still_again: Of the Gaussians that stand still, the share that each further clip states anew, since their light
            has changed; for a forecast.
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
    still_again: float = 0.2
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
    (
        "Of USD, programs need the schema ParticleField3DGaussianSplat (OpenUSD 26.03 or later); others see nothing.",
        "Colours are as displays take them, although the schema means light. What moves is stored frame by frame: it "
        "does not glide between frames.",
    ),
    _later("usd:write"),
    _later("usd:UsdReader"),
    up="+y",
    check=_later("usd:check"),
)
SEQUENCES: dict[str, SequenceFormat] = {
    "4dgs": SequenceFormat(
        "4DGS",
        "small and quick to seek, with sound, for players of .4dgs",
        ".4dgs",
        45.0,
        8.5,
        2.2,
        (
            "Colours beyond the brightest white are cut off.",
            "Gaussians of less than 2 % opacity are left out, and paths are straight over a few frames within an "
            "eighth of a Gaussian's size.",
        ),
        _later("fourdgs_writer:write"),
        _later("fourdgs_reader:FourdgsReader"),
        has_sound=True,
        problems=_later("fourdgs_reader:problems"),
    ),
    "tsog": SequenceFormat(
        "TSOG",
        "temporal SOG, with sound, for OpsiClear's player in browsers",
        ".tsog",
        45.0,
        11.0,
        10.5,
        (
            "Positions have 16 bits, rotations 8; scales and colours are of 256 values each. Light on still Gaussians "
            "that changes by up to four levels of 255 becomes its mean.",
            "Between frames, moving Gaussians fade into the next frame on a straight path.",
        ),
        _later("tsog:write"),
        _later("tsog_reader:open_tsog"),
        has_sound=True,
        still_again=0.0,
        up="+y",
    ),
    "usd": _USD,
    "usda": _USD._replace(
        title="USD as text",
        use="the same to look into, several times as large",
        suffix=".usda",
        still_bytes=175.0,
        moving_bytes=110.0,
    ),
}
"""By the name that the command line has for it, in the order in which they are offered."""
