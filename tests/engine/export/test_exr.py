"""OpenEXR files as FFmpeg reads them, which is a reader that shares nothing with ours."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest

from engine.export.exr import write_exr


def read(path: Path) -> dict[str, np.ndarray]:
    """Channels by name, as they are stored. [H, W] each"""
    with av.open(str(path)) as container:
        (frame,) = container.decode(video=0)
        dtype = np.dtype(np.float16 if "f16" in frame.format.name else np.float32)
        names = "Y" if frame.format.name.startswith("gray") else "GBRA"  # FFmpeg's order of planes
        rows = [
            np.frombuffer(bytes(plane), dtype).reshape(frame.height, -1)[:, : frame.width] for plane in frame.planes
        ]
        return dict(zip(names, rows, strict=False))


@pytest.mark.parametrize("size", [(1, 1), (16, 5), (37, 51)])
@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_colours_and_opacity_come_back_exactly(tmp_path: Path, size: tuple[int, int], dtype: type):
    random = np.random.default_rng(0)
    planes = {name: random.normal(0, 3, size).astype(dtype) for name in "RGBA"}
    write_exr(tmp_path / "a.exr", {**planes, "Z": random.random(size).astype(np.float32)})
    found = read(tmp_path / "a.exr")
    for name in "RGBA":
        assert found[name].dtype == dtype
        assert np.array_equal(found[name], planes[name]), name


def test_numbers_of_one_channel_come_back_exactly_packed_or_not(tmp_path: Path):
    smooth = np.linspace(0, 1e10, 64 * 300, dtype=np.float32).reshape(64, 300)
    noise = np.random.default_rng(0).integers(0, 2**31, (64, 300), dtype=np.int32).view(np.float32)
    noise[~np.isfinite(noise)] = 1.0
    for plane in (smooth, noise):
        write_exr(tmp_path / "a.exr", {"Y": plane})
        assert np.array_equal(read(tmp_path / "a.exr")["Y"], plane)
    write_exr(tmp_path / "b.exr", {"Y": np.zeros((64, 300), np.float32)}, comments={"unit": "metres"})
    assert (tmp_path / "b.exr").stat().st_size < 1000
    assert b"metres" in (tmp_path / "b.exr").read_bytes()


@pytest.mark.parametrize(
    "channels",
    [
        {},
        {"R": np.zeros((2, 2))},
        {"R": np.zeros((2, 2), np.float32), "G": np.zeros((2, 3), np.float32)},
        {"R": np.zeros((0, 2), np.float32)},
        {"R" * 40: np.zeros((2, 2), np.float32)},
    ],
)
def test_what_cannot_be_a_picture_is_refused(tmp_path: Path, channels: dict[str, np.ndarray]):
    with pytest.raises(ValueError, match="channel"):
        write_exr(tmp_path / "a.exr", channels)
