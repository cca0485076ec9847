"""The .tsog, taken apart here by the formulas of its specification, without the writer's or the reader's help."""

from __future__ import annotations

import io
import json
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from engine.errors import ProjectError
from engine.export.sequences import tsog
from engine.export.sequences.sequence import MovingSplats, SequenceSound, SequenceStretch, SequenceTiming
from engine.export.sequences.table import SEQUENCES
from engine.export.splats import Splats
from tests.engine.export.scenes import angles_deg, chance_splats, one_splat, order_of

FORMAT = SEQUENCES["tsog"]
SH_C0 = 0.28209479177387814


def by_spec(path: Path, time: float) -> dict[str, np.ndarray]:
    """Every Gaussian of a file at a normalised time: means, wxyz, scales, opacity, color. Scalar formulas, float64."""
    meta, pixels = taken_apart(path)
    n = meta["count"]
    flat = {name: picture.reshape(-1, 4)[:n].astype(float) for name, picture in pixels.items()}

    def lerp(low: list[float], high: list[float], share: np.ndarray) -> np.ndarray:
        return np.array(low) + (np.array(high) - np.array(low)) * share

    def two_bytes(names: list[str], channels: slice) -> np.ndarray:
        return (flat[names[0]] + 256 * flat[names[1]])[:, channels] / 65535

    logs = lerp(meta["means"]["mins"], meta["means"]["maxs"], two_bytes(meta["means"]["files"], slice(3)))
    means = np.sign(logs) * (np.exp(np.abs(logs)) - 1)
    scales = np.exp(np.array(meta["scales"]["codebook"])[flat[meta["scales"]["files"][0]][:, :3].astype(int)])
    quats = np.zeros((n, 4))
    for row, (r, g, b, a) in enumerate(flat[meta["quats"]["files"][0]]):
        kept = (2 * np.array([r, g, b]) / 255 - 1) / np.sqrt(2)
        quats[row] = np.insert(kept, int(a) - 252, np.sqrt(max(0.0, 1 - (kept**2).sum())))
    color_pixels = flat[meta["sh0"]["files"][0]]
    colors = 0.5 + SH_C0 * np.array(meta["sh0"]["codebook"])[color_pixels[:, :3].astype(int)]
    opacities = color_pixels[:, 3] / 255
    timeline = meta.get("timeline")
    if timeline and timeline["type"] == 0:
        assert timeline["delta"] == 65536 // timeline["N"]
        codes = two_bytes(timeline["files"], slice(1))[:, 0] * 65535
        frames = np.minimum(timeline["N"] - 1, np.floor(codes.round() / timeline["delta"]))
        opacities = opacities * (frames == min(timeline["N"] - 1, int(time * timeline["N"])))
    elif timeline:
        center, sigma = lerp(timeline["mins"], timeline["maxs"], two_bytes(timeline["files"], slice(2))).T
        opacities = opacities * np.exp(-0.5 * ((time - center) / sigma) ** 2)
        motion = meta["temporal"]["means"]
        (name,) = motion["files"]
        means = means + lerp(motion["mins"][0], motion["maxs"][0], flat[name][:, :3] / 255) * (time - center)[:, None]
    return {"means": means, "quats": quats, "scales": scales, "opacities": opacities, "colors": colors}


