"""The checks by which an implementation of the method is accepted, numbered 1 to 10.

Where another test already is the check it is not written twice:
1. Frozen tensors are bit-identical before and after a source clip: test_clip_training,
   test_a_source_clip_adds_residual_anchors_and_leaves_everything_inherited_untouched; for every switch and the decoder
   as well test_ablations, test_a_switch_trains_and_changes_only_what_it_names.
5. Clip time is i / M, for partial clips too: tests/engine/capture/test_clip.py,
   test_clip_time_starts_at_zero_steps_evenly_and_stays_below_one; that training and field follow it: below.
6. Static pixels do not flicker, at clip borders as inside: of given models tests/engine/metrics/clips/test_seams.py,
   test_a_static_scene_does_not_flicker_at_all; of trained ones below.
7. Formats survive a round trip: of the two layouts that are read, below. Readers of poses_bounds and COLMAP files do
   not exist yet, so that part of the check is open.
8. A saved clip shows the same pixels: test_ablations,
   test_a_clip_saved_with_a_switch_shows_the_pixels_it_was_trained_to; of a reference clip below.
9. Each switch changes only what it names: test_ablations.
Source: ClipGStream; the list is this project's.
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image

from app.lab.synthetic.scene import make_scene
from app.lab.synthetic.writing import cameras_document, write_json, write_video
from engine.backends.table import backend_called
from engine.camera.rig import CameraRig
from engine.capture.capture import Capture, open_capture
from engine.clip_files.clip_state import read_clip_state, write_clip_state
from engine.cloud.motion.moving_cloud import MovingCloud
from engine.metrics.clips.evaluate import Evaluation
from engine.metrics.clips.features_apart import with_features
from engine.metrics.clips.seams import PairRow, summarize
from engine.metrics.clips.trained_clip import TrainedClip
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.model.clip_view import REACH_SPACINGS, View, render_gaussians, render_model
from engine.model.reading import load_clip_model
from engine.training.clip_training import ClipTraining
from engine.training.config import TrainConfig
from engine.training.preparation.building import add_residual
from tests.engine.training.tiny_training import Tiny, finish, live_picture, make_training, picture, take_steps

pytestmark = pytest.mark.slow


def first_view(tiny: Tiny, camera: int = 0) -> View:
    rig = tiny.capture.rig
    width, height = (int(v) for v in rig.image_sizes[camera])
    near_plane = tiny.reference.header.near_plane
    return View.from_arrays(
        rig.world_to_camera[camera], rig.Ks[camera], width=width, height=height, near_plane=near_plane
    )


def test_2_a_source_clip_starts_as_its_static_features_alone_show_it(tiny):
    training = tiny.prepared(1, source_steps=40)
    view, reach = first_view(tiny), REACH_SPACINGS * tiny.reference.header.spacing
    times = [frame / training.clip.clip_length for frame in range(training.clip.n_frames)]
    assert _distance_from_static(training, times, view, reach) < 1 / 255
    take_steps(training, 40)  # the field has learned by then, so the comparison can fail
    assert _distance_from_static(training, times, view, reach) > 1 / 255


@torch.no_grad()
def _distance_from_static(training: ClipTraining, times: list[float], view: View, reach: float) -> float:
    """Largest difference of any pixel between the clip and what its static features alone show."""
    static = with_features(training.model, "static")
    pictures = [[render_model(model, view, time, reach=reach) for model in (training.model, static)] for time in times]
    return max(float((one - other).abs().max()) for one, other in pictures)


def model_and_cloud(points: np.ndarray) -> tuple[ClipModel, MovingCloud]:
    """A source clip that inherits moving anchors on a cube of side one, and a cloud of the clip's own."""
    corners = np.stack(np.meshgrid(*[np.linspace(0, 1, 4)] * 3), -1).reshape(-1, 3).astype(np.float32)
    nobody = torch.zeros(len(corners), 2, dtype=torch.bool)
    moving = AnchorSet.from_cloud(
        torch.from_numpy(corners), torch.full((len(corners), 3), 0.5), spacing=0.3, feature_dim=16, presence=nobody
    )
    model = ClipModel(
        sets={"moving": moving},
        decoder=torch.nn.Module(),  # type: ignore[arg-type]
        field=None,
        clip_length=2,
        n_frames=2,
        backend=backend_called("cpu"),
    )
    points = (corners if points.size == 0 else corners + points).astype(np.float32)
    presence = np.tile([True, False], (len(points), 1))
    return model, MovingCloud(points, np.full_like(points, 0.5), presence, 0.3)


