"""The sample generator: truth that agrees with itself, motion as promised, video that matches what was rendered."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from app.lab.synthetic import meshes, textures
from app.lab.synthetic.rigs import FOCUS, forward_facing_rig, half_dome_rig
from app.lab.synthetic.scene import SyntheticScene, make_scene
from app.lab.synthetic.writing import cameras_document, to_yuv444, write_capture, write_scene
from engine.capture.capture import open_capture

pytest.importorskip("open3d", reason="the ray caster needs Open3D and its system libraries", exc_type=ImportError)

from app.lab.synthetic.raycast import SceneCamera, make_truth

SAMPLE = Path(__file__).parents[3] / "assets" / "sample"
SHIPPED = make_scene()


def small_scene() -> SyntheticScene:
    return make_scene(size=(96, 72), n_cameras=12)


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    return float(10 * np.log10(255**2 / np.mean((a.astype(float) - b.astype(float)) ** 2)))


@pytest.mark.parametrize(
    "mesh",
    [meshes.box((1.0, 2.0, 3.0)), meshes.sphere(0.5), meshes.cylinder(0.4, 1.0), meshes.torus(0.5, 0.1)],
)
def test_meshes_are_wound_outwards_with_unit_normals(mesh: meshes.Mesh) -> None:
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    facing = np.cross(b - a, c - a)
    is_flat = np.linalg.norm(facing, axis=-1) < 1e-12  # triangles that touch a pole
    agreement = np.einsum("fd,fcd->fc", facing, mesh.corner_normals)[~is_flat]
    assert (agreement > 0).all()
    assert np.allclose(np.linalg.norm(mesh.corner_normals, axis=-1), 1.0)
    volume = np.einsum("fd,fd->f", a, np.cross(b, c)).sum() / 6
    assert volume > 0  # closed and outward


def test_textures_are_colours_for_every_part() -> None:
    generator = np.random.default_rng(3)
    normals = generator.normal(size=(500, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    for part in SHIPPED.parts:
        albedo = part.texture(generator.uniform(-3, 3, (500, 3)), normals)
        assert albedo.shape == (500, 3)
        assert np.isfinite(albedo).all()
        assert albedo.min() > -0.05  # the renderer clips; a texture far outside would be a mistake
        assert albedo.max() < 1.35


def test_noise_is_smooth_and_the_same_each_time() -> None:
    line = np.stack([np.linspace(-3, 3, 2001), np.zeros(2001)], axis=-1)
    values = textures.noise(line, 7)
    assert np.array_equal(values, textures.noise(line, 7))
    assert 0 <= values.min() < 0.3 < 0.7 < values.max() <= 1
    assert np.abs(np.diff(values)).max() < 1.5 * 6 / 2000 + 1e-6  # slope of the blend is at most 1.5 per unit


def test_cameras_stand_in_the_room_at_two_heights_with_their_own_intrinsics() -> None:
    rig = SHIPPED.rig
    assert len(rig) == 20
    assert (np.abs(rig.centers[:, :2]) < 3.0).all()
    assert set(np.round(rig.centers[:, 2], 6)) == {1.05, 1.85}
    fov = np.degrees(2 * np.arctan(160 / rig.Ks[:, 0, 0]))
    assert fov.min() > 60
    assert fov.max() < 70
    assert len(set(rig.Ks[:, 0, 0])) == 20
    offset = np.abs(rig.Ks[:, :2, 2] - [160, 120])
    assert 2 < offset.max() < 8  # off centre by a few pixels
    assert SHIPPED.default_holdout == ("cam05", "cam13")


def test_the_ball_crosses_a_quarter_of_the_view_within_each_clip() -> None:
    rig = SHIPPED.rig
    ball = SHIPPED.parts[SHIPPED.part_index("ball")]
    poses = [ball.pose(frame) for frame in range(30)]
    centers = np.array([pose[:3, 3] for pose in poses if pose is not None])
    assert len(centers) == 30
    in_camera = np.einsum("cij,tj->cti", rig.world_to_camera[:, :3, :3], centers)
    in_camera += rig.world_to_camera[:, None, :3, 3]
    pixels = np.einsum("cij,ctj->cti", rig.Ks, in_camera)
    pixels = pixels[..., :2] / pixels[..., 2:]
    for start in (0, 10, 20):
        run = pixels[:, start : start + 10]
        crossed = run[..., 0].max(1) - run[..., 0].min(1)
        assert (crossed >= 80).sum() >= 3  # a quarter of 320; less where it flies towards or from the camera


def test_truth_depth_agrees_with_the_known_room() -> None:
    scene = small_scene()
    truth = make_truth(scene, 0, 0)
    width, height = 96, 72
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    K, pose = scene.rig.Ks[0], scene.rig.world_to_camera[0]
    in_camera = np.stack([(x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1], np.ones_like(x)], -1)
    in_camera *= truth.depths[..., None]
    world = (in_camera - pose[:3, 3]) @ pose[:3, :3]
    room = world[truth.mask("room")]
    to_shell = np.minimum((3.0 - np.abs(room[:, :2])).min(-1), np.minimum(room[:, 2], 2.8 - room[:, 2]))
    assert np.abs(to_shell).max() < 1e-4  # float32 rays over 6 units
    ball_pose = scene.parts[scene.part_index("ball")].pose(0)
    assert ball_pose is not None
    ball = world[truth.mask("ball")]
    assert len(ball) > 20
    radius = np.linalg.norm(ball - ball_pose[:3, 3], axis=-1)
    assert radius.min() > 0.168  # flat facets of a sphere of 0.17 lie up to 0.2 % inside
    assert radius.max() < 0.1701


def test_masks_tell_moving_standing_and_appearing_parts() -> None:
    scene = small_scene()
    seen_by = 0
    for camera_index in range(12):
        before, after = make_truth(scene, camera_index, 9), make_truth(scene, camera_index, 10)
        assert not before.mask("gift").any()
        seen_by += int(after.mask("gift").sum() > 40)  # of 6912 pixels; about 450 at 320x240
        assert np.array_equal(after.is_moving, after.mask("ball", "sculpture"))
        assert (after.part_indices >= 0).all()  # the room is closed
    assert seen_by >= 9
    with pytest.raises(ValueError, match="teapot"):
        make_truth(scene, 0, 0).mask("teapot")


@pytest.mark.slow
def test_only_what_moves_or_appears_changes_the_picture() -> None:
    scene = small_scene()
    camera = SceneCamera(scene, 3, supersampling=2)
    first, later, with_gift = camera.image(0), camera.image(7), camera.image(12)
    covered = camera.coverage(0, "ball", "sculpture") + camera.coverage(7, "ball", "sculpture")
    assert np.array_equal(first[covered == 0], later[covered == 0])
    assert (first[covered > 0.9] != later[covered > 0.9]).any()
    appears = camera.coverage(12, "gift") > 0.9
    assert np.abs(with_gift[appears].astype(int) - first[appears]).mean() > 20  # of 255 levels
    assert np.array_equal(camera.image(0), first)  # going back in time finds the scene as it was


def test_coverage_agrees_with_the_masks_of_pixel_centres() -> None:
    scene = small_scene()
    share = SceneCamera(scene, 5, supersampling=3).coverage(12, "gift", "ball")
    mask = make_truth(scene, 5, 12).mask("gift", "ball")
    assert mask[share == 1].all()
    assert not mask[share == 0].any()


@pytest.mark.slow
def test_a_small_capture_is_written_and_matches_what_was_rendered(tmp_path: Path) -> None:
    truth_dir = tmp_path / "truth"
    shape = {"size": (96, 72), "n_cameras": 4, "n_frames": 4, "clip_length": 2, "supersampling": 2}
    scene = write_capture(tmp_path / "capture", truth_dir=truth_dir, report=lambda line: None, **shape)
    capture = open_capture(tmp_path / "capture")
    assert capture.default_holdout == ("cam01", "cam02")
    assert np.allclose(capture.rig.world_to_camera, scene.rig.world_to_camera)
    for camera_index in (0, 3):
        camera = SceneCamera(scene, camera_index, supersampling=2)
        for frame_index in (0, 3):
            # 40 and more here; full-resolution chroma, so the encoder is all that is between the two
            assert psnr(capture.frame(camera_index, frame_index), camera.image(frame_index)) > 38
    stored = np.load(truth_dir / "cam03" / "000003.npz")
    assert np.array_equal(stored["depths"], make_truth(scene, 3, 3).depths)
    names = json.loads((truth_dir / "cam03" / "parts.json").read_text())["parts"]
    assert names.index("gift") in stored["part_indices"]
    assert sorted(path.name for path in (tmp_path / "capture").iterdir()) == [
        "cam00.mp4",
        "cam01.mp4",
        "cam02.mp4",
        "cam03.mp4",
        "cameras.json",
    ]


@pytest.mark.slow
def test_writing_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    shape = {"size": (64, 48), "n_cameras": 2, "n_frames": 3, "clip_length": 2, "supersampling": 2}
    for name in ("a", "b"):
        write_capture(tmp_path / name, report=lambda line: None, **shape)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes(), path.name


def test_yuv_of_known_colours() -> None:
    colors = np.array([[[255, 255, 255], [0, 0, 0], [255, 0, 0]]], np.uint8)
    # BT.601 limited range, as in the standard's colour bars
    assert to_yuv444(colors)[:, 0].T.tolist() == [[235, 128, 128], [16, 128, 128], [81, 90, 240]]


@pytest.mark.slow
def test_shipped_sample_is_what_the_generator_makes() -> None:
    document = json.loads((SAMPLE / "cameras.json").read_text())
    assert document == json.loads(json.dumps(cameras_document(SHIPPED)))
    capture = open_capture(SAMPLE)
    assert (capture.n_frames, capture.fps, len(capture.rig)) == (30, 30.0, 20)
    assert sum(path.stat().st_size for path in SAMPLE.iterdir()) < 6_000_000
    frame = SceneCamera(SHIPPED, 3).image(12)
    assert psnr(capture.frame(3, 12), frame) > 42  # 44 to 46 on the machine that made it


@pytest.mark.parametrize("n_cameras", [8, 13, 20])
def test_a_forward_facing_rig_looks_one_way_from_in_front_of_what_it_sees(n_cameras: int) -> None:
    rig = forward_facing_rig(n_cameras, (64, 48))
    assert len(rig) == len(np.unique(rig.centers.round(6), axis=0)) == n_cameras
    assert np.ptp(rig.centers[:, 1]) < 1e-9
    assert (rig.forwards[:, 1] > 0.85).all()  # at most 32 degrees from straight ahead
    assert (rig.focus_point()[1] - rig.centers[:, 1] > 3).all()


def test_half_a_dome_looks_at_its_middle_from_all_sides_and_from_above() -> None:
    rig = half_dome_rig(24, (64, 48))
    directions = (rig.centers - FOCUS) / np.linalg.norm(rig.centers - FOCUS, axis=1, keepdims=True)
    assert np.degrees(np.arccos((directions * -rig.forwards).sum(1))).max() < 4
    assert np.abs(directions[:, :2].mean(0)).max() < 0.05
    nearest = np.degrees(np.arccos(np.sort(np.clip(directions @ directions.T, -1, 1), axis=1)[:, -2]))
    assert 15 < nearest.min() < nearest.max() < 45  # spread evenly
    assert directions[:, 2].max() > 0.85


def test_a_scene_of_another_rig_is_written_as_a_capture(tmp_path: Path) -> None:
    scene = make_scene(n_frames=1, rig=forward_facing_rig(4, (32, 24)))
    write_scene(tmp_path, scene, supersampling=1)
    capture = open_capture(tmp_path)
    assert capture.n_frames == 1
    assert np.allclose(capture.rig.centers, scene.rig.centers)


def test_surroundings_without_texture_and_outdoors_with_a_sky() -> None:
    rig = SHIPPED.rig.subset([0, 7]).resized(np.full((2, 2), 48))
    bare, outdoors = (make_scene(rig=rig, surroundings=name) for name in ("bare room", "outdoors"))
    truth = make_truth(bare, 0, 0)
    picture = SceneCamera(bare, 0, supersampling=1).image(0)
    usual = SceneCamera(make_scene(rig=rig), 0, supersampling=1).image(0)
    is_room = truth.mask("room")
    assert np.abs(np.diff(picture.astype(int), axis=0))[is_room[1:]].mean() < 0.5 * (
        np.abs(np.diff(usual.astype(int), axis=0))[is_room[1:]].mean()
    )
    far = make_truth(outdoors, 0, 0)
    assert 0.05 < far.mask("sky").mean() < 0.6
    assert far.depths[far.mask("sky")].min() > 10
    assert np.isfinite(far.depths).all()
    colors = SceneCamera(outdoors, 0, supersampling=1).image(0)[far.mask("sky")]
    assert colors.min() > 120  # bright, and bluer than red
    assert (colors[:, 2] >= colors[:, 0]).all()


def test_unknown_surroundings_are_refused() -> None:
    with pytest.raises(ValueError, match="there are room, bare room, outdoors"):
        make_scene(surroundings="cave")
