""".4dgs files, as the library fourdgs reads them: rows with windows of time in which they are there, in chunks.

The library's own writer takes the whole scene at once. This one writes chunk by chunk with the library's records, so
that memory does not grow with the length of a capture. What stands still is one row for as long as it does not change;
what moves is cut into segments (engine.export.sequences.segments). Keyframes with differences, the other model of the
format, took 41 to 56 % more bytes on a real capture.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
from fourdgs import opcode, records
from fourdgs.serialization import MAGIC, crc32, put_u8, put_u32, put_u64

from engine.export.sequences.fourdgs_grid import ChunkRows, FourdgsGrid
from engine.export.sequences.segments import segments
from engine.export.sequences.sequence import MovingSplats, SequenceStretch, SequenceTiming
from engine.export.sequences.still_rows import LastingRows, StillRows
from engine.export.splats import Splats

GROUP_FRAMES = 10
"""What moves in so many frames is one chunk, which is read at once."""
SPAN_S = 10.0
"""What stands still is stated again after so long, so that a moment never needs many chunks."""
FAINTEST = 5.0 / 255.0
"""Fainter Gaussians are left out: they are many, and all together nobody sees them."""
NEAREST_AXIS = 0.999
"""Cosine of the angle up to which an axis counts as up: 2.5 degrees."""
PRODUCER = "ClipGStream Studio"
FPS_KEY = "clipgstream_fps"
"""Attribute with the frames per second of the take that was written; the format itself knows seconds only."""
_BLOCK_BYTES = 1 << 20


def write(stretches: Iterable[SequenceStretch], timing: SequenceTiming, path: Path) -> tuple[str, ...]:
    """Write a file; memory holds a few frames at a time.

    Args:
        stretches: They follow one another without a gap.
        timing: When frames are shown.
        path: Replaced where it is there.
    Returns:
        Sentences about what could not be stored as it is.
    Raises:
        OSError: The disk refused.
    """
    with path.open("w+b") as file:
        chunks = _Chunks(file, timing)
        for rows in _rows(stretches, timing, chunks.look):
            chunks.add(rows)
        chunks.finish()
    return chunks.notes()


def _rows(
    stretches: Iterable[SequenceStretch], timing: SequenceTiming, look: Callable[[Splats], None]
) -> Iterator[ChunkRows]:
    """Rows of each chunk, in order of the frames at which they end. look: is shown each still part beforehand."""
    still = StillRows()
    span = max(1, round(SPAN_S * timing.fps))
    begun = end = 0
    for stretch in stretches:
        if stretch.first_frame - begun >= span:
            yield from _lasting(still.close(stretch.first_frame))
            begun = stretch.first_frame
        seen = stretch.still[_drawn(stretch.still)]
        look(seen)
        yield from _lasting(still.add(seen, stretch.first_frame))
        end = stretch.first_frame + stretch.n_frames
        for first in range(stretch.first_frame, end, GROUP_FRAMES):
            frames = [stretch.moving(frame) for frame in range(first, min(first + GROUP_FRAMES, end))]
            yield from _moving(frames, first)
    yield from _lasting(still.close(end))


def _lasting(rows: LastingRows | None) -> Iterator[ChunkRows]:
    if rows is not None:
        yield ChunkRows(rows.splats, rows.first, np.full(len(rows.first), rows.end))


def _moving(frames: list[MovingSplats], first: int) -> Iterator[ChunkRows]:
    kept = []
    for frame in frames:
        rows = _drawn(frame.splats)
        kept.append(MovingSplats(frame.splats[rows], frame.ids[rows]))
    found = segments(kept)
    if len(found):
        splats = replace(
            kept[0].splats,
            means=found.means,
            quats=found.quats,
            scales=found.scales,
            opacities=found.opacities,
            colors=found.colors,
        )
        yield ChunkRows(splats, found.first + first, found.end + first, found.velocities)


def _drawn(splats: Splats) -> np.ndarray:
    return np.flatnonzero(splats.opacities >= FAINTEST)


class _Chunks:
    """Sound and chunks of a file, put down one after another; what comes before them is known at the end only, and
    then they move on to make room for it."""

    def __init__(self, file: BinaryIO, timing: SequenceTiming) -> None:
        self._file, self._timing = file, timing
        self._grid: FourdgsGrid | None = None
        self._first_still: list[Splats] = []
        self._windows: dict[tuple[int, int], int] = {}
        self._entries: list[records.ChunkIndexEntry] = []
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._up = (0.0, -1.0, 0.0)
        self._n_far = self._n_bright = 0
        if timing.sound is not None:
            n = timing.sound.n_bytes
            file.write(put_u8(opcode.AUDIO_DATA) + put_u64(12 + n) + put_u32(0) + put_u64(n))  # as records.AudioData
            for piece in timing.sound.pieces():
                file.write(piece)

    def look(self, still: Splats) -> None:
        """See a still part before it is added: grids have to fit it too."""
        if self._grid is None:
            self._first_still = [still]

    def add(self, rows: ChunkRows) -> None:
        """Add a chunk."""
        if self._grid is None:
            self._grid = FourdgsGrid([rows.splats, *self._first_still], self._timing.fps)
            self._first_still, self._up = [], rows.splats.up
        is_storable = self._grid.storable(rows.splats)
        if not is_storable.all():
            self._n_far += int((~is_storable).sum())
            rows = rows[np.flatnonzero(is_storable)]
        if not len(rows.first):
            return
        self._n_bright += int((rows.splats.colors > 1.0).any(1).sum())
        spans, which = np.unique(np.stack([rows.first, rows.end], axis=1), axis=0, return_inverse=True)
        numbers = [self._windows.setdefault((first, end), len(self._windows)) for first, end in spans.tolist()]
        record, means = self._grid.chunk(rows, np.array(numbers, np.int64)[which.reshape(-1)])
        self._low, self._high = np.minimum(self._low, means.min(0)), np.maximum(self._high, means.max(0))
        begin, end = self._grid.seconds(int(rows.first.min())), self._grid.seconds(int(rows.end.max()))
        entry = records.ChunkIndexEntry(begin, end, self._file.tell(), len(record), len(rows.first))
        self._entries.append(entry)
        self._file.write(record)

    def finish(self) -> None:
        """Write the rest of the file."""
        file, front = self._file, MAGIC + b"".join(self._front())
        _move_on(file, len(front))
        file.seek(0)
        file.write(front)
        start, begin = file.seek(0, 2), len(front)
        summary = b"".join(replace(one, chunk_offset=one.chunk_offset + begin).encode() for one in self._entries)
        file.write(summary)
        file.write(records.Footer(start if summary else 0, 0, crc32(summary) if summary else 0).encode())
        file.write(MAGIC)

    def _front(self) -> Iterator[bytes]:
        """Everything before sound and chunks."""
        timing, grid = self._timing, self._grid or FourdgsGrid([_NOTHING], self._timing.fps)
        duration_s = grid.seconds(timing.n_frames)
        box = [*self._low.tolist(), *self._high.tolist()] if self._entries else [0.0] * 6
        yield records.Header(
            duration_sec=duration_s,
            gaussian_count=sum(entry.gaussian_count for entry in self._entries),
            aabb=box,
            library=PRODUCER,
            flags=0 if timing.sound is None else records.FLAG_HAS_AUDIO,
            attributes=self._attributes(),
        ).encode()
        yield grid.record()
        yield records.WindowTable([(grid.seconds(first), grid.seconds(end)) for first, end in self._windows]).encode()
        if timing.sound is not None:
            yield records.AudioSource(
                source_id=0,
                name="sound",
                codec="wav",
                channel_layout="unspecified",
                data_length=timing.sound.n_bytes,
                start_sec=0.0,
                duration_sec=duration_s,
                gain=1.0,
                flags=0,
                position=[0.0, 0.0, 0.0],
                rotation=[0.0, 0.0, 0.0, 1.0],
            ).encode()

    def _attributes(self) -> dict[str, str]:
        found = {
            "application": PRODUCER,
            "color_space": "srgb-rec709-display",
            "visibility_profile": "box",
            FPS_KEY: repr(float(self._timing.fps)),
        }
        up = np.array(self._up)
        axis = int(np.abs(up).argmax())
        if abs(up[axis]) > NEAREST_AXIS:
            sign = "" if up[axis] > 0 else "minus-"
            found["coordinate_system"] = f"{sign}{'xyz'[axis]}-up-right-handed"
        return found

    def notes(self) -> tuple[str, ...]:
        """See `write`."""
        found = []
        if self._n_far:
            found.append(f"{self._n_far:,} Gaussians were left out: they lie too far away for the grid of the file.")
        if self._n_bright:
            found.append(f"{self._n_bright:,} rows were brighter than white and are white in the file.")
        return tuple(found)


def _move_on(file: BinaryIO, n_bytes: int) -> None:
    """Move the contents of a file towards its end, the last block first, so that no second file is needed."""
    for end in range(file.seek(0, 2), 0, -_BLOCK_BYTES):
        begin = max(end - _BLOCK_BYTES, 0)
        file.seek(begin)
        block = file.read(end - begin)
        file.seek(begin + n_bytes)
        file.write(block)


_NOTHING = Splats.from_arrays(
    np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]), np.ones((1, 3)), np.ones(1), np.zeros((1, 3))
)
"""Where a file has no rows, its grids are of no use, but have to be there."""
