"""Opening, frames, sizes and the fingerprint, on tiny captures of both layouts."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from engine.capture.capture import open_capture, working_sizes
from engine.errors import CaptureError

MakeCapture = Callable[..., Path]


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    return float(10 * np.log10(255**2 / np.mean((a.astype(float) - b.astype(float)) ** 2)))


def test_sample_opens_with_its_cameras_frames_and_rate(make_sample: MakeCapture) -> None:
    capture = open_capture(make_sample(n_cameras=3, n_frames=6))
    assert capture.format == "sample"
    assert capture.rig.names == ("cam00", "cam01", "cam02")
    assert (capture.n_frames, capture.fps) == (6, 30.0)
    assert capture.rig.image_sizes.tolist() == [[48, 32]] * 3
    assert capture.default_holdout == ()


def test_frames_are_the_encoded_pictures_in_any_order(
    make_sample: MakeCapture, pictures: Callable[..., np.ndarray]
) -> None:
    capture = open_capture(make_sample(n_cameras=2, n_frames=25))
    for frame_index in (24, 0, 13, 12, 13, 24, 3):
        frame = capture.frame(1, frame_index)
        # neighbouring pictures differ by 6 levels in green (37 dB), so the wrong frame could not pass
        assert psnr(frame, pictures(1, frame_index)) > 42
    run = capture.frames_of(0, range(25))
    assert run.shape == (25, 32, 48, 3)
    assert all(psnr(run[t], pictures(0, t)) > 42 for t in range(25))


def test_cached_frames_cannot_be_changed_by_a_caller(make_sample: MakeCapture) -> None:
    capture = open_capture(make_sample())
    with pytest.raises(ValueError, match="read-only"):
        capture.frame(0, 0)[0, 0, 0] = 1
    capture.frames_of(0, [0])[:] = 0  # an own copy
    assert capture.frame(0, 0).max() > 0


def test_cache_stays_within_its_bytes_and_keeps_the_recent(make_sample: MakeCapture) -> None:
    frame_bytes = 48 * 32 * 3
    capture = open_capture(make_sample(n_frames=6), cache_bytes=3 * frame_bytes + 100)
    cache = capture.store.cache
    assert len(cache) == 0  # opening decodes nothing
    for frame_index in range(6):
        capture.frame(0, frame_index)
        assert cache.n_bytes == min(frame_index + 1, 3) * frame_bytes <= cache.max_bytes
    first, again = capture.frame(0, 5), capture.frame(0, 5)
    assert first is again
    capture.frame(0, 3)  # now the most recent of 3, 4, 5
    capture.frame(0, 0)
    assert cache.get((0, 4)) is None
    assert cache.get((0, 3)) is not None
    capture.close()
    assert cache.n_bytes == len(cache) == 0
    assert np.array_equal(capture.frame(0, 5), first)  # opens its files again


def test_a_frame_larger_than_the_cache_is_still_returned(make_sample: MakeCapture) -> None:
    capture = open_capture(make_sample(), cache_bytes=100)
    assert capture.frame(0, 0).shape == (32, 48, 3)
    capture.frame(0, 1)
    assert len(capture.store.cache) == 1  # the one used last


def test_threads_get_the_same_frames(make_sample: MakeCapture) -> None:
    folder = make_sample(n_cameras=2, n_frames=25)
    expected = [open_capture(folder).frames_of(camera, range(25)) for camera in range(2)]
    capture = open_capture(folder, cache_bytes=5 * 48 * 32 * 3)
    order = np.random.default_rng(0).permutation(np.repeat(np.arange(50), 4))

    def is_right(key: int) -> bool:
        return np.array_equal(capture.frame(key // 25, key % 25), expected[key // 25][key % 25])

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(is_right, order.tolist()))
    assert capture.store.cache.n_bytes <= capture.store.cache.max_bytes


def test_scale_changes_pictures_and_intrinsics_by_the_actual_ratio(
    make_sample: MakeCapture, pictures: Callable[..., np.ndarray]
) -> None:
    folder = make_sample()
    full, scaled = open_capture(folder), open_capture(folder, scale=0.55)
    assert scaled.rig.image_sizes[0].tolist() == [26, 18]  # 26.4 and 17.6 rounded
    assert scaled.frame(0, 0).shape == (18, 26, 3)
    assert np.allclose(scaled.rig.Ks[:, 0], full.rig.Ks[:, 0] * 26 / 48)
    assert np.allclose(scaled.rig.Ks[:, 1], full.rig.Ks[:, 1] * 18 / 32)
    assert np.array_equal(scaled.native_rig.Ks, full.rig.Ks)
    half = open_capture(folder, scale=0.5).frame(1, 2)
    means = pictures(1, 2).astype(float).reshape(16, 2, 24, 2, 3).mean(axis=(1, 3))
    assert np.abs(half - means).max() <= 3.5  # area means within the codec's error (2 to 3 levels here)


@pytest.mark.parametrize("scale", [0.0, -1.0, 1.5, float("nan"), 0.001])
def test_an_impossible_scale_is_refused(make_sample: MakeCapture, scale: float) -> None:
    with pytest.raises(CaptureError, match="scale"):
        open_capture(make_sample(n_cameras=1), scale=scale)


def test_working_sizes_round_half_up() -> None:
    assert working_sizes(np.array([[5, 3]]), np.array([0.5])).tolist() == [[3, 2]]


def test_fingerprint_ignores_place_and_scale_and_sees_the_calibration(make_sample: MakeCapture, tmp_path: Path) -> None:
    folder = make_sample()
    before = open_capture(folder)
    moved = folder.rename(tmp_path / "elsewhere")
    assert open_capture(moved, scale=0.5).fingerprint == before.fingerprint
    text = (moved / "cameras.json").read_text()
    (moved / "cameras.json").write_text(text.replace('"fps": 30', '"fps": 25'))
    assert open_capture(moved).fingerprint != before.fingerprint


def test_frames_and_cameras_outside_are_index_errors(make_sample: MakeCapture) -> None:
    capture = open_capture(make_sample(n_cameras=2, n_frames=3))
    for camera_index, frame_index in ((2, 0), (-1, 0), (0, 3), (0, -1)):
        with pytest.raises(IndexError):
            capture.frame(camera_index, frame_index)
    with pytest.raises(IndexError):
        capture.frames_of(0, [0, 3])


def test_camera_indices_by_name(make_sample: MakeCapture) -> None:
    capture = open_capture(make_sample())
    assert capture.camera_indices(("cam02", "cam00")) == [2, 0]
    with pytest.raises(CaptureError, match=r"no camera called cam9.*cam00, cam01, cam02"):
        capture.camera_indices(("cam00", "cam9"))


def test_opening_and_reading_write_nothing(make_sample: MakeCapture) -> None:
    folder = make_sample()
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    open_capture(folder).frame(0, 0)
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def test_panoptic_merges_both_files_sorted_by_number(
    make_panoptic: MakeCapture, pictures: Callable[..., np.ndarray]
) -> None:
    capture = open_capture(make_panoptic(train_ids=(1, 10, 2), test_ids=(0,)))
    assert capture.format == "panoptic"
    assert capture.rig.names == ("0", "1", "2", "10")
    assert capture.default_holdout == ("0",)
    assert (capture.n_frames, capture.fps) == (3, 30.0)
    assert psnr(capture.frame(3, 2), pictures(10, 2)) > 35  # JPEG; another camera differs by 40 levels in blue
    assert capture.frames_of(0, [2, 1]).shape == (2, 32, 48, 3)


def test_panoptic_without_test_cameras(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic(test_ids=(0,))
    (folder / "test_meta.json").unlink()
    capture = open_capture(folder)
    assert capture.rig.names == ("1", "2", "10")
    assert capture.default_holdout == ()


def test_panoptic_uses_the_frames_that_all_cameras_have_when_cut_alike(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic(n_frames=4)
    for path in folder.glob("ims/*/000003.jpg"):
        path.unlink()
    capture = open_capture(folder)
    assert capture.n_frames == 3
    assert "lists 4 frames, the first 3" in capture.warnings[0]


@pytest.mark.slow
def test_real_dome_capture() -> None:
    folder = Path(__file__).parents[3] / ".." / "shared" / "data" / "panoptic_basketball"
    if not folder.is_dir():
        pytest.skip("the real capture ../shared/data/panoptic_basketball is not on this machine")
    capture = open_capture(folder)
    assert capture.rig.names == tuple(str(i) for i in range(31))
    assert capture.default_holdout == ("0", "10", "15", "30")
    assert capture.n_frames == 40
    assert capture.frame(30, 39).shape == (360, 640, 3)
    assert np.linalg.norm(capture.rig.centers, axis=-1).max() < 6  # metres, a dome of radius 2.7 around the origin
