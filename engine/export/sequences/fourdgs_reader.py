"""Reading .4dgs files frame by frame, with the library fourdgs: only the chunks that a moment needs."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from fourdgs import indexed_reader, records
from fourdgs.exceptions import FourdgsError, UnsupportedCodec, UnsupportedVersion
from fourdgs.readable import FileReadable
from fourdgs.serialization import Cursor
from fourdgs.stream_reader import chunk_stream_bytes
from fourdgs.validate import validate

from engine.byte_cache import ByteCache
from engine.errors import ProjectError
from engine.export.sequences.fourdgs_writer import FPS_KEY
from engine.export.sequences.sequence import SequenceSound, SequenceTiming
from engine.export.splats import PLY_UP, Splats
from engine.export.world import AXES
from engine.images.srgb import encoded_of

USUAL_FPS = 30.0
"""Frames per second where a file does not state them."""
MAX_FPS = 1000.0
MAX_FRAMES = 10_000_000
MAX_ROWS = 1 << 22
"""Gaussians of a moment: more are not read, since each takes about 300 bytes meanwhile."""
MAX_READ_BYTES = 1 << 30
CACHE_BYTES = 192 << 20
MAX_VALIDATED_BYTES = 128 << 20
"""The library's validator holds the whole file in memory, and its sound twice; a longer file is not given to it."""
_PIECE_BYTES = 1 << 20
_STREAM_HEADER = struct.Struct("<BBBBBIQ")


@dataclass(frozen=True, slots=True)
class _Rows:
    """Decoded rows of a chunk; times in seconds."""

    splats: Splats
    velocities: np.ndarray
    middle: np.ndarray
    sigma: np.ndarray
    begin: np.ndarray
    end: np.ndarray
    object_id: np.ndarray | None

    @property
    def n_bytes(self) -> int:
        return 100 * len(self.splats)


class _BoundedFile(FileReadable):
    """A file of which no more than a limit is read at once, whatever it says of itself."""

    def read(self, offset: int, length: int) -> bytes:
        if not 0 <= length <= MAX_READ_BYTES:
            raise ValueError(f"{length:,} bytes at once; at most {MAX_READ_BYTES:,} are read")
        return super().read(offset, length)


class FourdgsReader:
    """A file, opened. Frames may be read in any order; a few chunks stay in memory. Not for several threads at once.

    Args:
        path: The file.
    Raises:
        ProjectError: It is damaged, of an unknown version or model, or asks for more memory than a limit.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._kept: ByteCache[int, _Rows] = ByteCache(CACHE_BYTES)
        self._file: _BoundedFile | None = None
        try:
            with _typed_errors(path):
                self._file = _BoundedFile(path)
                self._scene = indexed_reader.open_indexed(self._file)
                self._windows = np.array(self._scene.windows or [(0.0, 0.0)], np.float64)
                self._objects = indexed_reader.read_objects(self._file, self._scene)
                self._fps, self._timing = self._read_timing()
                self._up = _up_of(self._scene.header.attributes.get("coordinate_system", ""))
        except BaseException:
            self.close()
            raise

    @property
    def timing(self) -> SequenceTiming:
        """When its frames are shown."""
        return self._timing

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the file is not kept, as sentences for the user."""
        header, found = self._scene.header, []
        if FPS_KEY not in header.attributes:
            found.append(f"The file does not state frames per second; it is read at {self._fps:g}.")
        if header.sh_degree:
            found.append("Colours that depend on the direction of view are left out.")
        if self._scene.audio_sources and self._timing.sound is None:
            found.append("Its sound is left out: only WAV is kept.")
        return tuple(found)

    def close(self) -> None:
        """Let go of the file."""
        self._kept.clear()
        if self._file is not None:
            self._file.close()

    def splats(self, frame: int) -> Splats:
        """All Gaussians of a frame of the file. Raises ProjectError where it is damaged there."""
        if not 0 <= frame < self._timing.n_frames:
            raise ValueError(f"the file has frames 0 to {self._timing.n_frames - 1}, not {frame}")
        time_s = frame / self._fps
        with _typed_errors(self._path):
            entries = self._scene.chunks_for_time(time_s)
            n_rows = sum(entry.gaussian_count for entry in entries)
            if n_rows > MAX_ROWS:
                raise ValueError(f"{n_rows:,} Gaussians at one moment; at most {MAX_ROWS:,} are read")
            parts = [self._at(self._rows(entry), time_s) for entry in entries]
        columns = [np.concatenate([part[column] for part in parts]) for column in range(5)] if parts else _NO_COLUMNS
        return replace(Splats.from_arrays(*columns), up=self._up)

    def _at(self, rows: _Rows, time_s: float) -> tuple[np.ndarray, ...]:
        """Means, quats, scales, opacities and colours of the rows that are there at a time."""
        away = time_s - rows.middle
        with np.errstate(over="ignore", invalid="ignore"):
            share = np.where(np.isfinite(rows.sigma), np.exp(-0.5 * np.square(away / np.maximum(rows.sigma, 1e-30))), 1)
        is_there = (rows.begin <= time_s) & (time_s < rows.end) & (share >= self._scene.header.cutoff)
        splats, away = rows.splats[np.flatnonzero(is_there)], away[is_there, None]
        means, quats = splats.means + rows.velocities[is_there] * away, splats.quats
        if rows.object_id is not None and self._objects.tracks:
            turned = quats[:, [1, 2, 3, 0]].astype(np.float64)
            means, turned = self._objects.apply(
                centers=means.astype(np.float64), orientations=turned, object_ids=rows.object_id[is_there], t=time_s
            )
            quats = turned[:, [3, 0, 1, 2]]
        return means, quats, splats.scales, splats.opacities * share[is_there], splats.colors

    def _rows(self, entry: records.ChunkIndexEntry) -> _Rows:
        known = self._kept.get(entry.chunk_offset)
        if known is None:
            assert self._file is not None
            _check_streams(self._file.read(entry.chunk_offset, entry.chunk_length), entry.gaussian_count)
            found = indexed_reader.read_chunk(self._file, self._scene, entry)
            windows = self._windows[found["window_index"]]
            colors = found["colors"]
            rgb = colors[:, :3]
            if self._scene.header.attributes.get("color_space") == "linear-rec709-display":
                rgb = encoded_of(rgb)
            splats = Splats(
                means=found["positions"].astype(np.float32),
                quats=found["rotations"][:, [3, 0, 1, 2]].astype(np.float32),
                scales=found["scales"].astype(np.float32),
                opacities=colors[:, 3].astype(np.float32),
                colors=rgb.astype(np.float32),
            )
            motions = found["motions"].astype(np.float32)
            times = found["mu_t"], found["sigma_t"], windows[:, 0], windows[:, 1]
            known = _Rows(splats, motions, *times, found["object_id"])
            self._kept.put(entry.chunk_offset, known, known.n_bytes)
        return known

    def _read_timing(self) -> tuple[float, SequenceTiming]:
        header = self._scene.header
        fps = _number(header.attributes.get(FPS_KEY, ""), USUAL_FPS)
        if not (math.isfinite(header.duration_sec) and 0.0 <= header.duration_sec * fps <= MAX_FRAMES):
            raise ValueError(f"it lasts {header.duration_sec:g} s; at most {MAX_FRAMES / fps:g} s are read")
        sound = None
        for one in self._scene.audio_sources[:1]:
            assert self._file is not None
            about = indexed_reader.read_audio_source_descriptors(self._file, self._scene)[0]
            if about.codec == "wav" and about.start_sec == 0.0:
                sound = SequenceSound(one.data_length, partial(self._pieces, one.data_offset, one.data_length))
        return fps, SequenceTiming(max(1, round(header.duration_sec * fps)), fps, sound)

    def _pieces(self, start: int, n_bytes: int) -> Iterator[bytes]:
        """A part of the file, piece by piece. Raises ProjectError where it cannot be read."""
        end = start + n_bytes
        with _typed_errors(self._path):
            for at in range(start, end, _PIECE_BYTES):
                assert self._file is not None
                yield self._file.read(at, min(_PIECE_BYTES, end - at))