@pytest.mark.parametrize(("shift", "n_expected"), [(0.0, 0), (0.05, 0), (100.0, 64)])
def test_3_residual_anchors_are_none_where_all_is_covered_and_all_where_nothing_is(shift, n_expected):
    model, cloud = model_and_cloud(np.full(3, shift))
    add_residual(model, cloud, TrainConfig())
    n_residual = len(model.anchor_set("residual")) if "residual" in model.roles() else 0
    assert n_residual == n_expected
    covering = model.anchor_set("moving").presence
    assert covering is not None
    assert covering[:, 0].any() == (n_expected == 0)  # what is covered switches inherited anchors on
    assert not covering[:, 1].any()


def test_4_source_clips_do_not_depend_on_the_order_of_their_training(tiny, tmp_path):
    found: dict[int, set[str]] = {1: set(), 2: set()}
    for order in ((1, 2), (2, 1)):
        prep_dir = tmp_path / str(order[0])
        shutil.copytree(tiny.prep_dir, prep_dir)
        for i in order:
            found[i].add(tiny.trained(i, prep_dir=prep_dir).fingerprint)
    assert [len(fingerprints) for fingerprints in found.values()] == [1, 1]


def test_5_a_partial_clip_is_trained_and_decoded_at_the_times_of_whole_ones(tiny):
    training = tiny.prepared(7)
    clip = training.clip
    assert (clip.n_frames, clip.clip_length, clip.stop) == (2, 4, tiny.capture.n_frames)
    times: set[float] = set()
    decode = training.model.decode

    def watched(clip_time, rows=None):
        times.add(clip_time)
        return decode(clip_time, rows)

    training.model.decode = watched  # type: ignore[method-assign]
    take_steps(training, 6)
    assert times == {0.0, 0.25}
    assert [training.model.knots(clip.clip_time(frame)) for frame in clip.frame_indices()] == [[(0, 1.0)], [(1, 1.0)]]
    assert training.model.knots(0.5) == [(1, 1.0)]  # beyond its end it stays at its last frame


class StillCapture:
    """The sample as if it had stood still at its first frame."""

    def __init__(self, capture: Capture) -> None:
        self._capture = capture

    def __getattr__(self, name: str):
        return getattr(self._capture, name)

    def frame(self, camera_index: int, frame_index: int) -> np.ndarray:
        return self._capture.frame(camera_index, 0)

    def frames_of(self, camera_index: int, frame_indices) -> np.ndarray:
        return self._capture.frames_of(camera_index, [0] * len(frame_indices))


def flicker_of_still_clips(tiny: Tiny, prep_dir, **settings) -> list[PairRow]:
    """Pairs of neighbouring frames of two clips of a still scene."""
    capture = StillCapture(tiny.capture)
    arguments = {"prep_dir": prep_dir, **settings}
    evaluation = Evaluation(capture, cameras=tiny.holdout[:2], holdout=tiny.holdout, metrics="quick")  # type: ignore[arg-type]
    reference, before, pairs = None, None, []
    for clip in tiny.clips[:2]:
        training = make_training(capture, tiny.holdout, clip=clip, reference=reference, **arguments)  # type: ignore[arg-type]
        training.prepare()
        state = finish(training)
        reference = reference or state
        trained = TrainedClip(
            clip, load_clip_model(state, reference, backend=backend_called("cpu")), reference, state.drift
        )
        evaluation.measure(trained, before=before, on_pair=pairs.append)
        before = trained
    return pairs


