"""Exact frames from many kinds of video: codecs, containers, uneven times, turned pictures, depths and colours."""

from __future__ import annotations

import json

import av
import numpy as np
import pytest

from engine.capture.cameras.orientation import may_be_turned
from engine.capture.capture import open_capture
from engine.capture.files.media import read_frame_times, read_video_header
from engine.capture.frames import VideoFrames
from engine.errors import CaptureError
from tests.engine.capture.made_videos import SIZE, number_of, numbered, write_video_of_kind

ORDER = [17, 3, 4, 29, 0, 28, 12, 12]


@pytest.mark.parametrize(
    ("codec", "suffix", "pix_fmt", "options"),
    [
        ("libx264", ".mp4", "yuv420p", {"bf": "3", "g": "12"}),
        ("libx264", ".mkv", "yuv420p", {"bf": "3", "g": "250"}),
        ("libx264", ".mov", "yuv420p10le", {"bf": "2", "g": "12"}),
        ("libx264", ".ts", "yuv420p", {"bf": "2", "g": "12"}),
        ("libx265", ".mp4", "yuv420p10le", {"x265-params": "log-level=none:keyint=12:bframes=3:pools=none"}),
        ("libvpx-vp9", ".webm", "yuv420p", {"g": "12", "cpu-used": "8", "deadline": "realtime"}),
        ("libsvtav1", ".mp4", "yuv420p", {"g": "12", "preset": "13", "svtav1-params": "lp=1"}),
        ("mpeg4", ".avi", "yuv420p", {"g": "12"}),
        ("mpeg4", ".mp4", "yuv420p", {"g": "12", "bf": "2"}),
        ("mjpeg", ".avi", "yuvj420p", {}),
        ("prores_ks", ".mov", "yuv422p10le", {}),
        ("ffv1", ".mkv", "yuv444p", {}),
        ("mpeg2video", ".mxf", "yuv422p", {"bf": "2", "g": "12"}),
        ("libx264", ".mxf", "yuv422p10le", {"g": "1"}),
    ],
)
def test_every_kind_gives_exactly_the_frame_asked_for(tmp_path, monkeypatch, codec, suffix, pix_fmt, options):
    monkeypatch.setenv("SVT_LOG", "0")
    path = tmp_path / f"video{suffix}"
    write_video_of_kind(path, codec, pix_fmt=pix_fmt, options=options)
    header = read_video_header(path)
    assert (header.n_frames, header.size) == (30, SIZE)
    source = VideoFrames(path, header.n_frames)
    assert [number_of(picture) for picture in source.read(ORDER)] == ORDER
    source.close()


def test_uneven_times_are_read_as_they_are(tmp_path):
    times_ms = [0, 33, 67, 100, 300, 333, 367, 1000]
    path = tmp_path / "uneven.mp4"
    write_video_of_kind(path, n_frames=8, times_ms=times_ms, options={"bf": "2"})
    times_s = read_frame_times(path)
    np.testing.assert_allclose(times_s - times_s[0], np.array(times_ms) / 1000, atol=1e-3)
    source = VideoFrames(path, 8)
    assert [number_of(picture) for picture in source.read([7, 0, 4, 3])] == [7, 0, 4, 3]


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv"])
@pytest.mark.parametrize(("degrees", "n_quarters"), [(90, 1), (180, 2), (270, 3)])
def test_turned_videos_come_upright(tmp_path, suffix, degrees, n_quarters):
    path = tmp_path / f"turned{suffix}"
    write_video_of_kind(path, n_frames=3, rotation_deg=degrees)
    header = read_video_header(path)
    assert header.stored_size == SIZE
    assert header.size == (SIZE if degrees == 180 else SIZE[::-1])
    picture = next(iter(VideoFrames(path, 3).read([2])))
    assert picture.shape[:2] == header.size[::-1]
    assert number_of(np.rot90(picture, -n_quarters)) == 2
    assert number_of(next(iter(VideoFrames(path, 3, is_turned=False).read([2])))) == 2


def test_mirrored_videos_come_upright(tmp_path):
    path = tmp_path / "mirrored.mp4"
    write_video_of_kind(path, n_frames=3, is_mirrored=True)
    assert number_of(next(iter(VideoFrames(path, 3).read([1])))[:, ::-1]) == 1


