"""A rig whose cameras have pictures of two sizes trains, in every clip, and is measured where its cameras see."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from app.lab.synthetic.writing import write_video
from engine.assets import asset_path
from engine.backends.table import backend_called
from engine.capture.capture import open_capture
from engine.capture.clip import split_clips
from engine.capture.writers.capture_json import capture_document, write_capture_json
from engine.clip_files.clip_state import read_clip_state, write_clip_state
from engine.metrics.clips.evaluate import Evaluation
from engine.metrics.clips.trained_clip import TrainedClip
from engine.model.reading import load_clip_model
from tests.built_once import BuiltOnce
from tests.engine.training.tiny_training import CLIP_LENGTH, Tiny, finish, make_training, same_arrays

pytestmark = pytest.mark.slow
SQUARE = ("cam02", "cam05")
"""Cameras whose pictures are cut to a square: after scaling they are higher than those of the others."""
HELD_OUT = ("cam03", "cam05")


def write_mixed(folder: Path) -> Path:
    """Eight cameras of the sample at 160 x 120, two of them cut to 120 x 120, 8 frames."""
    sample = open_capture(asset_path("sample"), scale=0.5)
    names = sample.rig.names[:16:2]
    entries = []
    folder.mkdir()
    for row, name in zip(sample.camera_indices(names), (f"cam{i:02d}" for i in range(8)), strict=True):
        frames, K = sample.frames_of(row, range(2 * CLIP_LENGTH)), sample.rig.Ks[row].copy()
        if name in SQUARE:
            frames, K[0, 2] = frames[:, :, 20:140], K[0, 2] - 20
        write_video(folder / f"{name}.mp4", frames, fps=30.0)
        size = (frames.shape[2], frames.shape[1])
        entry = replace(sample.layout.cameras[row], name=name, K=K, image_size=size)
        entries.append(entry)
    document = capture_document(replace(sample.layout, cameras=tuple(entries), default_holdout=HELD_OUT), folder)
    for row in document["cameras"]:
        row["video"] = f"{row['name']}.mp4"
    write_capture_json(folder, document)
    return folder


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory, built_once: BuiltOnce) -> Tiny:
    """The capture with its reference clip trained."""

    def build(folder: Path) -> None:
        capture = open_capture(write_mixed(folder / "capture"))
        holdout = capture.camera_indices(HELD_OUT)
        clip = split_clips(capture.n_frames, CLIP_LENGTH)[0]
        training = make_training(capture, holdout, clip=clip, reference=None, prep_dir=folder / "prep")
        training.prepare()
        write_clip_state(folder / "reference.safetensors", finish(training))
        training.finish()

    folder = tmp_path_factory.mktemp("mixed")
    built_once.copy("mixed-sizes", folder, build, sources=["tests/engine/training/test_mixed_sizes.py"])
    capture = open_capture(folder / "capture")
    clips = split_clips(capture.n_frames, CLIP_LENGTH)
    reference = read_clip_state(folder / "reference.safetensors")
    return Tiny(capture, clips, capture.camera_indices(HELD_OUT), folder / "prep", reference)


def test_all_pictures_have_one_size_and_say_what_of_them_is_seen(mixed: Tiny) -> None:
    capture = mixed.capture
    assert capture.picture_size == (120, 120)
    is_square = [name in SQUARE for name in capture.rig.names]
    shares = [1.0 if (valid := capture.valid(camera)) is None else valid.mean() for camera in range(8)]
    assert shares == [1.0 if square else 0.75 for square in is_square]


def test_a_source_clip_learns_the_same_with_active_tiles(mixed: Tiny) -> None:
    every, active = (mixed.prepared(1, tiles=tiles, source_steps=10) for tiles in ("all", "active"))
    for _ in range(10):
        slow, fast = every.step(), active.step()
        assert fast.train_psnr == pytest.approx(slow.train_psnr, abs=1e-4)
    assert same_arrays(every.state().arrays, active.state().arrays)


def test_the_black_of_padding_is_not_learned(mixed: Tiny) -> None:
    """Below what a camera sees, the scene goes on, as others know."""
    trained = TrainedClip(
        mixed.clips[0], load_clip_model(mixed.reference, None, backend=backend_called("cpu")), mixed.reference, None
    )
    for camera in (0, 4):
        valid = mixed.capture.valid(camera)
        assert valid is not None
        image = trained.picture(mixed.capture.rig, camera, 0.0)
        assert (mixed.capture.frame(camera, 0)[~valid] == 0).all()
        assert image[~valid].mean() > 0.5 * image[valid].mean()


def test_it_is_measured_where_cameras_see(mixed: Tiny) -> None:
    capture, clip = mixed.capture, mixed.clips[0]
    trained = TrainedClip(
        clip, load_clip_model(mixed.reference, None, backend=backend_called("cpu")), mixed.reference, None
    )
    evaluation = Evaluation(capture, cameras=range(8), holdout=mixed.holdout, metrics="quick")
    pairs: list = []
    rows = evaluation.measure(trained, frames=[clip.start, clip.start + 1], on_pair=pairs.append)
    assert len(rows) == 16
    assert {row.camera for row in rows if row.is_held_out} == set(HELD_OUT)
    for row in rows:
        assert row.figures["psnr"] is not None
        assert row.figures["psnr"] > 8.0
    assert len(pairs) == 8
    assert all(pair.static_share > 0.3 for pair in pairs)
