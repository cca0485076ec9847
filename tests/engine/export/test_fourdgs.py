""".4dgs files: what was written comes back, other programs' readers agree, and no file does harm."""

from __future__ import annotations

import itertools
import struct
import tracemalloc
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import fourdgs
import numpy as np
import pytest
from fourdgs import records
from fourdgs.quantization import Bounds, Steps
from fourdgs.serialization import MAGIC

from engine.errors import ProjectError
from engine.export.sequences.fourdgs_reader import MAX_ROWS, FourdgsReader, problems
from engine.export.sequences.fourdgs_writer import FAINTEST, write
from engine.export.sequences.segments import PATH_SHARE, segments
from engine.export.sequences.sequence import MovingSplats, SequenceSound, SequenceStretch, SequenceTiming
from engine.export.splats import Splats
from tests.engine.export.made_sequence import FPS, N_FRAMES, N_MOVING, N_OTHER, N_STILL, N_STRETCHES, MadeSequence
from tests.engine.export.scenes import angles_deg, chance_splats, one_splat, order_of

SOUND = b"RIFF....WAVE, or so"
TIMING = SequenceTiming(N_FRAMES, FPS, SequenceSound(len(SOUND), lambda: (SOUND[:7], SOUND[7:])))


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of the made sequence."""
    path = tmp_path_factory.mktemp("sequence") / "made.4dgs"
    assert write(MadeSequence().stretches(), TIMING, path) == ()
    return path


def test_every_frame_comes_back_nearly_as_it_was(path: Path):
    made, reader = MadeSequence(), FourdgsReader(path)
    assert reader.timing == TIMING
    assert reader.timing.sound is not None
    assert b"".join(reader.timing.sound.pieces()) == SOUND
    assert reader.notes == ()
    for frame in (35, 0, 11, 12, 5, 23):
        found, live = reader.splats(frame), made.frame(frame)
        assert len(found) == len(live)
        order = order_of(found, live)
        assert len(set(order.tolist())) == len(order)
        live = live[order]
        reach = PATH_SHARE * np.exp(np.log(live.scales).mean(1)) / np.sqrt(live.opacities) + 0.004
        assert (np.abs(found.means - live.means) <= reach[:, None]).all()
        np.testing.assert_allclose(np.log(found.scales), np.log(live.scales), atol=0.17)
        np.testing.assert_allclose(found.opacities, live.opacities, atol=0.04)
        np.testing.assert_allclose(found.colors, live.colors, atol=0.02)
        assert angles_deg(found.quats, live.quats).max() < 5.0
    reader.close()


def test_the_librarys_reader_and_validator_agree(path: Path):
    assert problems(path) == ()
    scene = fourdgs.read(path)
    assert scene.header.attributes["visibility_profile"] == "box"
    assert scene.audio_sources[0].data == SOUND
    with closing(FourdgsReader(path)) as reader:
        frames = {frame: reader.splats(frame) for frame in (0, 17, 35)}
    for frame, found in frames.items():
        state = scene.state_at(frame / FPS)
        assert len(state["indices"]) == len(found)
        np.testing.assert_allclose(np.sort(state["centers"], axis=0), np.sort(found.means, axis=0), atol=1e-4)
    assert len(scene.state_at((N_FRAMES - 1 + 0.999) / FPS)["indices"]) > 0
    assert len(scene.state_at(N_FRAMES / FPS)["indices"]) == 0


def test_sound_of_any_length_takes_little_memory(tmp_path: Path):
    piece, still = bytes(1 << 20), chance_splats(5)
    timing = SequenceTiming(2, 30.0, SequenceSound(64 << 20, lambda: itertools.repeat(piece, 64)))
    nothing = MovingSplats(still[:0], np.zeros(0, np.int64))
    tracemalloc.start()
    write([SequenceStretch(0, 2, still, lambda frame: nothing)], timing, tmp_path / "long.4dgs")
    with closing(FourdgsReader(tmp_path / "long.4dgs")) as reader:
        assert reader.timing == timing
        assert len(reader.splats(1)) == int((still.opacities >= FAINTEST).sum())
        assert reader.timing.sound is not None
        assert all(not any(part) for part in reader.timing.sound.pieces())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8e6


def test_what_stands_still_or_goes_straight_is_stored_once(path: Path):
    scene = fourdgs.read(path).gaussians
    lasts = np.round((scene.win_hi - scene.win_lo) * FPS).astype(int)
    assert (lasts == N_FRAMES).sum() == N_STILL
    n_groups = 2 * N_STRETCHES  # of ten and two frames
    moves = np.abs(scene.motions).max(1) > 0
    assert ((lasts == 10) & moves).sum() >= N_STRETCHES * N_MOVING // 2
    n_all = N_STILL + N_STRETCHES * N_OTHER + n_groups * N_MOVING // 2 + N_FRAMES * N_MOVING // 2
    assert scene.count < n_all


def test_light_that_changes_a_little_does_not_break_a_row(tmp_path: Path):
    still = chance_splats(50)
    nothing = MovingSplats(still[:0], np.zeros(0, np.int64))

    def stretches(change: float):
        for number in range(2):
            colors = still.colors + np.float32(change * number)
            lit = Splats(still.means, still.quats, still.scales, still.opacities, colors)
            yield SequenceStretch(4 * number, 4, lit, lambda frame: nothing)

    n_rows = []
    for change in (1.0 / 255.0, 10.0 / 255.0):
        write(stretches(change), SequenceTiming(8, 30.0), tmp_path / "lit.4dgs")
        n_rows.append(fourdgs.read(tmp_path / "lit.4dgs").header.gaussian_count)
        assert problems(tmp_path / "lit.4dgs") == ()
    n_seen = int((still.opacities >= FAINTEST).sum())
    assert n_rows == [n_seen, 2 * n_seen]


def test_segments_stay_near_every_frame():
    random = np.random.default_rng(0)
    paths = np.cumsum(random.normal(0.0, 0.02, (12, 40, 3)), axis=0)
    base = chance_splats(40)
    frames = []
    for frame in range(12):
        ids = np.flatnonzero(random.random(40) < 0.8)
        means = paths[frame].astype(np.float32)
        moved = Splats(means, base.quats, base.scales, base.opacities, base.colors)
        frames.append(MovingSplats(moved[ids], ids))
    found = segments(frames)
    n_seen = 0
    for number, frame in enumerate(frames):
        rows = np.flatnonzero((found.first <= number) & (number < found.end))
        assert sorted(found.ids[rows]) == sorted(frame.ids)
        n_seen += len(rows)
        rows = rows[np.argsort(found.ids[rows])]
        there = found.means[rows] + found.velocities[rows] * (number - found.first[rows])[:, None]
        splats = frame.splats
        reach = PATH_SHARE * np.exp(np.log(splats.scales).mean(1)) / np.sqrt(np.maximum(splats.opacities, 0.05))
        assert (np.abs(there - splats.means) <= reach[:, None] + 1e-5).all()
    assert len(found) < n_seen


def test_nothing_at_all_is_a_file_too(tmp_path: Path):
    empty = chance_splats(3)[:0]
    nothing = MovingSplats(empty, np.zeros(0, np.int64))
    write([SequenceStretch(0, 2, empty, lambda frame: nothing)], SequenceTiming(2, 30.0), tmp_path / "e.4dgs")
    with closing(FourdgsReader(tmp_path / "e.4dgs")) as reader:
        assert [len(reader.splats(frame)) for frame in range(reader.timing.n_frames)] == [0, 0]
    assert problems(tmp_path / "e.4dgs") == ()


def test_what_does_not_fit_is_said(tmp_path: Path):
    usual = chance_splats(20)
    odd = [one_splat(means=[[1e12, 0.0, 0.0]]), one_splat(colors=[[1.5, 0.5, 0.5]])]
    columns: list[Any] = [np.concatenate([getattr(one, name) for one in (usual, *odd)]) for name in NAMES]
    still = Splats(*columns)
    moving = MovingSplats(still[:0], np.zeros(0, np.int64))
    notes = write([SequenceStretch(0, 1, still, lambda frame: moving)], SequenceTiming(1, 30.0), tmp_path / "o.4dgs")
    assert ["too far away" in notes[0], "brighter than white" in notes[1]] == [True, True]
    assert notes[0].startswith("1 Gaussians")


NAMES = ("means", "quats", "scales", "opacities", "colors")


# -------------------------------------------------------------------- bad files


def tried(path: Path) -> int:
    """Open a file and read some frames. Returns how many Gaussians that gave. Raises nothing but ProjectError."""
    with closing(FourdgsReader(path)) as reader:
        n_frames = reader.timing.n_frames
        return sum(len(reader.splats(frame)) for frame in {0, n_frames // 2, n_frames - 1})


def mutations(good: bytes) -> list[bytes]:
    """Damaged copies: cut off, flipped, overwritten with large numbers, with pieces twice or left out."""
    random = np.random.default_rng(7)
    found = [good[:n] for n in (0, 5, 8, 20, len(good) // 2, len(good) - 1)]
    places = np.concatenate([random.integers(0, 700, 100), random.integers(0, len(good) - 8, 94)])
    for number, place in enumerate(places.tolist()):
        copy = bytearray(good)
        match number % 5:
            case 0:
                copy[place] ^= int(random.integers(1, 256))
            case 1:
                copy[place : place + 4] = b"\xff\xff\xff\x7f"
            case 2:
                copy[place : place + 8] = struct.pack("<d", float(random.choice([np.inf, np.nan, -1e300, 1e300])))
            case 3:
                copy[place:place] = copy[place : place + 16]
            case _:
                del copy[place : place + 3]
        found.append(bytes(copy))
    tail = len(good) - 400  # where the index is
    for place in range(tail, tail + 40):
        found.append(good[:place] + b"\xff" * 4 + good[place + 4 :])
    return found


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_no_damaged_file_does_more_than_raise_a_typed_error(path: Path, tmp_path: Path):
    broken, n_refused = tmp_path / "broken.4dgs", 0
    files = mutations(path.read_bytes())
    assert len(files) >= 200
    tracemalloc.start()
    for data in files:
        broken.write_bytes(data)
        try:
            tried(broken)
        except ProjectError:
            n_refused += 1
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert n_refused > len(files) // 3
    assert peak < 400e6


def one_chunk(streams: bytes, n_rows: int, **header: object) -> bytes:
    """A file of one chunk with these columns."""
    bounds = Bounds.for_profile()
    steps = Steps.of(bounds)
    about = {"duration_sec": 1.0, "gaussian_count": n_rows, "aabb": [0.0] * 6, **header}
    grid = [steps.pos, steps.scale_log, steps.rot, steps.rgb, steps.alpha, steps.motion, steps.time, steps.sigma_log]
    front = MAGIC + records.Header(**about).encode()  # type: ignore[arg-type]
    entries: list[Any] = ["uniform-v1", [0.0] * 3, *grid, 1, bounds.as_strings()]
    front += records.Quantization(*entries).encode()
    front += records.WindowTable([(0.0, 1.0)]).encode()
    chunk = records.encode_chunk(0.0, 1.0, 0, n_rows, streams)
    entry = records.ChunkIndexEntry(0.0, 1.0, len(front), len(chunk), n_rows)
    body = front + chunk
    return body + entry.encode() + records.Footer(len(body), 0, 0).encode() + MAGIC


def column(n_rows: int, n_channels: int = 3) -> bytes:
    """The head of a column that repeats one number, and its nine bytes."""
    return struct.pack("<BBBBBIQ", 0, 1, 2, 0, n_channels, n_rows, 9) + b"\x78\x9c\x63\x60\x60\x00\x00\x00\x03"


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda good: b"not a file of splats", "magic"),
        (lambda good: good[:5] + b"2" + good[6:], "version"),
        (lambda good: good[:-3], "truncated"),
        (lambda good: good[: len(good) // 3], "outside|truncated|remain"),
        (lambda good: one_chunk(column(1 << 31), 5), "a column has 2,147,483,648 rows, its chunk 5"),
        (lambda good: one_chunk(column(1 << 31), (1 << 32) - 1), f"at most {MAX_ROWS:,} are read"),
        (lambda good: one_chunk(b"", 0, duration_sec=1e12), "it lasts 1e"),
        (lambda good: one_chunk(b"", 0, duration_sec=float("nan")), "it lasts nan"),
        (lambda good: one_chunk(b"", 0, temporal_model="keyframe-delta"), "keyframe-delta"),
    ],
)
def test_bad_files_are_refused_in_words_and_little_memory(
    path: Path, tmp_path: Path, make: Callable[[bytes], bytes], words: str
):
    bad = tmp_path / "bad.4dgs"
    bad.write_bytes(make(path.read_bytes()))
    tracemalloc.start()
    with pytest.raises(ProjectError, match=words):
        tried(bad)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 60e6


def test_a_file_that_is_not_there_is_named(tmp_path: Path):
    with pytest.raises(ProjectError, match=r"nowhere\.4dgs"):
        FourdgsReader(tmp_path / "nowhere.4dgs")