def test_6_a_still_scene_does_not_flicker_at_all_with_the_gate(tiny, tmp_path):
    pairs = flicker_of_still_clips(tiny, tmp_path)
    assert sum(pair.is_boundary for pair in pairs) == 2
    assert {pair.static_share for pair in pairs} == {1.0}
    assert {pair.change_static for pair in pairs} == {0.0}


def test_6_a_still_scene_changes_at_the_border_about_as_much_as_inside_without_the_gate(tiny, tmp_path):
    """A smoke test, not the check itself: one border between two clips of about fifty steps.

    Without the gate what is still changes by what the field learned by chance: 0.1 to 0.7 of 255 from frame to frame,
    a factor of four or more between pairs of one training. Border against the median pair inside was 1.1 to 1.5 before
    there were large Gaussians of a backdrop, which a fresh field moves all over the picture in so few steps; with
    them it is 3.7 and 4.5, 2.2 of 255. What it does find is a clip that looks different as a whole from the one before.
    """
    slow = {"table_lr": 0.04, "field_mlp_lr": 8e-3, "feature_lr": 7.5e-3, "scale_lr": 7e-3, "final_lr_ratio": 0.02}
    steps = {"joint_steps": 40, "source_steps": 60}  # too few for the rates of the defaults
    shared = {"inherit": "frozen", "decoder": "frozen", "field_tables": "shared"}
    pairs = flicker_of_still_clips(tiny, tmp_path, gate="off", **shared, **steps, **slow)
    ratios = []
    for camera in {pair.camera for pair in pairs}:
        changes = [(pair.is_boundary, pair.change_static or 0.0) for pair in pairs if pair.camera == camera]
        border, inside = ([change for is_border, change in changes if is_border == wanted] for wanted in (True, False))
        assert (len(border), len(inside)) == (1, 6)
        ratios.append(border[0] / np.median(inside))
    assert 0.7 < np.median(ratios) < 6.0
    assert summarize(pairs)["means"]["all"]["boundary"]["change_static"] < 3 / 255


def crooked_rig() -> CameraRig:
    """Three cameras with nothing in common: any rotation, fx other than fy, no centred principal point, two sizes."""
    rng = np.random.default_rng(7)
    rotations = np.linalg.qr(rng.normal(size=(3, 3, 3)))[0]
    rotations *= np.sign(np.linalg.det(rotations))[:, None, None]
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotations, rng.normal(size=(3, 3))
    sizes = np.array([[48, 32], [40, 30], [48, 32]])
    Ks = np.tile(np.eye(3), (3, 1, 1))
    Ks[:, 0, 0], Ks[:, 1, 1] = rng.uniform(35, 60, (2, 3))
    Ks[:, :2, 2] = sizes * rng.uniform(0.4, 0.6, (3, 2))
    return CameraRig(names=("2", "10", "11"), world_to_camera=poses, Ks=Ks, image_sizes=sizes)


def level(camera: int, frame: int) -> int:
    """Grey value of a whole picture, 20 from any other of these."""
    return 20 + 20 * (4 * camera + frame)


def grey_pictures(rig: CameraRig, camera: int, n_frames: int) -> list[np.ndarray]:
    width, height = rig.image_sizes[camera]
    return [np.full((height, width, 3), level(camera, frame), np.uint8) for frame in range(n_frames)]


def write_as_sample(folder: Path, rig: CameraRig, n_frames: int) -> None:
    """As the sample is written, of which the scene's cameras are these."""
    scene = replace(make_scene(n_cameras=3, n_frames=n_frames), rig=rig)
    write_json(folder / "cameras.json", cameras_document(scene))
    for camera, name in enumerate(rig.names):
        write_video(folder / f"{name}.mp4", grey_pictures(rig, camera, n_frames), fps=scene.fps)


