"""Formats that pictures are written in, what each can hold, and whether this machine can encode it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from engine.errors import ProjectError


class MissingCodecError(ProjectError):
    """This installation has no encoder for a format."""


@dataclass(frozen=True, slots=True)
class PictureFormat:
    """One format.

    Attributes:
        label: As shown to the user.
        suffixes: Of files; none of a sequence, which is a folder.
        video_codec: FFmpeg's encoder; None where none is needed.
        sound_codec: Likewise, for sound; None where the format holds none.
        can_be_transparent: Whether pictures keep their opacity.
        bytes_per_pixel: About how large a picture becomes.
    """

    label: str
    bytes_per_pixel: float
    suffixes: tuple[str, ...] = ()
    video_codec: str | None = None
    sound_codec: str | None = None
    can_be_transparent: bool = False

    @property
    def is_sequence(self) -> bool:
        """Whether it is a folder of files."""
        return not self.suffixes


FORMATS = MappingProxyType(
    {
        "mp4": PictureFormat("H.264 in mp4", 0.1, (".mp4", ".m4v", ".mov"), "libx264", "aac"),
        "webm": PictureFormat("VP9 in webm", 0.1, (".webm",), "libvpx-vp9", "libopus", can_be_transparent=True),
        "png": PictureFormat("PNG files", 2.0, can_be_transparent=True),
        "exr": PictureFormat("OpenEXR files", 8.0, can_be_transparent=True),
    }
)
"""By name, the usual one first."""


def format_of(out: Path) -> str:
    """The format that a name asks for: by its suffix, PNG files for a folder.

    Raises:
        ProjectError: It ends in the suffix of something else.
    """
    suffix = out.suffix.lower()
    for name, kind in FORMATS.items():
        if suffix in kind.suffixes:
            return name
    if suffix and not out.is_dir():
        raise ProjectError(
            f"--out ends in '{out.suffix}', which is not a video format this program writes.",
            hint="Write FILE.mp4 or FILE.webm, or name a folder for PNG or OpenEXR files.",
            path=out,
        )
    return "png"


def check_codecs(name: str, *, needs_sound: bool = False) -> None:
    """Check that this machine can encode a format.

    Raises:
        MissingCodecError: It cannot; says what is missing, and what can be written here.
    """
    missing = missing_codecs(name, needs_sound=needs_sound)
    if missing:
        others = [other for other in FORMATS if not missing_codecs(other, needs_sound=needs_sound)]
        raise MissingCodecError(
            f"{FORMATS[name].label} cannot be written here: PyAV's FFmpeg was built without {' and '.join(missing)}.",
            hint=f"Available: {', '.join(others)}.",
        )


def missing_codecs(name: str, *, needs_sound: bool = False) -> list[str]:
    """Encoders that a format needs and that are not there."""
    kind = FORMATS[name]
    needed = [kind.video_codec, kind.sound_codec if needs_sound else None]
    return [codec for codec in needed if codec is not None and not _has_encoder(codec)]


def _has_encoder(codec: str) -> bool:
    from av.codec import Codec  # the window lists formats long before it needs one
    from av.codec.codec import UnknownCodecError

    try:
        Codec(codec, "w")
    except UnknownCodecError:
        return False
    return True