def test_headers_alone_tell_of_upright_files(tmp_path):
    upright, turned = tmp_path / "upright.mp4", tmp_path / "turned.mp4"
    write_video_of_kind(upright, n_frames=2)
    write_video_of_kind(turned, n_frames=2, rotation_deg=90)
    assert not may_be_turned(upright)
    assert may_be_turned(turned)
    for n_bytes in (0, 7, 40, 200, turned.stat().st_size // 2):  # cut anywhere: an answer, no failure
        cut = tmp_path / "cut.mp4"
        cut.write_bytes(turned.read_bytes()[-n_bytes:])
        assert may_be_turned(cut) in (True, False)


@pytest.mark.parametrize(("size", "is_warned"), [(SIZE[::-1], False), (SIZE, True)])
def test_the_calibration_decides_whether_pictures_are_turned(tmp_path, size, is_warned):
    write_video_of_kind(tmp_path / "a.mp4", n_frames=2, rotation_deg=90)
    camera = {"name": "a", "file": "a.mp4", "width": size[0], "height": size[1]}
    camera["K"] = [[60, 0, size[0] / 2], [0, 60, size[1] / 2], [0, 0, 1]]
    camera["world_to_camera"] = np.eye(4).tolist()
    document = {"schema": 1, "fps": 25, "n_frames": 2, "cameras": [camera]}
    (tmp_path / "cameras.json").write_text(json.dumps(document))
    capture = open_capture(tmp_path)
    assert capture.frame(0, 1).shape[:2] == size[::-1]
    assert any("not rotated" in warning for warning in capture.warnings) == is_warned


def test_frames_without_times_are_refused(tmp_path):
    path = tmp_path / "raw.txt"
    path.write_text("no video")
    with pytest.raises(CaptureError, match="cannot be read"):
        read_frame_times(path)
    with pytest.raises(CaptureError, match="missing"):
        read_frame_times(tmp_path / "none.mp4")


MATRICES = {"BT.601": (0.299, 0.114, 6), "BT.709": (0.2126, 0.0722, 1), "BT.2020": (0.2627, 0.0593, 9)}


def coded(image: np.ndarray, matrix: str, *, is_full: bool, n_bits: int, is_halved: bool) -> av.VideoFrame:
    """A frame as a camera would code this picture, by the formulas of the standards."""
    red_weight, blue_weight, number = MATRICES[matrix]
    red, green, blue = np.moveaxis(image / 255, -1, 0)
    luma = red_weight * red + (1 - red_weight - blue_weight) * green + blue_weight * blue
    planes = [luma, (blue - luma) / (2 * (1 - blue_weight)), (red - luma) / (2 * (1 - red_weight))]
    step, top = 2 ** (n_bits - 8), 2**n_bits - 1
    scales = (top, top, 0) if is_full else (219 * step, 224 * step, 16 * step)
    planes = [planes[0] * scales[0] + scales[2], *(plane * scales[1] + 128 * step for plane in planes[1:])]
    if is_halved:
        planes[1:] = [plane[::2, ::2] for plane in planes[1:]]
    kind = f"yuv{'420' if is_halved else '444'}p{'10le' if n_bits == 10 else ''}"
    frame = av.VideoFrame(image.shape[1], image.shape[0], kind)
    for plane, values in zip(frame.planes, planes, strict=True):
        rounded = np.clip(np.round(values), 0, top).astype("<u2" if n_bits == 10 else np.uint8)
        rows = np.zeros((rounded.shape[0], plane.line_size), np.uint8)
        data = np.ascontiguousarray(rounded).view(np.uint8).reshape(rounded.shape[0], -1)
        rows[:, : data.shape[1]] = data
        plane.update(rows.tobytes())
    frame.colorspace, frame.color_range = number, 2 if is_full else 1
    return frame


PATCHES = np.random.default_rng(4).integers(0, 256, (3, 4, 3)).astype(np.uint8)


def patches(frame_index: int) -> np.ndarray:
    """Even patches of 16 pixels in random colours."""
    return np.kron(PATCHES, np.ones((16, 16, 1), np.uint8))


@pytest.mark.parametrize("matrix", MATRICES)
@pytest.mark.parametrize("is_full", [False, True])
@pytest.mark.parametrize("n_bits", [8, 10])
@pytest.mark.parametrize("is_halved", [False, True])
def test_colours_come_back_as_they_were_coded(tmp_path, matrix, is_full, n_bits, is_halved):
    image = patches(0)
    frame = coded(image, matrix, is_full=is_full, n_bits=n_bits, is_halved=is_halved)
    path = tmp_path / "colours.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = image.shape[1], image.shape[0], frame.format.name
        context = stream.codec_context
        context.colorspace, context.color_range = frame.colorspace, frame.color_range
        frame.pts = 0
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    found = next(iter(VideoFrames(path, 1).read([0])))
    inner = np.zeros((16, 16), bool)
    inner[3:-3, 3:-3] = True  # halved chroma mixes at edges
    is_inner = np.tile(inner, (3, 4))
    assert np.abs(found.astype(int) - image)[is_inner].max() <= (2 if n_bits == 8 else 1)


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "matrix"), [(1, "BT.601"), (20, "BT.709")])
def test_unstated_colours_follow_the_size(tmp_path, scale, matrix):
    image = np.kron(patches(0), np.ones((scale, scale, 1), np.uint8))
    frame = coded(image, matrix, is_full=False, n_bits=8, is_halved=False)
    path = tmp_path / "unstated.mkv"
    frame.colorspace = 2
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = image.shape[1], image.shape[0], frame.format.name
        frame.pts = 0
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    found = next(iter(VideoFrames(path, 1).read([0])))
    assert np.abs(found.astype(int) - image).max() <= 1


def test_numbers_survive_their_own_picture():
    assert [number_of(numbered(index)) for index in (0, 1, 77, 255)] == [0, 1, 77, 255]
