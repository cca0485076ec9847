"""Frames in log and HDR curves, and of 16 bits: what comes out is what a display shows."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from engine.capture.capture import open_capture
from engine.capture.frames import VideoFrames, read_image
from engine.capture.pixels.transfer_curves import CURVE_NAMES, CURVES, MAX_LEVEL, CurveName, display_levels
from engine.errors import CaptureError
from engine.images.srgb import encoded_of
from tests.engine.capture.layouts.scene import make_scene
from tests.engine.capture.layouts.tables import TABLES

GREY_CARD: dict[CurveName, float] = {
    "slog3": 420 / 1023,
    "vlog": 433 / 1023,
    "logc3": 400 / 1023,
    "logc4": 0.278,
    "clog3": 0.343,
    "flog": 0.4596,
}
"""Code value of a card that reflects 18 %, as the makers state it."""


@pytest.mark.parametrize("name", GREY_CARD)
def test_a_grey_card_reflects_18_percent(name: CurveName) -> None:
    assert CURVES[name].linear(np.array([GREY_CARD[name]]))[0] == pytest.approx(0.18, abs=0.002)


@pytest.mark.parametrize(("name", "signal"), [("hlg", 0.75), ("pq", 0.5807), ("linear", 1.0)])
def test_the_reference_white_is_white(name: CurveName, signal: float) -> None:
    assert CURVES[name].linear(np.array([signal]))[0] == pytest.approx(1.0, abs=0.002)


@pytest.mark.parametrize("name", CURVE_NAMES)
def test_curves_rise_from_black_to_white_and_have_no_steps(name: CurveName) -> None:
    levels = display_levels(name, is_stretched=False).astype(int)
    assert (np.diff(levels) >= 0).all()
    assert levels[0] == 0
    assert levels[-1] == 255
    middle = np.diff(levels[MAX_LEVEL // 50 :])
    assert middle.max() <= 1


def deep_png(path: Path, levels: np.ndarray) -> None:
    assert cv2.imwrite(str(path), levels[..., ::-1] if levels.ndim == 3 else levels)


def test_images_of_16_bits_keep_their_brightness(tmp_path: Path) -> None:
    ramp = np.linspace(0, MAX_LEVEL, 256 * 4).astype(np.uint16).reshape(4, 256)
    for suffix in (".png", ".tiff"):
        deep_png(tmp_path / f"grey{suffix}", ramp)
        deep_png(tmp_path / f"color{suffix}", np.stack([ramp, ramp[:, ::-1], ramp // 2], axis=-1))
        grey, color = (read_image(tmp_path / f"{kind}{suffix}") for kind in ("grey", "color"))
        assert np.abs(grey[..., 1] - ramp / 257.0).max() <= 1.0
        assert np.abs(color[..., 1] - ramp[:, ::-1] / 257.0).max() <= 1.0
        linear = read_image(tmp_path / f"color{suffix}", curve="linear")
        assert np.abs(linear[..., 0] - 255.0 * encoded_of(ramp / MAX_LEVEL)).max() <= 0.51, "16 bits reach the curve"
    (tmp_path / "cut.png").write_bytes((tmp_path / "color.png").read_bytes()[:200])
    with pytest.raises(CaptureError, match="cannot be decoded"):
        read_image(tmp_path / "cut.png", curve="linear")


@pytest.mark.parametrize("pixels", ["yuv422p10le", "yuv420p"])
def test_video_in_s_log3_shows_a_grey_card_as_a_display_does(tmp_path: Path, pixels: str) -> None:
    """Code value 420 of 1023 is 18 %: of ten bits within a level, of eight within three."""
    path = tmp_path / "log.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, pixels
        plane = np.full((48, 64), 420 if "10" in pixels else 105, np.uint16 if "10" in pixels else np.uint8)
        frame = av.VideoFrame(64, 48, pixels)
        middle = 512 if "10" in pixels else 128
        for index, video_plane in enumerate(frame.planes):
            rows = np.zeros((video_plane.height, video_plane.line_size // plane.itemsize), plane.dtype)
            rows[:] = plane[0, 0] if index == 0 else middle
            video_plane.update(rows.tobytes())
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    (picture,) = VideoFrames(path, 1, curve="slog3").read([0])
    wanted = 255.0 * float(encoded_of(np.array(0.18)))
    assert np.abs(picture - wanted).max() <= (1.0 if "10" in pixels else 3.0)
    (flat,) = VideoFrames(path, 1).read([0])
    assert abs(float(flat.mean()) - 255.0 * (420 - 64) / 876) < 2.0, "without a curve values stay"


def test_the_curve_of_a_capture_is_kept_and_is_part_of_what_it_is(tmp_path: Path) -> None:
    TABLES["capture_json-pinhole"](tmp_path)
    plain = open_capture(tmp_path)
    path = tmp_path / "capture.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"curve": "vlog"}))
    curved = open_capture(tmp_path)
    assert curved.fingerprint != plain.fingerprint
    levels = np.asarray(plain.frame(0, 0)).astype(int)
    wanted = display_levels("vlog", is_stretched=True)[levels * 257]
    assert np.abs(np.asarray(curved.frame(0, 0)).astype(int) - wanted).mean() < 3.0
    path.write_text(json.dumps(json.loads(path.read_text()) | {"curve": "film"}))
    with pytest.raises(CaptureError, match="curve"):
        open_capture(tmp_path)


def test_a_video_that_states_hdr_is_named_with_the_remedy(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole")
    TABLES["realitycapture-pinhole"](tmp_path)
    path = tmp_path / f"{scene.names[0]}.mp4"
    with av.open(str(path)) as source, av.open(str(tmp_path / "new.mp4"), "w") as target:
        stream = target.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = *scene.size, "yuv420p"
        stream.codec_context.color_trc = 18
        for number, frame in enumerate(source.decode(video=0)):
            frame.pts, frame.time_base = number, Fraction(1, 30)
            target.mux(stream.encode(frame))
        target.mux(stream.encode())
    (tmp_path / "new.mp4").replace(path)
    assert any("HLG" in warning and "--curve hlg" in warning for warning in open_capture(tmp_path).warnings)
