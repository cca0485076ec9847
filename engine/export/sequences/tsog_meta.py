"""The document of a .tsog, version 4 in playback profile 1, as it is checked when a file is opened; and its limits."""

from __future__ import annotations

from typing import Annotated

from msgspec import UNSET, Meta, Struct, UnsetType

VERSION = 4
PROFILE_ID, PROFILE_VERSION = "org.opsiclear.tsog-playback", 1
MOST_FRAMES = 1 << 16
"""What a timeline of 16 bits tells apart."""
MAX_ROWS = 1 << 24
"""Pictures of 4096 x 4096, which graphics cards of phones take; and about 2 GB of memory here."""
MOST_ENTRIES = 1024
MOST_DIRECTORY_BYTES = 4 << 20
MOST_META_BYTES = 4 << 20
MOST_SOUND_BYTES = 128 << 20
_MAX_FLOAT32 = 3.4028234663852886e38
_USUAL_FPS = 30.0
_USUAL_CONTINUOUS_FRAMES = 300

_Number = Annotated[float, Meta(ge=-_MAX_FLOAT32, le=_MAX_FLOAT32)]
_Positive = Annotated[float, Meta(gt=0.0, le=_MAX_FLOAT32)]
_Three = tuple[_Number, _Number, _Number]
_Name = Annotated[str, Meta(pattern=r"^[^\\\x00-\x1f:?#]+$")]
_Codebook = Annotated[list[_Number], Meta(min_length=1, max_length=256)]


class TsogProfile(Struct, frozen=True):
    """What a writer says about how a file is to be read."""

    id: str
    version: int


class TsogMeans(Struct, frozen=True):
    """Ranges of signed logarithms, and pictures of lower and upper bytes."""

    mins: _Three
    maxs: _Three
    files: tuple[_Name, _Name]


class TsogCodes(Struct, frozen=True):
    """Numbers that the pixels of a picture count through."""

    codebook: _Codebook
    files: tuple[_Name]


class TsogQuats(Struct, frozen=True):
    """The picture of rotations."""

    files: tuple[_Name]


class TsogFrames(Struct, frozen=True, tag_field="type", tag=0):
    """A discrete timeline: each Gaussian at one of N frames."""

    N: Annotated[int, Meta(ge=1, le=MOST_FRAMES)]
    delta: int
    files: tuple[_Name, _Name]


class TsogBells(Struct, frozen=True, tag_field="type", tag=1):
    """A continuous timeline: ranges of centre and standard deviation, in lengths of the file."""

    mins: tuple[_Number, _Positive]
    maxs: tuple[_Number, _Positive]
    files: tuple[_Name, _Name]


class TsogSpeeds(Struct, frozen=True):
    """Ranges of speeds in units per length of the file, and pictures of 8 bits, or of lower and upper bytes."""

    mins: tuple[_Three]
    maxs: tuple[_Three]
    files: Annotated[list[_Name], Meta(min_length=1, max_length=2)]


class TsogMotion(Struct, frozen=True, forbid_unknown_fields=True):
    """What changes over time besides opacity."""

    means: TsogSpeeds


class TsogPlayback(Struct, frozen=True):
    """Seconds, frames per second."""

    duration: _Positive | UnsetType = UNSET
    fps: _Positive | UnsetType = UNSET


class TsogAudio(Struct, frozen=True, rename="camel"):
    """The sound of a file."""

    file: _Name
    mime_type: str | UnsetType = UNSET


class TsogMeta(Struct, frozen=True, rename={"sh_n": "shN"}):
    """The document. Fields that nothing here depends on are left out."""

    version: int
    count: Annotated[int, Meta(ge=1)]
    means: TsogMeans
    scales: TsogCodes
    quats: TsogQuats
    sh0: TsogCodes
    profile: TsogProfile | UnsetType = UNSET
    sh_n: dict | UnsetType = UNSET
    timeline: TsogFrames | TsogBells | UnsetType = UNSET
    temporal: TsogMotion | UnsetType = UNSET
    fps: _Positive | UnsetType = UNSET
    playback: TsogPlayback = TsogPlayback()
    audio: TsogAudio | UnsetType = UNSET

    def problem(self) -> str | None:
        """What contradicts the profile, as a clause; None where nothing does."""
        profile = self.profile
        ranges: list[tuple[tuple[float, ...], tuple[float, ...]]] = [(self.means.mins, self.means.maxs)]
        if isinstance(self.timeline, TsogBells):
            ranges.append((self.timeline.mins, self.timeline.maxs))
        if isinstance(self.temporal, TsogMotion):
            ranges.append((self.temporal.means.mins[0], self.temporal.means.maxs[0]))
        if self.version != VERSION:
            return f"its version is {self.version}; version {VERSION} can be read"
        if isinstance(profile, TsogProfile) and (profile.id, profile.version) != (PROFILE_ID, PROFILE_VERSION):
            return f"its profile is {profile.id} {profile.version}; {PROFILE_ID} {PROFILE_VERSION} can be read"
        if any(low > high for lows, highs in ranges for low, high in zip(lows, highs, strict=True)):
            return "the lower end of a range is above its upper end"
        if isinstance(self.timeline, TsogFrames) and self.timeline.delta != 65536 // self.timeline.N:
            return f"its timeline of {self.timeline.N} frames has steps of {self.timeline.delta}"
        if isinstance(self.temporal, TsogMotion) and self.timeline is UNSET:
            return "it has motion without a timeline"
        return None

    def frames(self) -> tuple[int, float]:
        """How many frames it has, and how many of them are shown per second."""
        fps = next((value for value in (self.playback.fps, self.fps) if isinstance(value, float)), _USUAL_FPS)
        duration = self.playback.duration
        if isinstance(self.timeline, TsogFrames):
            return self.timeline.N, self.timeline.N / duration if isinstance(duration, float) else fps
        if self.timeline is UNSET:
            return 1, fps
        if isinstance(duration, float):
            return max(2, int(min(duration * fps, 1e15) + 0.5) + 1), fps
        return _USUAL_CONTINUOUS_FRAMES, fps
