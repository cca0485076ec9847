"""TsogReader: opens .tsog files, those of other programs too. Pixels are kept as they are; a frame is made of those of
its Gaussians that can be seen."""

from __future__ import annotations

import struct
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import msgspec
import numpy as np
from msgspec import UNSET

from engine.errors import ProjectError
from engine.export.formats.damaged import damaged
from engine.export.formats.sog_pictures import between, member, pixels_of, shares, splats_of, webp_size
from engine.export.sequences.sequence import SequenceSound, SequenceTiming
from engine.export.sequences.tsog_meta import (
    MAX_ROWS,
    MOST_DIRECTORY_BYTES,
    MOST_ENTRIES,
    MOST_FRAMES,
    MOST_META_BYTES,
    MOST_SOUND_BYTES,
    TsogAudio,
    TsogBells,
    TsogFrames,
    TsogMeta,
    TsogMotion,
)
from engine.export.splats import Splats
from engine.export.world import AXES
from engine.storage.files import open_regular

_MOST_PIXELS = 2 * MAX_ROWS
_MOST_PICTURE_BYTES = 5 * _MOST_PIXELS
_UP = AXES["+y"]
"""As the format has it; files do not say."""
_FAINTEST = 1.0 / 255.0
"""Fainter Gaussians are not drawn."""
_END = struct.Struct("<4s4H2LH")
_END_MARK, _LARGE_END_MARK = b"PK\x05\x06", b"PK\x06\x07"
_LONGEST_COMMENT = 65535
_LARGE_END_BYTES = 20
_ENCRYPTED = 1


def open_tsog(path: Path) -> TsogReader:
    """See SequenceFormat."""
    try:
        with open_regular(path) as file:
            _check_directory(file)
            with zipfile.ZipFile(file) as archive:
                return TsogReader(archive)
    except ProjectError as error:
        raise ProjectError(error.message, hint=error.hint, path=path) from error
    except (zipfile.BadZipFile, EOFError, zlib.error, ValueError, KeyError, NotImplementedError, struct.error) as error:
        reason = str(error.args[0] if isinstance(error, KeyError) else error) or type(error).__name__
        raise ProjectError(damaged(f"it is not a .tsog file, or is damaged ({reason})").message, path=path) from error
    except OSError as error:
        raise ProjectError(f"The file of Gaussians cannot be read: {error.strerror or error}.", path=path) from error