def problems(path: Path) -> tuple[str, ...]:
    """What the library's validator says is wrong with a file; nothing of one that is too long for it."""
    with _typed_errors(path):
        if path.stat().st_size > MAX_VALIDATED_BYTES:
            return ()
        found = validate(path.read_bytes())
    return tuple(finding.message for finding in found.findings if finding.severity == "error")


@contextmanager
def _typed_errors(path: Path) -> Iterator[None]:
    """Whatever a file leads the library into is an error of that file."""
    try:
        yield
    except (UnsupportedVersion, UnsupportedCodec) as error:
        raise ProjectError(
            f"This .4dgs file cannot be read: {error}.", hint="Another program may.", path=path
        ) from error
    except (FourdgsError, ValueError, ArithmeticError, LookupError, struct.error, MemoryError) as error:
        raise ProjectError(f"This .4dgs file is damaged: {error}.", hint="Export it again.", path=path) from error
    except OSError as error:
        raise ProjectError(f"The file cannot be read ({error.strerror}).", hint="Check its name.", path=path) from error


def _check_streams(chunk: bytes, n_rows: int) -> None:
    """Check that no column of a chunk says that it has more rows than the chunk. Raises ValueError, FourdgsError."""
    head, streams = records.parse_chunk(Cursor(chunk, 9).take(len(chunk) - 9))
    cursor = Cursor(chunk_stream_bytes(head, streams))
    while cursor.remaining():
        *_, n, n_bytes = _STREAM_HEADER.unpack(cursor.take(_STREAM_HEADER.size))
        if n > n_rows:
            raise ValueError(f"a column has {n:,} rows, its chunk {n_rows:,}")
        cursor.take(n_bytes)


def _up_of(system: str) -> tuple[float, float, float]:
    """Which way is up in a coordinate system such as "z-up-right-handed"; as in most files where that says nothing."""
    axis, is_said, _ = system.removeprefix("minus-").partition("-up")
    sign = "-" if system.startswith("minus-") else "+"
    return AXES.get(f"{sign}{axis}", PLY_UP) if is_said else PLY_UP


def _number(text: str, otherwise: float) -> float:
    """A number of frames per second."""
    try:
        found = float(text)
    except ValueError:
        return otherwise
    return found if 0.0 < found <= MAX_FPS else otherwise


_NO_COLUMNS = [np.zeros((0, 3)), np.zeros((0, 4)), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3))]
