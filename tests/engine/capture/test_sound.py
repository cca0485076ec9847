"""The sound of a camera: from a frame of the capture on, at the right moment, and what is said where there is none."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.lab.synthetic import make_scene
from app.lab.synthetic.writing import cameras_document
from engine.capture.capture import Capture, open_capture
from engine.capture.files.sound import SoundReader, sound_source
from engine.capture.frames import FrameSource, ImageFrames, IndexedFrames
from engine.errors import CaptureError
from tests.engine.synchronisation.made_recordings import write_sound_video

RATE = 48_000
CLICK_S = 0.5


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """Two cameras with 30 frames at 30 per second; the first has sound with one click in it."""
    folder = tmp_path_factory.mktemp("sound")
    scene = make_scene(n_cameras=2, n_frames=30, size=(32, 32))
    (folder / "cameras.json").write_text(json.dumps(cameras_document(scene)))
    sound = np.zeros(RATE)
    sound[round(CLICK_S * RATE)] = 1.0
    write_sound_video(folder / f"{scene.rig.names[0]}.mp4", sound, n_frames=30)
    write_sound_video(folder / f"{scene.rig.names[1]}.mp4", np.zeros(0), n_frames=30)
    return open_capture(folder)


def read(path: Path, start_s: float, n_samples: int) -> np.ndarray:
    """In odd pieces. [n_samples, 2]"""
    with SoundReader(path, start_s, rate=RATE) as reader:
        sound = np.concatenate([reader.read(1001) for _ in range(-(-n_samples // 1001))])[:n_samples]
    assert sound.shape == (n_samples, 2)
    return sound


def click_s(sound: np.ndarray) -> float:
    return int(np.argmax(np.abs(sound[:, 0]))) / RATE


@pytest.mark.parametrize("frame", [0, 6, 14])
def test_a_click_is_heard_when_it_was(capture: Capture, frame: int):
    path, start_s = sound_source(capture, 0, frame)
    assert start_s == pytest.approx(frame / 30)
    sound = read(path, start_s, RATE)
    assert click_s(sound) == pytest.approx(CLICK_S - frame / 30, abs=0.002)
    assert np.abs(sound).max() > 0.1
    assert np.array_equal(sound[:, 0], sound[:, 1])  # of one microphone
    assert np.abs(sound[round((1.1 - frame / 30) * RATE) :]).max(initial=0.0) == 0.0  # behind the end of the track


def test_frames_count_from_where_the_capture_begins(capture: Capture):
    part = capture.resized(1.0, (9, 30))
    assert sound_source(part, 0, 3)[1] == pytest.approx(12 / 30)
    ahead = IndexedFrames(capture.store.sources[0], np.arange(2, 30))
    with camera_of(capture, ahead):
        assert sound_source(replace(capture, n_frames=28), 0, 3)[1] == pytest.approx(5 / 30)


@contextmanager
def camera_of(capture: Capture, source: FrameSource) -> Iterator[None]:
    """While its first camera has other frames."""
    sources = capture.store.sources
    capture.store.sources = (source, *sources[1:])
    yield
    capture.store.sources = sources


def test_before_a_track_begins_there_is_silence(capture: Capture):
    path, _ = sound_source(capture, 0, 0)
    sound = read(path, -0.25, RATE)
    assert np.abs(sound[: round(0.2 * RATE)]).max() == 0.0
    assert click_s(sound) == pytest.approx(CLICK_S + 0.25, abs=0.002)


def test_cameras_without_sound_say_so(capture: Capture, tmp_path: Path):
    with pytest.raises(CaptureError, match="its file holds no sound track"):
        sound_source(capture, 1, 0)
    with camera_of(capture, ImageFrames(tmp_path, [])), pytest.raises(CaptureError, match="frames are image files"):
        sound_source(capture, 0, 0)