class TsogReader:
    """An opened file, see SequenceReader. Everything is in memory: about 36 bytes for each of its Gaussians.

    Args:
        archive: The zip file; not needed any more afterwards.
    Raises:
        ProjectError: It is of another version or profile, or larger than the limits.
        ValueError, KeyError, OSError, zipfile.BadZipFile, zlib.error: It is damaged.
    """

    def __init__(self, archive: zipfile.ZipFile) -> None:
        _check_entries(archive)
        meta = msgspec.json.decode(member(archive, "meta.json", MOST_META_BYTES), type=TsogMeta)
        if problem := meta.problem():
            raise damaged(problem)
        n_frames, fps = meta.frames()
        if meta.count > MAX_ROWS or n_frames > MOST_FRAMES:
            raise ProjectError(
                f"The file of Gaussians has {meta.count:,} Gaussians in {n_frames:,} frames; at most {MAX_ROWS:,} in "
                f"{MOST_FRAMES:,} can be opened."
            )
        self._meta, self._described = meta, msgspec.to_builtins(meta)
        self._pixels = dict[str, np.ndarray]()
        sizes = set[tuple[int, int]]()
        for name in _pictures(meta):
            data = member(archive, name, _MOST_PICTURE_BYTES)
            self._pixels[name] = pixels_of(data, meta.count, most_pixels=_MOST_PIXELS)
            sizes.add(webp_size(data))
        if len(sizes) > 1:
            raise ValueError("pictures of different sizes")
        self._notes = list[str]()
        self._timing = SequenceTiming(n_frames, fps, self._sound(archive))
        if meta.sh_n is not UNSET:
            self._notes.append("Colours that depend on the viewing direction are left out.")
        self._frames = None if not isinstance(meta.timeline, TsogFrames) else self._frames_of(meta.timeline)

    @property
    def timing(self) -> SequenceTiming:
        """When its frames are shown."""
        return self._timing

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the file is not kept."""
        return tuple(self._notes)

    def splats(self, frame: int) -> Splats:
        """What can be seen at a frame. Raises ProjectError where the file is damaged there."""
        opacities = self._pixels[self._meta.sh0.files[0]][:, 3] / np.float32(255.0)
        since = np.zeros(1)
        if self._frames is not None:
            opacities = np.where(self._frames == frame, opacities, np.float32(0.0))
        elif isinstance(self._meta.timeline, TsogBells):
            since, sigmas = self._bells(self._meta.timeline, frame / max(self._timing.n_frames - 1, 1))
            opacities = (opacities * np.exp(-0.5 * np.square(since / sigmas))).astype(np.float32)
        rows = np.flatnonzero(opacities >= np.float32(_FAINTEST) * np.float32(0.9999))
        try:
            found = splats_of(self._described, lambda name: self._pixels[name][rows])
        except (IndexError, ValueError) as error:
            raise damaged(f"a pixel has a number that means nothing ({error})") from error
        if not np.isfinite(found.means).all() or not np.isfinite(found.scales).all():
            raise damaged("numbers in it are too large")
        speeds = self._speeds(rows)
        if speeds is not None and self._frames is None:
            found = replace(found, means=(found.means + speeds * since[rows, None]).astype(np.float32))
        return replace(found, opacities=opacities[rows], up=_UP)

    def close(self) -> None:
        """Nothing: the file is closed already."""

    def _frames_of(self, timeline: TsogFrames) -> np.ndarray:
        lower, upper = (self._pixels[name][:, 0].astype(np.int32) for name in timeline.files)
        return np.minimum(timeline.N - 1, (lower + 256 * upper) // timeline.delta)

    def _bells(self, timeline: TsogBells, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Time since the centre of each, and its standard deviation, in lengths of the file. [N] each"""
        lower, upper = (self._pixels[name][:, :2] for name in timeline.files)
        values = between(timeline.mins, timeline.maxs, shares(lower, upper))
        return time - values[:, 0], values[:, 1]

    def _speeds(self, rows: np.ndarray) -> np.ndarray | None:
        """Units per length of the file. [rows, 3]"""
        if not isinstance(self._meta.temporal, TsogMotion):
            return None
        motion = self._meta.temporal.means
        lower, *upper = (self._pixels[name][rows, :3] for name in motion.files)
        share = shares(lower, upper[0]) if upper else lower / 255.0
        return between(motion.mins[0], motion.maxs[0], share)

    def _sound(self, archive: zipfile.ZipFile) -> SequenceSound | None:
        audio = self._meta.audio
        if not isinstance(audio, TsogAudio):
            return None
        kind = audio.mime_type if isinstance(audio.mime_type, str) else f"audio/{audio.file.rpartition('.')[2].lower()}"
        if kind not in ("audio/wav", "audio/x-wav", "audio/wave"):
            self._notes.append(f"Its sound is {kind}, which is not read; only WAV is.")
            return None
        data = member(archive, audio.file, MOST_SOUND_BYTES)
        return SequenceSound(len(data), lambda: (data,))


def _pictures(meta: TsogMeta) -> list[str]:
    """Those that are read."""
    groups: list[tuple[str, ...] | list[str]] = [meta.means.files, meta.scales.files, meta.quats.files, meta.sh0.files]
    if meta.timeline is not UNSET:
        groups.append(meta.timeline.files)
    if isinstance(meta.temporal, TsogMotion):
        groups.append(meta.temporal.means.files)
    return list(dict.fromkeys(name for group in groups for name in group))


def _check_directory(file: BinaryIO) -> None:
    """Check the limits of the profile before the directory is read. Raises ValueError where it breaks them."""
    size = file.seek(0, 2)
    tail_bytes = min(size, _LARGE_END_BYTES + _END.size + _LONGEST_COMMENT)
    file.seek(size - tail_bytes)
    tail = file.read(tail_bytes)
    at = tail.rfind(_END_MARK)
    if at < 0:
        raise ValueError("its end is missing")
    _, disk, first_disk, n_here, n_entries, n_bytes, _, _ = _END.unpack_from(tail, at)
    if disk or first_disk or n_here != n_entries or tail[at - _LARGE_END_BYTES : at].startswith(_LARGE_END_MARK):
        raise ValueError("ZIP64 and several disks are not allowed")
    if n_entries > MOST_ENTRIES or n_bytes > MOST_DIRECTORY_BYTES:
        raise ValueError(f"{n_entries:,} entries in a directory of {n_bytes:,} bytes")


def _check_entries(archive: zipfile.ZipFile) -> None:
    names = archive.namelist()
    if len(set(names)) < len(names):
        raise ValueError("two entries have the same name")
    for info in archive.infolist():
        if info.flag_bits & _ENCRYPTED or info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{info.filename} is encrypted or packed in another way")
