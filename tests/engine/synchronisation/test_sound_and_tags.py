"""Offsets by sound and by what cameras wrote into their files."""

from __future__ import annotations

import numpy as np
import pytest

from engine.synchronisation.audio import audio_estimate
from engine.synchronisation.recording import Recording, recordings_in_videos
from engine.synchronisation.tags import tag_estimates, timecode_seconds
from tests.engine.synchronisation.made_recordings import Pictures, write_sound_video

RATE = 48_000
DELAYS_S = (0.0, 0.2317, -0.1009, 0.05)


def scene_sound(n_s: float = 8.0) -> np.ndarray:
    """Steps and voices: bursts of coloured noise in silence. [S] float64"""
    generator = np.random.default_rng(7)
    sound = np.zeros(int(n_s * RATE))
    for start in generator.uniform(0, n_s - 0.5, 14):
        length = int(generator.uniform(0.02, 0.4) * RATE)
        burst = np.convolve(generator.normal(0, 1, length), np.hanning(9), "same") * np.exp(-np.linspace(0, 6, length))
        sound[int(start * RATE) : int(start * RATE) + length] += burst
    return sound / np.abs(sound).max() * 0.8


def heard(sound: np.ndarray, delay_s: float, microphone: int) -> np.ndarray:
    """What a microphone records that runs ahead by so much: noise of its own, another tone, an echo."""
    generator = np.random.default_rng(microphone)
    start = round((1.0 - delay_s) * RATE)
    own = sound[start : start + 6 * RATE]
    own = np.convolve(own, generator.normal(0, 0.2, 24) + np.r_[1.0, np.zeros(23)], "same")
    own[2000:] += 0.4 * own[:-2000]
    return np.clip(own * generator.uniform(0.3, 0.6) + generator.normal(0, 0.004, len(own)), -1, 1)


@pytest.mark.slow
@pytest.mark.parametrize(("codec", "suffix"), [("aac", ".mp4"), ("pcm_s16le", ".mov")])
def test_sound_tells_offsets_to_two_milliseconds(tmp_path, codec, suffix):
    sound, paths = scene_sound(), []
    for row, delay_s in enumerate(DELAYS_S):
        paths.append(tmp_path / f"{row}{suffix}")
        write_sound_video(paths[-1], heard(sound, delay_s, row), codec=codec)
    found = audio_estimate(recordings_in_videos(paths), 30.0)
    wrong_s = found.offsets_frames / 30 - DELAYS_S
    assert np.abs(wrong_s - np.median(wrong_s)).max() < 0.002
    assert found.n_known == 4
    assert np.nanmax(found.sigmas_frames) < 0.3


@pytest.mark.slow
def test_other_sounds_and_silence_tell_nothing(tmp_path):
    generator = np.random.default_rng(3)
    paths = [tmp_path / f"{row}.mp4" for row in range(4)]
    for path in paths[:2]:
        write_sound_video(path, generator.normal(0, 0.2, 3 * RATE))
    write_sound_video(paths[2], np.zeros(3 * RATE))
    write_sound_video(paths[3], np.zeros(0))
    found = audio_estimate(recordings_in_videos(paths), 30.0)
    assert found.n_known == 0
    assert "no two share any" in found.note
    assert audio_estimate([Recording("images", Pictures(np.zeros((2, 2, 2, 3))), np.arange(2.0))], 30).n_known == 0


def test_timecode_tells_whole_frames(tmp_path):
    paths = [tmp_path / f"{row}.mov" for row in range(3)]
    for path, code in zip(paths, ("01:00:00:00", "01:00:00:12", "00:59:59:23"), strict=True):
        write_sound_video(path, np.zeros(0), timecode=code)
    found, created = tag_estimates(recordings_in_videos(paths), 30.0)
    np.testing.assert_allclose(found.offsets_frames, [0, -12, 7], atol=1e-6)
    assert created.n_known == 0


def test_creation_times_are_a_hint(tmp_path):
    paths = [tmp_path / f"{row}.mp4" for row in range(2)]
    for path, second in zip(paths, (10, 12), strict=True):
        write_sound_video(path, np.zeros(0), creation_time=f"2026-03-01T12:00:{second}.000000Z")
    _, created = tag_estimates(recordings_in_videos(paths), 30.0)
    np.testing.assert_allclose(created.offsets_frames, [0, -60], atol=1e-6)
    assert created.sigmas_frames.min() > 10


@pytest.mark.parametrize(
    ("text", "rate", "seconds"),
    [
        ("00:00:01:15", 30, 1.5),
        ("10:00:00:00", 25, 36_000.0),
        ("00:01:00;02", 30000 / 1001, 1800 / (30000 / 1001)),  # two numbers are left out at each full minute
        ("00:10:00;00", 30000 / 1001, 17_982 / (30000 / 1001)),  # but not at each tenth
        ("00:01:00;04", 60000 / 1001, 3600 / (60000 / 1001)),
        ("00:00:00:30", 30, None),
        ("25:00:00:00", 30, None),
        ("morning", 30, None),
        ("00:00:00:00", 0, None),
    ],
)
def test_timecodes_are_read(text, rate, seconds):
    found = timecode_seconds(text, rate)
    assert found == (None if seconds is None else pytest.approx(seconds, abs=1e-9))


def test_timecodes_around_midnight_belong_together(tmp_path):
    paths = [tmp_path / "a.mov", tmp_path / "b.mov"]
    for path, code in zip(paths, ("23:59:59:00", "00:00:00:00"), strict=True):
        write_sound_video(path, np.zeros(0), timecode=code)
    found, _ = tag_estimates(recordings_in_videos(paths), 30.0)
    np.testing.assert_allclose(found.offsets_frames, [0, -30], atol=1e-6)
