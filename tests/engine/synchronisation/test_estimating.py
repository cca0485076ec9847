"""Offsets from pictures: with calibration to parts of a frame, without it to about one, and nothing from nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from engine.errors import CaptureError
from engine.synchronisation.estimating import estimate_offsets
from engine.synchronisation.recording import Recording
from tests.engine.synchronisation.made_recordings import FPS, Pictures, made_recordings, ring


def errors(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """How far offsets are from the truth, apart from a zero that nobody can know."""
    wrong = found - truth
    return np.abs(wrong - np.median(wrong))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_parts_of_frames_are_found_with_calibration(seed):
    rig = ring(6)
    offsets = np.array([0.0, -7.0, 7.0, 0.45, -2.7, 3.25])
    found = estimate_offsets(made_recordings(rig, offsets, seed=seed), fps=FPS, rig=rig)
    assert errors(found.offsets_frames, offsets).max() < 0.2
    assert all(camera.source == "epipolar" and camera.is_sure for camera in found.cameras)
    assert all(
        error <= 4 * camera.sigma_frames
        for error, camera in zip(errors(found.offsets_frames, offsets), found.cameras, strict=True)
    )
    assert not found.is_in_step


@pytest.mark.slow
def test_short_recordings_are_not_in_step_because_all_begin():
    rig = ring(5)
    offsets = np.array([0.0, 6.0, 0.0, -5.0, 0.0])
    found = estimate_offsets(made_recordings(rig, offsets, n_frames=28), fps=FPS, rig=rig)
    assert errors(found.offsets_frames, offsets).max() < 0.7


@pytest.mark.slow
def test_cameras_in_step_are_said_to_be():
    rig = ring(5)
    found = estimate_offsets(made_recordings(rig, np.zeros(5)), fps=FPS, rig=rig)
    assert found.is_in_step
    assert np.abs(found.offsets_frames).max() < 0.15


@pytest.mark.slow
def test_how_much_moves_tells_whole_frames_without_calibration():
    rig = ring(8)
    offsets = np.array([0.0, -5.0, 7.0, 2.0, -2.0, 3.0, 0.0, -7.0])
    found = estimate_offsets(made_recordings(rig, offsets, n_frames=90), fps=FPS)
    assert {camera.source for camera in found.cameras} == {"motion"}
    assert np.median(errors(found.offsets_frames, offsets)) < 1.0
    assert all(camera.sigma_frames >= 0.9 for camera in found.cameras)


@pytest.mark.slow
def test_uneven_times_count():
    rig = ring(4)
    offsets = np.array([0.0, 2.0, -3.0, 0.0])
    recordings = made_recordings(rig, offsets, n_frames=64)
    kept = np.delete(np.arange(64), [9, 20, 21, 40])
    whole = recordings[2]
    frames = next(iter([whole.source])).frames[kept]  # type: ignore[attr-defined]
    recordings[2] = Recording(whole.name, Pictures(frames), whole.times_s[kept])
    found = estimate_offsets(recordings, fps=FPS, rig=rig)
    assert errors(found.offsets_frames, offsets).max() < 0.3


def test_where_nothing_moves_nothing_is_known():
    rig = ring(3)
    still = np.full((40, 120, 160, 3), 90, np.uint8)
    recordings = [Recording(name, Pictures(still), np.arange(40) / FPS) for name in rig.names]
    found = estimate_offsets(recordings, fps=FPS, rig=rig)
    assert not found.is_known
    assert all(camera.source is None and math.isinf(camera.sigma_frames) for camera in found.cameras)
    assert found.offsets_frames.tolist() == [0, 0, 0]


@pytest.mark.slow
def test_a_camera_that_sees_nothing_move_stays_unknown():
    rig = ring(5)
    recordings = made_recordings(rig, [0, 3, 0, -2, 0])
    blind = recordings[2]
    frames = np.broadcast_to(blind.source.frames[:1], (60, 120, 160, 3))  # type: ignore[attr-defined]
    recordings[2] = Recording(blind.name, Pictures(np.array(frames)), blind.times_s)
    found = estimate_offsets(recordings, fps=FPS, rig=rig)
    assert [camera.source is None for camera in found.cameras] == [False, False, True, False, False]
    assert abs(found.cameras[1].offset_frames - 3) < 0.2


def test_too_short_recordings_tell_nothing():
    rig = ring(3)
    assert not estimate_offsets(made_recordings(rig, [0, 0, 0], n_frames=5), fps=FPS, rig=rig).is_known


@pytest.mark.slow
def test_progress_is_reported_and_may_cancel():
    rig = ring(3)
    recordings = made_recordings(rig, [0, 1, 0], n_frames=30)
    stages = []
    estimate_offsets(recordings, fps=FPS, rig=rig, report=lambda progress: stages.append(progress.stage))
    assert {"sound", "what moves", "where things move", "done"} <= set(stages)

    def cancel(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        estimate_offsets(recordings, fps=FPS, rig=rig, report=cancel)


def test_unreadable_pictures_are_reported():
    class Broken(Pictures):
        def read(self, frame_indices):
            raise CaptureError("Frame 3 cannot be decoded.")

    rig = ring(2)
    recordings = [Recording(name, Broken(np.zeros((30, 4, 4, 3), np.uint8)), np.arange(30) / FPS) for name in rig.names]
    with pytest.raises(CaptureError, match="Frame 3"):
        estimate_offsets(recordings, fps=FPS, rig=rig)


def test_a_rig_of_other_cameras_is_refused():
    with pytest.raises(ValueError, match="2 recordings, 3 cameras"):
        estimate_offsets(made_recordings(ring(2), [0, 0], n_frames=2), fps=FPS, rig=ring(3))
