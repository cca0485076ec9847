"""Long captures with known truth: the same bytes every time, and nothing but the change between two of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.lab.synthetic.scene import SyntheticScene, make_scene
from engine.capture.capture import open_capture

pytest.importorskip("open3d", reason="the ray caster needs Open3D and its system libraries", exc_type=ImportError)

from app.lab.synthetic.raycast import SceneCamera, make_truth
from tests.long_captures.changes import CHANGES, DAYLIGHT_END, Change, make_change
from tests.long_captures.scene import make_long_scene
from tests.long_captures.writing import NOISE, CameraFootage, write_long_captures

N_FRAMES, CLIP_LENGTH = 40, 10
SCENE = make_long_scene(size=(48, 36), n_cameras=8, n_frames=N_FRAMES, clip_length=CLIP_LENGTH)
CAMERA = 6
HELD_OUT = [SCENE.rig.names.index(name) for name in SCENE.default_holdout]


@pytest.fixture(scope="module")
def footage() -> CameraFootage:
    """One camera of a small scene."""
    return CameraFootage(SCENE, CAMERA, supersampling=1)


def changed(name: str) -> Change:
    return make_change(name, SCENE)


def positions_of(scene: SyntheticScene, camera_index: int, frame_index: int) -> np.ndarray:
    """World points at pixel centres, from the depths that the truth has of them. [H, W, 3]"""
    depths = make_truth(scene, camera_index, frame_index).depths
    height, width = depths.shape
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    pixels = np.stack([x, y, np.ones_like(x)], axis=-1)
    in_camera = pixels @ np.linalg.inv(scene.rig.Ks[camera_index]).T * depths[..., None]
    pose = scene.rig.world_to_camera[camera_index]
    return (in_camera - pose[:3, 3]) @ pose[:3, :3]


@pytest.mark.parametrize("supersampling", [1, 3])
def test_surfaces_lie_where_the_truth_has_them_and_become_the_picture(supersampling: int) -> None:
    camera = SceneCamera(SCENE, CAMERA, supersampling=supersampling)
    surfaces = camera.surfaces(30)
    assert np.allclose(surfaces.positions, positions_of(SCENE, CAMERA, 30), atol=1e-4)
    rounded = np.floor(np.clip(surfaces.colors, 0, 1) * 255 + 0.5)
    assert np.array_equal(rounded, camera.image(30))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in CHANGES if name != "none"])
def test_a_change_is_its_factor_on_the_unchanged_pictures(footage: CameraFootage, name: str) -> None:
    change = changed(name)
    clean = list(footage.pictures(changed("none"), noise=0.0))
    after = list(footage.pictures(change, noise=0.0))
    n_changed = 0
    for frame_index in range(0, N_FRAMES, 3):
        factors = change.factors(CAMERA, frame_index, positions_of(SCENE, CAMERA, frame_index))
        expected = clean[frame_index] * factors
        is_unclipped = (clean[frame_index] < 255) & (after[frame_index] < 255)
        wrong = np.abs(after[frame_index] - expected)[is_unclipped]
        assert wrong.max() <= 1.1  # half a level of rounding in either picture
        n_changed += int((np.abs(factors - 1) > 0.03).sum())
    assert n_changed > 200


@pytest.mark.parametrize("name", CHANGES)
def test_noise_is_the_same_in_every_capture_and_as_strong_as_asked_for(footage: CameraFootage, name: str) -> None:
    noisy, clean = (np.array(list(footage.pictures(changed(name), noise=level))) for level in (4 * NOISE, 0.0))
    is_inside = (clean > 20) & (clean < 235)
    grain = (noisy.astype(float) - clean)[is_inside]
    assert abs(grain.mean()) < 0.05
    assert 3.9 < grain.std() < 4.2  # of 255; rounding adds a little
    unchanged = np.array(list(footage.pictures(changed("none"), noise=4 * NOISE))).astype(float)
    unchanged -= np.array(list(footage.pictures(changed("none"), noise=0.0)))
    assert np.abs(unchanged[is_inside] - grain)[(unchanged[is_inside] < 15)].mean() < 1.0


@pytest.mark.parametrize("gain", [0.9, 1.1])
def test_white_is_clipped_after_the_change(gain: float) -> None:
    scene = make_scene(size=(48, 36), n_cameras=8, n_frames=1)  # the sample, parts of which are brighter than white
    change = Change("all cameras alike", np.full((8, 1, 3), gain), changed("none").light)
    picture = next(CameraFootage(scene, CAMERA, supersampling=1).pictures(change, noise=0.0))
    colors = SceneCamera(scene, CAMERA, supersampling=1).surfaces(0).colors
    assert (colors > 1.02).any()
    assert np.abs(picture - np.minimum(gain * 255 * colors, 255)).max() < 0.51


def test_drift_is_smooth_and_differs_by_camera_and_channel() -> None:
    gains = changed("drift").camera_gains
    assert gains.shape == (8, N_FRAMES, 3)
    assert (gains[:, 0] == 1).all()
    assert (gains[HELD_OUT] == 1).all()
    last = np.abs(gains[:, -1] - 1)
    assert 0.08 < last.max() < 0.13
    assert (last.max(axis=1) > 0.05).sum() >= 3
    moving = last[:, 0] > 0
    assert (np.ptp(last[moving], axis=1) > 1e-3).all()
    assert np.abs(np.diff(gains, axis=1)).max() < 3 * 0.12 / N_FRAMES
    assert np.array_equal(gains, changed("drift").camera_gains)
    assert not np.array_equal(gains, make_change("drift", SCENE, seed=1).camera_gains)


def test_drifts_of_ten_training_cameras_leave_the_mean_of_all_as_it_is() -> None:
    logs = np.log(make_change("drift", make_long_scene()).camera_gains)
    assert (np.abs(logs[:, -1]).max(axis=1) > 0.05).sum() == 8
    assert np.abs(logs.mean(axis=0)).max() < 0.01


def test_exposures_jump_once_in_the_middle_of_a_clip() -> None:
    gains = changed("step").camera_gains
    jumps = np.argwhere(np.abs(np.diff(gains[..., 0], axis=1)) > 0)
    assert len(jumps) == 2  # of six training cameras
    assert set(jumps[:, 0]).isdisjoint(HELD_OUT)
    (frame_index,) = set(jumps[:, 1] + 1)
    assert frame_index % CLIP_LENGTH == CLIP_LENGTH // 2
    assert abs(frame_index / N_FRAMES - 0.4) < 0.2
    assert np.allclose(np.abs(np.log(gains[jumps[:, 0], -1])), 0.08)


def test_light_changes_where_it_should() -> None:
    floor = np.array([[[x, y, 0.0] for x in np.linspace(-3, 3, 61)] for y in np.linspace(-3, 3, 61)])
    low, high = (floor + np.array([0.0, 0.0, height]) for height in (1.0, 1.2))
    shadow, lamp, daylight = changed("shadow"), changed("lamp"), changed("daylight")
    for frame_index in (0, 20, 39):
        on_floor = shadow.light(frame_index, floor)
        assert on_floor.min() == pytest.approx(0.7, abs=0.01)
        assert (on_floor == 1).mean() > 0.5  # most of the floor is lit
        assert (shadow.light(frame_index, low) == 1).all()
        steepest = max(np.abs(np.diff(on_floor, axis=axis)).max() for axis in (0, 1))
        assert steepest < 0.1  # in a tenth of a unit: soft
    first, last = (floor[np.unravel_index(shadow.light(i, floor).argmin(), (61, 61))] for i in (0, 39))
    assert np.linalg.norm(last - first) > 4
    assert (lamp.light(0, floor) == 1).all()
    dimmed = lamp.light(39, high)
    assert dimmed.min() < 0.8
    assert dimmed.max() > 0.97
    assert np.allclose(daylight.light(39, floor), DAYLIGHT_END)
    for change in (shadow, lamp, daylight):
        assert (change.camera_gains == 1).all()


@pytest.mark.slow
def test_the_parcel_appears_in_the_middle_of_a_clip_and_something_always_moves() -> None:
    parcel = SCENE.parts[SCENE.part_index("gift")]
    first = next(frame_index for frame_index in range(N_FRAMES) if parcel.pose(frame_index) is not None)
    assert first % CLIP_LENGTH == CLIP_LENGTH // 2
    assert first > N_FRAMES / 2
    camera = SceneCamera(SCENE, CAMERA, supersampling=1)
    pictures = np.array([camera.image(frame_index) for frame_index in range(N_FRAMES)])
    assert ((pictures[1:] != pictures[:-1]).mean(axis=(1, 2, 3)) > 0.01).all()


def test_there_is_no_change_of_another_name() -> None:
    with pytest.raises(ValueError, match="fog"):
        changed("fog")


@pytest.mark.slow
def test_captures_are_written_alike_each_time_and_open(tmp_path: Path) -> None:
    scene = make_long_scene(size=(48, 36), n_cameras=4, n_frames=6, clip_length=3)
    chosen = {name: make_change(name, scene) for name in ("none", "daylight")}
    write_long_captures(tmp_path / "a", scene, chosen, supersampling=1)
    write_long_captures(tmp_path / "b", scene, chosen, supersampling=1)
    paths = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*.*"))
    assert len(paths) == 2 * 5
    for path in paths:
        assert (tmp_path / "a" / path).read_bytes() == (tmp_path / "b" / path).read_bytes(), path
    write_long_captures(tmp_path / "c", scene, {"none": chosen["none"]}, seed=1, supersampling=1)
    assert (tmp_path / "a/none/cam00.mp4").read_bytes() != (tmp_path / "c/none/cam00.mp4").read_bytes()

    capture = open_capture(tmp_path / "a" / "daylight")
    assert capture.default_holdout == scene.default_holdout
    taken = list(CameraFootage(scene, 2, supersampling=1).pictures(chosen["daylight"]))
    stored = [capture.frame(2, frame_index) for frame_index in range(6)]
    assert np.abs(np.array(stored).astype(int) - taken).max() <= 2  # to YUV and back
