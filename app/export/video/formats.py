"""Formats that pictures are written in, what each can hold, and whether this machine can encode it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from engine.errors import ProjectError


class MissingCodecError(ProjectError):
    """This installation has no encoder for a format."""


@dataclass(frozen=True, slots=True)
class FilmEncoding:
    """How FFmpeg encodes the pictures of a video.

    Attributes:
        codec: FFmpeg's encoder.
        pixels: Its pixel format.
        options: Of the encoder.
    """

    codec: str
    pixels: str
    options: Mapping[str, str] = field(default_factory=dict)

    @property
    def needs_even_sizes(self) -> bool:
        """Whether it has pictures of even width and height only."""
        return self.codec != "libvpx-vp9"

    @property
    def max_level(self) -> int:
        """Highest level of a channel that pictures are handed over with."""
        return 65_535 if "10" in self.pixels else 255


@dataclass(frozen=True, slots=True)
class PictureFormat:
    """One format.

    Attributes:
        label: As shown to the user.
        suffixes: Of files; none of a sequence, which is a folder.
        muxer: FFmpeg's name for the file around it, and its options.
        encoding: Of pictures without opacity; None of a sequence.
        transparent: Of pictures with opacity.
        sound_codec: FFmpeg's encoder for sound; None where the format holds none.
        bytes_per_pixel: About how large a picture becomes.
        min_size: The smallest width and height that it can hold.
    """

    label: str
    bytes_per_pixel: float
    suffixes: tuple[str, ...] = ()
    muxer: tuple[str, Mapping[str, str]] = ("", {})
    encoding: FilmEncoding | None = None
    transparent: FilmEncoding | None = None
    sound_codec: str | None = None
    min_size: tuple[int, int] = (1, 1)

    @property
    def can_be_transparent(self) -> bool:
        """Whether pictures keep their opacity."""
        return self.is_sequence or self.transparent is not None

    @property
    def is_sequence(self) -> bool:
        """Whether it is a folder of files."""
        return not self.suffixes


_VP9 = {"crf": "18", "b": "0", "deadline": "good", "cpu-used": "4", "row-mt": "1"}
FORMATS = MappingProxyType(
    {
        "mp4": PictureFormat(
            "H.264 in mp4",
            0.1,
            (".mp4", ".m4v", ".mov"),
            ("mp4", {"movflags": "+faststart"}),
            # visually lossless for most eyes
            FilmEncoding("libx264", "yuv420p", {"crf": "16", "preset": "medium"}),
            sound_codec="aac",
        ),
        "webm": PictureFormat(
            "VP9 in webm",
            0.1,
            (".webm",),
            ("webm", {}),
            FilmEncoding("libvpx-vp9", "yuv420p", _VP9),
            FilmEncoding("libvpx-vp9", "yuva420p", _VP9 | {"auto-alt-ref": "0"}),  # such frames cannot hold opacity
            "libopus",
        ),
        "prores": PictureFormat(
            "ProRes 422 HQ in mov, 4444 where transparent",
            0.5,
            (".mov",),
            ("mov", {}),
            FilmEncoding("prores_ks", "yuv422p10le", {"profile": "hq", "vendor": "apl0"}),
            FilmEncoding("prores_ks", "yuva444p10le", {"profile": "4444", "vendor": "apl0", "alpha_bits": "16"}),
            "pcm_s16le",
        ),
        "dnxhr": PictureFormat(
            "DNxHR HQX in mov",
            0.5,
            (".mov",),
            ("mov", {}),
            FilmEncoding("dnxhd", "yuv422p10le", {"profile": "dnxhr_hqx"}),
            sound_codec="pcm_s16le",
            min_size=(256, 120),
        ),
        "png": PictureFormat("PNG files", 2.0),
        "exr": PictureFormat("OpenEXR files, linear", 8.0),
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
            hint="Write FILE.mp4, FILE.webm or FILE.mov, or name a folder for PNG or OpenEXR files.",
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
    needed = [kind.encoding and kind.encoding.codec, kind.sound_codec if needs_sound else None]
    return [codec for codec in needed if codec is not None and not _has_encoder(codec)]


def _has_encoder(codec: str) -> bool:
    from av.codec import Codec  # the window lists formats long before it needs one
    from av.codec.codec import UnknownCodecError

    try:
        Codec(codec, "w")
    except UnknownCodecError:
        return False
    return True