def write_as_panoptic(folder: Path, rig: CameraRig, n_frames: int) -> None:
    """The camera of the other size is the hold-out, because a meta file knows one size."""
    for name, cameras in (("train_meta.json", (2, 0)), ("test_meta.json", (1,))):
        numbers = [rig.names[camera] for camera in cameras]
        width, height = rig.image_sizes[cameras[0]].tolist()
        row = {
            "k": rig.Ks[list(cameras)].tolist(),
            "w2c": rig.world_to_camera[list(cameras)].tolist(),
            "cam_id": [int(number) for number in numbers],
        }
        meta: dict[str, Any] = {"w": width, "h": height} | {key: [value] * n_frames for key, value in row.items()}
        meta["fn"] = [[f"{number}/{frame:06d}.jpg" for number in numbers] for frame in range(n_frames)]
        write_json(folder / name, meta)
        for camera, number in zip(cameras, numbers, strict=True):
            (folder / "ims" / number).mkdir(parents=True)
            for frame, picture_of_it in enumerate(grey_pictures(rig, camera, n_frames)):
                Image.fromarray(picture_of_it).save(folder / "ims" / number / f"{frame:06d}.jpg", quality=95)


@pytest.mark.parametrize("layout", ["sample", "panoptic"])
def test_7_a_rig_written_in_a_layout_that_is_read_comes_back_as_it_was(layout, tmp_path):
    """Other layouts: tests/engine/capture/test_same_in_every_layout.py."""
    rig = crooked_rig()
    {"sample": write_as_sample, "panoptic": write_as_panoptic}[layout](tmp_path, rig, 4)
    capture = open_capture(tmp_path)
    assert (capture.format, capture.n_frames) == (layout, 4)
    assert capture.default_holdout == {"sample": (), "panoptic": ("10",)}[layout]  # the writer chooses none of three
    assert capture.rig.names == rig.names
    # no tolerance: JSON holds the shortest decimal that reads back as the same float64, and the readers change nothing
    assert np.array_equal(capture.native_rig.Ks, rig.Ks)
    assert np.array_equal(capture.native_rig.world_to_camera, rig.world_to_camera)
    assert np.array_equal(capture.native_rig.image_sizes, rig.image_sizes)
    for camera in range(3):
        valid = capture.valid(camera)
        found = [capture.frame(camera, frame) for frame in range(4)]
        assert [frame.shape for frame in found] == [(30, 40, 3)] * 4  # the longer sides as that of the smallest
        seen = [frame if valid is None else frame[valid] for frame in found]
        expected = [level(camera, frame) for frame in range(4)]
        assert np.abs(np.array([part.mean() for part in seen]) - expected).max() < 3  # codecs; others are 20 away


def test_8_a_reference_clip_shows_the_same_pixels_after_a_trip_to_the_disk(tiny, tmp_path):
    training = tiny.prepared(0, is_source=False, prep_dir=tmp_path)
    write_clip_state(tmp_path / "clip.safetensors", finish(training))
    again = read_clip_state(tmp_path / "clip.safetensors")
    for frame in range(4):
        assert np.array_equal(picture(tiny, again, None, frame=frame), live_picture(tiny, training, frame=frame))


@pytest.mark.parametrize("clip_index", [0, 1])
def test_10_gaussians_of_a_frame_taken_out_once_are_what_every_camera_sees(tiny, clip_index):
    state = tiny.reference if clip_index == 0 else tiny.trained(1)
    model = load_clip_model(state, tiny.reference, backend=backend_called("cpu"))
    reach = REACH_SPACINGS * tiny.reference.header.spacing
    baked = model.decode(0.5)
    for camera in (0, 7, 13):
        view = first_view(tiny, camera)
        live = render_model(model, view, 0.5, reach=reach)
        assert (render_gaussians(baked, view, backend=backend_called("cpu")).image[0] - live).abs().max() < 1e-6
