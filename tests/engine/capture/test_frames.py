"""Video sources with awkward streams, the cache by itself, and area resizing."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.capture import frames
from engine.capture.cameras.camera_optics import resize_area
from engine.capture.cameras.orientation import UPRIGHT
from engine.capture.files.media import read_video_header
from engine.capture.frames import VideoFrames


def write_stream(path: Path, *, options: dict[str, str], n_frames: int, pts: list[int] | None = None) -> None:
    """Grey frames whose level is 5 * frame_index, encoded with these x264 options."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30, options={"crf": "1", "threads": "1"} | options)
        stream.width, stream.height, stream.pix_fmt = 32, 32, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 300)
        for t in range(n_frames):
            frame = av.VideoFrame.from_ndarray(np.full((32, 32, 3), 5 * t + 10, np.uint8), format="rgb24")
            frame.pts, frame.time_base = (10 * t if pts is None else pts[t]), Fraction(1, 300)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def levels(source: VideoFrames, order: list[int]) -> list[int]:
    """Which frame each decoded picture is, read back from its grey level."""
    return [round((float(frame.mean()) - 10) / 5) for frame in source.read(order)]


def test_a_video_is_asked_once_how_it_is_turned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every frame whose side data was looked at stays in memory for good: 3 MB each at 1088x1920."""
    asked = []
    monkeypatch.setattr(frames, "turn_of_frame", lambda frame: asked.append(frame.pts) or UPRIGHT)
    path = tmp_path / "video.mp4"
    write_stream(path, n_frames=40, options={"g": "10"})
    source = VideoFrames(path, 40)
    assert levels(source, list(range(40))) == list(range(40))
    source.close()
    assert levels(source, [7, 3]) == [7, 3]
    assert len(asked) == 1


@pytest.mark.parametrize(
    ("suffix", "options"),
    [
        (".mp4", {"g": "10", "bf": "0"}),
        (".mp4", {"g": "250", "bf": "0"}),  # one key frame for all
        (".mp4", {"g": "12", "bf": "3"}),  # decoding order is not showing order
        (".mkv", {"g": "12", "bf": "3"}),  # an index of key frames only
    ],
)
def test_any_order_finds_the_right_frames(tmp_path: Path, suffix: str, options: dict[str, str]) -> None:
    path = tmp_path / f"video{suffix}"
    write_stream(path, n_frames=40, options=options)
    header = read_video_header(path)
    n_frames = header.n_frames
    assert (n_frames, header.size, header.rate) == (40, (32, 32), 30.0)
    source = VideoFrames(path, n_frames)
    forward = list(range(40))
    random = np.random.default_rng(1).integers(0, 40, 40).tolist()
    for order in (forward, forward[::-1], [39, 39, 0, 38, 1], random):
        assert levels(source, order) == order
    source.close()
    assert levels(source, [7]) == [7]


def test_uneven_frame_times_keep_their_index(tmp_path: Path) -> None:
    path = tmp_path / "video.mp4"
    write_stream(path, n_frames=20, pts=[t * t for t in range(20)], options={"g": "5", "bf": "0"})
    assert levels(VideoFrames(path, 20), [19, 3, 11, 4]) == [19, 3, 11, 4]


def test_a_file_without_pictures_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sound.mov"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), format="s16", layout="mono")
        sound.sample_rate = 8000
        container.mux(stream.encode(sound))
    with pytest.raises(Exception, match="no video stream"):
        read_video_header(path)


@settings(deadline=None)
@given(width=st.integers(1, 12), height=st.integers(1, 12), level=st.integers(0, 255))
def test_resizing_keeps_a_plain_picture_plain(width: int, height: int, level: int) -> None:
    image = np.full((9, 12, 3), level, np.uint8)
    assert np.array_equal(resize_area(image, (width, height)), np.full((height, width, 3), level, np.uint8))


def test_resizing_by_a_whole_factor_takes_block_means() -> None:
    image = np.random.default_rng(2).integers(0, 256, (12, 18, 3), dtype=np.uint8)
    means = image.reshape(4, 3, 6, 3, 3).astype(float).mean(axis=(1, 3))
    assert np.abs(resize_area(image, (6, 4)) - means).max() <= 1.0  # Pillow rounds each of its two passes