def taken_apart(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        meta = json.loads(archive.read("meta.json"))
        pixels = {}
        for name in archive.namelist():
            if name.endswith(".webp"):
                data = archive.read(name)
                assert data[8:16] == b"WEBPVP8L"
                pixels[name] = np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"))
    assert len({picture.shape for picture in pixels.values()}) == 1
    assert meta["version"] == 4
    assert meta["profile"] == {"id": "org.opsiclear.tsog-playback", "version": 1}
    return meta, pixels


def as_one(found: dict[str, np.ndarray], faintest: float = 1 / 255) -> Splats:
    rows = found["opacities"] >= faintest
    return Splats.from_arrays(*(found[name][rows] for name in ("means", "quats", "scales", "opacities", "colors")))


def moved(splats: Splats, by: np.ndarray) -> Splats:
    copy = splats[np.arange(len(splats))]
    copy.means[:] = splats.means + by.astype(np.float32)
    return copy


STILL, MOVING = chance_splats(200, seed=1), chance_splats(60, seed=2)
STEPS = np.random.default_rng(3).uniform(-0.05, 0.05, (60, 3))
LIT = 7
"""A row that is much brighter in the second stretch."""


def scene() -> list[SequenceStretch]:
    """Two stretches of four frames: still rows with a little light in one and much in another, and steady motion."""
    STILL.opacities[:], MOVING.opacities[:] = np.maximum(STILL.opacities, 0.1), np.maximum(MOVING.opacities, 0.1)
    lit = STILL[np.arange(200)]
    lit.colors[:] += np.float32(1.5 / 255)
    lit.colors[LIT] += np.float32(0.3)

    def moving(frame: int) -> MovingSplats:
        rows = np.random.default_rng(frame).permutation(60)[: 60 - frame % 4]
        return MovingSplats(moved(MOVING, frame * STEPS)[rows], 5 * rows.astype(np.int64))

    return [SequenceStretch(0, 4, STILL, moving), SequenceStretch(4, 4, lit, moving)]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "scene.tsog"


def test_frames_say_what_the_specification_says(path: Path):
    notes = FORMAT.write(scene(), SequenceTiming(8, 25.0), path)
    assert "continuous" in notes[0]
    assert "1 Gaussians" in notes[1]
    meta, _ = taken_apart(path)
    assert meta["playback"]["duration"] == 7 / 25
    assert meta["count"] == 199 + 8 + sum(60 - frame % 4 for frame in range(8))
    reader = FORMAT.open(path)
    assert (reader.timing, reader.notes) == (SequenceTiming(8, 25.0), ())
    for frame in (0, 3, 4, 7):
        truth, found = as_one(by_spec(path, frame / 7)), reader.splats(frame)
        for name in ("means", "scales", "opacities", "colors"):
            np.testing.assert_allclose(getattr(found, name), getattr(truth, name), atol=2e-6, rtol=1e-6)
        assert angles_deg(found.quats, truth.quats).max() < 0.06  # of float32


def test_frames_look_like_the_scene(path: Path):
    stretches = scene()
    FORMAT.write(stretches, SequenceTiming(8, 25.0), path)
    reader = FORMAT.open(path)
    for frame in (0, 3, 4, 7):
        found, moving = reader.splats(frame), stretches[frame // 4].moving(frame)
        faint = found.opacities < 0.04 * 0.98  # what is left of neighbouring frames
        found, still = found[~faint], stretches[frame // 4].still
        assert len(found) == 200 + len(moving.ids)
        for source in (still, moving.splats):
            near = found[order_of(source, found)]
            np.testing.assert_allclose(near.means, source.means, atol=2e-4)
            np.testing.assert_allclose(near.opacities, source.opacities, atol=0.003)
            np.testing.assert_allclose(near.colors, source.colors, atol=0.012)
            np.testing.assert_allclose(np.log(near.scales), np.log(source.scales), atol=0.02)
            assert angles_deg(near.quats, source.quats).max() < 0.9


def test_half_way_between_frames_both_lie_where_the_motion_is(path: Path):
    FORMAT.write(scene(), SequenceTiming(8, 25.0), path)
    found = as_one(by_spec(path, 1.5 / 7), 0.04)
    truth = moved(MOVING, 1.5 * STEPS)
    near = found[order_of(truth, found)]
    np.testing.assert_allclose(near.means, truth.means, atol=1e-3)
    np.testing.assert_allclose(
        near.opacities, truth.opacities * np.exp(-0.5 * (0.5 / tsog.BELL_FRAMES) ** 2), atol=0.01
    )


def test_what_cannot_be_followed_is_discrete_and_exact(path: Path):
    frames = [chance_splats(50 + k, seed=k) for k in range(5)]
    stretch = SequenceStretch(0, 5, STILL[:10], lambda k: MovingSplats(frames[k], np.arange(len(frames[k])) + 1000 * k))
    (note,) = FORMAT.write([stretch], SequenceTiming(5, 30.0), path)
    assert "discrete" in note
    reader = FORMAT.open(path)
    assert reader.timing == SequenceTiming(5, 30.0)
    for k in range(5):
        truth, found = as_one(by_spec(path, k / 5)), reader.splats(k)
        assert len(found) == 60 + k
        np.testing.assert_allclose(found.means, truth.means, atol=2e-6)
        np.testing.assert_allclose(found[order_of(frames[k], found)].means, frames[k].means, atol=2e-4)


def test_light_that_moves_a_little_within_a_stretch_stands_still(path: Path):
    def moving(frame: int) -> MovingSplats:
        lit = STILL[:50]
        lit = lit[np.arange(50)]
        lit.colors[:] += np.float32(frame / 255)
        return MovingSplats(lit, np.arange(50))

    FORMAT.write([SequenceStretch(0, 4, STILL[50:], moving)], SequenceTiming(4, 30.0), path)
    assert taken_apart(path)[0]["count"] == 200


@pytest.mark.parametrize("n", [0, 1, 300])
def test_a_single_frame_is_static(path: Path, n: int):
    splats, data = chance_splats(n), b"RIFF" + bytes(500)
    sound = SequenceSound(len(data), lambda: (data[:100], data[100:]))
    stretch = SequenceStretch(0, 1, splats, lambda _: MovingSplats(splats[:0], np.zeros(0, np.int64)))
    assert FORMAT.write([stretch], SequenceTiming(1, 30.0, sound), path) == ()
    assert "timeline" not in taken_apart(path)[0]
    reader = FORMAT.open(path)
    assert reader.timing == SequenceTiming(1, 30.0, sound)
    assert reader.timing.sound is not None
    assert b"".join(reader.timing.sound.pieces()) == data
    assert len(reader.splats(0)) == n


def test_too_many_gaussians_say_how_many_frames_fit(path: Path, monkeypatch: pytest.MonkeyPatch):
    for most, n_fit in ((600, 6), (179, 3)):
        monkeypatch.setattr(tsog, "MAX_ROWS", most)
        with pytest.raises(ProjectError, match=rf"holds {most}\. At most the first {n_fit} frames fit"):
            FORMAT.write(scene(), SequenceTiming(8, 25.0), path)
    with pytest.raises(ProjectError, match="the first 65,536 frames fit"):
        FORMAT.write(scene(), SequenceTiming(70_000, 25.0), path)


# ------------------------------------------------------------------------------------------------- files of others


def webp(pixels: Any, **options: Any) -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.array(pixels, np.uint8), "RGBA").save(
        file, "WEBP", **{"lossless": True, "exact": True} | options
    )
    return file.getvalue()


LOG2 = 0.6931471805599453


def published() -> tuple[dict[str, Any], dict[str, bytes]]:
    """The profile's decoding example: two Gaussians with bells, speeds of 16 bits and colours of degree 1."""
    ends = [[[0, 0, 0, 255], [255, 0, 0, 255]]]
    meta = {
        "version": 4,
        "count": 2,
        "means": {"mins": [-LOG2, 0, LOG2], "maxs": [LOG2, 0, LOG2], "files": ["pl", "ph"]},
        "scales": {"codebook": [0], "files": ["s"]},
        "quats": {"files": ["q"]},
        "sh0": {"codebook": [0, 1, -1], "files": ["dc"]},
        "shN": {"bands": 1, "count": 1, "codebook": [0, 0.5, -0.5], "files": ["palette", "labels"]},
        "timeline": {"type": 1, "mins": [-1, 0.5], "maxs": [1, 0.5], "files": ["pl", "ph"]},
        "temporal": {"means": {"mins": [[-2, 0, 0]], "maxs": [[2, 0, 65535]], "files": ["vl", "vh"]}},
        "playback": {"duration": 2, "fps": 2, "rate": 2, "loop": False, "unknown": 1},
    }
    pictures = {
        "pl": webp(ends),
        "ph": webp(ends),
        "s": webp([[[0, 0, 0, 255]] * 2]),
        "q": webp([[[128, 128, 128, 252], [128, 128, 128, 255]]]),
        "dc": webp([[[0, 1, 2, 128], [2, 0, 1, 255]]]),
        "vl": webp([[[0, 0, 1, 255], [255, 0, 2, 255]]]),
        "vh": webp([[[0, 0, 2, 255], [255, 0, 1, 255]]]),
    }
    return meta, pictures


def packed(path: Path, meta: Any, pictures: dict[str, bytes], how: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", how) as archive:
        for name, data in pictures.items():
            archive.writestr(name, data)
        archive.writestr("meta.json", json.dumps(meta))
    return path


def test_the_published_example_decodes_as_published(path: Path):
    reader = FORMAT.open(packed(path, *published()))
    assert (reader.timing.n_frames, reader.timing.fps) == (5, 2.0)
    assert reader.notes == ("Colours that depend on the viewing direction are left out.",)
    found = reader.splats(0)
    np.testing.assert_allclose(found.means, [[-3, 0, 514], [-1, 0, -257]], atol=1e-6)
    np.testing.assert_allclose(found.opacities, [0.0679330049187703, 0.1353352832366127], atol=1e-6)
    np.testing.assert_allclose(found.scales, 1.0)
    np.testing.assert_allclose(found.colors, 0.5 + SH_C0 * np.array([[0, 1, -1], [-1, 0, 1]]), atol=1e-6)
    np.testing.assert_allclose(np.abs(found.quats), [[1, 0, 0, 0], [0, 0, 0, 1]], atol=0.003)


Change = Callable[[dict[str, Any], dict[str, bytes]], object]


def _put(group: str, **entries: Any) -> Change:
    return lambda meta, _: meta[group].update(entries)


def _top(**entries: Any) -> Change:
    return lambda meta, _: meta.update(entries)


def _head(name: str, width: int, height: int) -> Change:
    """A picture that says it is larger."""

    def change(_: dict[str, Any], pictures: dict[str, bytes]) -> None:
        data = bytearray(pictures[name])
        data[21:25] = struct.pack("<I", (width - 1) | (height - 1) << 14)
        pictures[name] = bytes(data)

    return change


BAD: dict[str, tuple[Change, str]] = {
    "version": (_top(version=5), "its version is 5; version 4 can be read"),
    "profile": (_top(profile={"id": "org.opsiclear.tsog-playback", "version": 2}), "tsog-playback 2"),
    "no count": (lambda meta, _: meta.pop("count"), "count"),
    "count 0": (_top(count=0), "count"),
    "many Gaussians": (_top(count=1 << 40), "1,099,511,627,776 Gaussians"),
    "more than pixels": (_top(count=3), "too few pixels"),
    "many frames": (_put("playback", duration=1e300), "float|duration"),
    "long": (_put("playback", duration=1e9), "2,000,000,001 frames"),
    "null": (_top(playback=None), "playback"),
    "not finite": (_put("means", mins=[1e39, 0, 0]), "mins"),
    "codebook": (_put("scales", codebook=[0.0] * 257), "codebook"),
    "turned range": (_put("means", mins=[2, 0, 0]), "lower end"),
    "no sigma": (_put("timeline", mins=[-1, 0]), "mins"),
    "timeline of another type": (_put("timeline", type=2), "type"),
    "steps": (_top(timeline={"type": 0, "N": 3, "delta": 5, "files": ["pl", "ph"]}), "steps of 5"),
    "unknown motion": (_put("temporal", scales={}), "scales"),
    "motion without a timeline": (lambda meta, _: meta.pop("timeline"), "without a timeline"),
    "a picture is missing": (lambda _, pictures: pictures.pop("q"), "q"),
    "a picture is lossy": (
        lambda _, pictures: pictures.update(s=webp(np.full((2, 2, 4), 255), lossless=False)),
        "lossless",
    ),
    "a picture is large": (_head("s", 16384, 16384), "too many pixels"),
    "a picture is another one": (_head("s", 300, 300), "different sizes"),
    "a picture is cut off": (lambda _, pictures: pictures.update(dc=pictures["dc"][:27]), "a damaged picture"),
    "a document is large": (_top(more="x" * (5 << 20)), "too large"),
    "no code": (_put("sh0", codebook=[0]), "means nothing"),
    "no rotation": (lambda _, pictures: pictures.update(q=webp([[[128, 128, 128, 251]] * 2])), "largest component"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_are_refused_in_words_and_little_memory(path: Path, name: str):
    change, words = BAD[name]
    meta, pictures = published()
    change(meta, pictures)
    packed(path, meta, pictures)
    tracemalloc.start()
    try:
        with pytest.raises(ProjectError, match=words):
            FORMAT.open(path).splats(2)
        assert tracemalloc.get_traced_memory()[1] < 40e6
    finally:
        tracemalloc.stop()


def test_damaged_archives_are_refused(path: Path):
    meta, pictures = published()
    data = packed(path, meta, pictures).read_bytes()
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("q", pictures["q"])
    twice = path.read_bytes()
    packed(path, meta, pictures | {f"more{k}": b"" for k in range(1100)})
    many = path.read_bytes()
    packed(path, meta, pictures, zipfile.ZIP_LZMA)
    lzma = path.read_bytes()
    end = data.rfind(b"PK\x05\x06")
    changed = (
        data.replace(pictures["q"][-4:], b"\0\0\0\0") if pictures["q"] in data else data[:200] + b"\xff" + data[201:]
    )
    cases = (data[: len(data) // 2], data[:9], b"", twice, many, lzma, changed)
    large = data[:end] + b"PK\x06\x07" + bytes(16) + data[end:]
    for bad in (*cases, large, data[:end] + b"PK\x05\x06" + b"\xff" * 16 + b"\0\0"):
        path.write_bytes(bad)
        with pytest.raises(ProjectError, match="cannot be read"):
            FORMAT.open(path)
    with pytest.raises(ProjectError, match="cannot be read: No such file"):
        FORMAT.open(path.with_name("nothing.tsog"))


def test_one_gaussian_far_away_and_one_without_motion(path: Path):
    far, near = one_splat(means=[[3000.0, 0.0, -2.0]]), one_splat()
    stretch = SequenceStretch(0, 2, far, lambda _: MovingSplats(near, np.array([4])))
    FORMAT.write([stretch], SequenceTiming(2, 30.0), path)
    found = FORMAT.open(path).splats(1)
    np.testing.assert_allclose(sorted(found.means[:, 0]), [0.5, 3000.0], rtol=2e-4)
