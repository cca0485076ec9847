"""Writes .tsog: the pictures of a .sog with a timeline, in which every Gaussian has its moment and its speed.

Version 4 of Xiaomi Research's temporal SOG in the playback profile 1 of OpsiClear. A continuous timeline gives every
Gaussian a bell over time. What stands still throughout is there once, under a bell that is as good as flat. Everything
else is there once per frame, under a bell that is narrow enough not to be seen at the next frame, and travels under it
at the speed at which it is followed to its neighbours: so players show motion between frames. A discrete timeline shows
every Gaussian at one frame only; it is for scenes in which hardly anything can be followed or stands still.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from engine.errors import ProjectError
from engine.export.formats.sog_pictures import attributes_of, bytes_of, write_pictures
from engine.export.player.blocks import joined
from engine.export.sequences.sequence import SequenceStretch, SequenceTiming
from engine.export.sequences.tsog_meta import (
    MAX_ROWS,
    MOST_FRAMES,
    MOST_SOUND_BYTES,
    PROFILE_ID,
    PROFILE_VERSION,
    VERSION,
)
from engine.export.sequences.tsog_rows import (
    EVERY_FRAME,
    StretchRows,
    TimedRows,
    at_every_frame,
    repeated,
    shared_still,
    stretch_rows,
)
from engine.export.splats import Splats

BELL_FRAMES = 0.38
"""Standard deviation of what moves: 0.03 of its opacity is left one frame away, where it lies on what is shown there,
and 0.42 half way between two frames, where those of both lie on each other."""
STILL_SIGMA = 50.0
"""Of what stands still, in lengths of the file: 0.99995 of its opacity at either end."""
_SPEED_LEVELS = 127
_SPEED_QUANTILE = 0.999
_PLAYER_ROWS = 1_000_000
_EFFORT = 50
_SOUND = "audio/track.wav"


def write(stretches: Iterable[SequenceStretch], timing: SequenceTiming, path: Path) -> tuple[str, ...]:
    """See SequenceFormat. Memory holds all Gaussians of the file: 2 GB for as many as it can have.

    Raises:
        ProjectError: There are more frames or Gaussians than such a file holds; says how many frames fit.
        OSError: The disk refused.
    """
    n = timing.n_frames
    if n > MOST_FRAMES:
        raise _too_many(f"{n:,} frames, and the timeline of a .tsog tells {MOST_FRAMES:,} apart", MOST_FRAMES)
    n_moving = np.zeros(n, np.int64)

    def count(frame: int, n_rows: int) -> None:
        n_moving[frame] = n_rows
        _check_rows(n_moving[: frame + 1], 0)

    found: list[StretchRows] = []
    for stretch in stretches:
        found.append(stretch_rows(stretch, count))
        end = stretch.first_frame + stretch.n_frames
        n_moving[stretch.first_frame : end] = np.bincount(found[-1].moving.frames, minlength=end)[stretch.first_frame :]
    shared, others = shared_still(found)
    n_still = _by_frame(found, [one.still for one in found])
    n_others = _by_frame(found, others)
    n_followed = len(shared) * n + sum(one.n_followed for one in found)
    is_followed = n == 1 or 2 * n_followed >= int((n_still + n_moving).sum())
    parts = [one.moving for one in found]
    if is_followed:
        _check_rows(n_others + n_moving, len(shared))
        parts.append(at_every_frame(shared))
    else:
        _check_rows(n_still + n_moving, 0)
        others = [one.still for one in found]
    parts += [repeated(one, still) for one, still in zip(found, others, strict=True)]
    with path.open("wb") as file:
        n_written = _write(parts, timing, is_followed, file)
    return tuple(_notes(timing, is_followed, n_written, int(n_others.max())))


def _too_many(what: str, n_fit: int) -> ProjectError:
    return ProjectError(
        f"The scene has {what}. At most the first {n_fit:,} frames fit.", hint="Export fewer frames (--frames)."
    )


def _check_rows(n_at: np.ndarray, n_once: int) -> None:
    """Raises ProjectError where the frames, counted by their Gaussians, are too many for one file."""
    total = n_once + np.cumsum(n_at)
    if total[-1] > MAX_ROWS:
        n_fit = int(np.searchsorted(total, MAX_ROWS, side="right"))
        raise _too_many(f"{total[-1]:,} Gaussians in {len(n_at):,} frames, and a .tsog holds {MAX_ROWS:,}", n_fit)


def _by_frame(stretches: list[StretchRows], splats: list[Splats]) -> np.ndarray:
    """How many Gaussians of each stretch there are at each frame. [n_frames] int64"""
    return np.repeat([len(one) for one in splats], [stretch.n_frames for stretch in stretches])


def _write(parts: list[TimedRows], timing: SequenceTiming, is_continuous: bool, file: BinaryIO) -> int:
    """Returns the number of Gaussians in the file."""
    frames, speeds = (np.concatenate([getattr(part, name) for part in parts]) for name in ("frames", "speeds"))
    splats = joined(*(part.splats for part in parts))
    parts.clear()
    if not len(splats):
        frames, speeds, splats = np.zeros(1, np.int32), np.zeros((1, 3), np.float32), _NOTHING
    described, pixels = attributes_of(splats)
    playback: dict[str, Any] = {"fps": timing.fps, "loop": True}
    meta: dict[str, Any] = {
        "version": VERSION,
        "profile": {"id": PROFILE_ID, "version": PROFILE_VERSION},
        "asset": {"generator": "ClipGStream Studio"},
        **described,
        "fps": timing.fps,
        "playback": playback,
    }
    if timing.n_frames == 1:
        playback["duration"] = 1.0 / timing.fps
    elif is_continuous:
        playback["duration"] = (timing.n_frames - 1) / timing.fps
        _add_bells(meta, pixels, frames, timing.n_frames)
        _add_speeds(meta, pixels, speeds * (timing.n_frames - 1))
    else:
        _add_frames(meta, pixels, frames, timing.n_frames)
    others = {}
    if timing.sound is not None and timing.sound.n_bytes <= MOST_SOUND_BYTES:
        meta["audio"] = {"file": _SOUND, "mimeType": "audio/wav"}
        others[_SOUND] = timing.sound.pieces()
    write_pictures(file, meta, pixels, len(splats), effort=_EFFORT, others=others)
    return len(splats)


_NOTHING = Splats(
    np.zeros((1, 3), np.float32),
    np.array([[1.0, 0.0, 0.0, 0.0]], np.float32),
    np.ones((1, 3), np.float32),
    np.zeros(1, np.float32),
    np.zeros((1, 3), np.float32),
)
"""One Gaussian that nobody sees: a file has one at least."""


def _add_bells(meta: dict[str, Any], pixels: dict[str, np.ndarray], frames: np.ndarray, n_frames: int) -> None:
    """A continuous timeline. The range of centres is such that every frame is a whole number."""
    step = 65535 // (n_frames - 1)
    is_still = frames == EVERY_FRAME
    centers = np.where(is_still, step * (n_frames - 1) // 2, step * frames)
    codes = np.stack([centers, np.where(is_still, 65535, 0)], axis=1)
    files = ["timeline_l.webp", "timeline_u.webp"]
    pixels.update(zip(files, bytes_of(codes), strict=True))
    meta["timeline"] = {
        "type": 1,
        "mins": [0.0, BELL_FRAMES / (n_frames - 1)],
        "maxs": [65535 / (step * (n_frames - 1)), STILL_SIGMA],
        "files": files,
    }


def _add_speeds(meta: dict[str, Any], pixels: dict[str, np.ndarray], speeds: np.ndarray) -> None:
    """Translations in units per length of the file. The range is such that no speed is a whole number."""
    moving = np.abs(speeds[speeds.any(1)])
    if not len(moving):
        return
    level = np.maximum(np.quantile(moving, _SPEED_QUANTILE, axis=0), 1e-12) / _SPEED_LEVELS
    codes = np.clip(np.rint(speeds / level), -_SPEED_LEVELS - 1, _SPEED_LEVELS) + _SPEED_LEVELS + 1
    pixels["speeds.webp"] = codes
    mins, maxs = (level * limit for limit in (-_SPEED_LEVELS - 1, _SPEED_LEVELS))
    meta["temporal"] = {"means": {"mins": [mins.tolist()], "maxs": [maxs.tolist()], "files": ["speeds.webp"]}}


def _add_frames(meta: dict[str, Any], pixels: dict[str, np.ndarray], frames: np.ndarray, n_frames: int) -> None:
    """A discrete timeline."""
    delta = 65536 // n_frames
    files = ["timeline_l.webp", "timeline_u.webp"]
    pixels.update(zip(files, bytes_of((frames * delta + delta // 2)[:, None]), strict=True))
    meta["timeline"] = {"type": 0, "N": n_frames, "delta": delta, "files": files}


def _notes(timing: SequenceTiming, is_continuous: bool, n_written: int, n_repeated: int) -> Iterator[str]:
    if is_continuous and timing.n_frames > 1:
        yield (
            "Timeline: continuous. Still Gaussians are stored once, what moves at every frame with its speed. Players "
            "that show moments between frames let one frame fade into the next."
        )
        if n_repeated:
            yield (
                f"Up to {n_repeated:,} Gaussians of a frame stand still in a part of the scene only, or in changing "
                "light; they are stored at every frame, and fade as well."
            )
    elif timing.n_frames > 1:
        yield (
            "Timeline: discrete, as too few Gaussians stand still or can be followed from frame to frame. All of them "
            "are stored at every frame, and players show no motion between frames."
        )
    if n_written > _PLAYER_ROWS:
        yield (
            f"The file has {n_written:,} Gaussians. OpsiClear's player shows {_PLAYER_ROWS:,} of a file unless its "
            "limit is raised (maxPoints)."
        )
    if timing.sound is not None and timing.sound.n_bytes > MOST_SOUND_BYTES:
        yield f"The sound of {timing.sound.n_bytes >> 20} MB is left out: a .tsog holds {MOST_SOUND_BYTES >> 20} MB."
