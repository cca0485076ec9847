"""Frames of the scene as exports take them: which clip shows a moment, parts, and what is said before work starts."""

from __future__ import annotations

import pytest
import torch

from app.evaluation.headless import TrainedProject
from app.export.scene_frames import SceneFrames
from engine.errors import ProjectError


def test_a_moment_is_what_the_clip_decodes(opened: TrainedProject):
    scene = SceneFrames(opened)
    assert scene.trained_frames == [0, 1, 2, 3, 4, 5]
    for frame, clip_index, clip_time in ((0, 0, 0.0), (2, 0, 2 / 3), (3, 1, 0.0), (4.25, 1, 1.25 / 3)):
        expected = opened.load(clip_index).model.decode(clip_time)
        found = scene.gaussians(frame)
        assert all(torch.equal(a, b) for a, b in zip(found.tensors(), expected.tensors(), strict=True))


def test_between_clips_the_nearer_one_is_shown_and_half_way_the_earlier(opened: TrainedProject):
    scene = SceneFrames(opened)
    assert [scene.clip_at(frame).clip_index for frame in (2.0, 2.4, 2.5, 2.51, 3.0, 5.0)] == [0, 0, 0, 1, 1, 1]
    assert scene.clip_time(2.5) == pytest.approx(2.5 / 3)
    assert scene.clip_time(2.75) == pytest.approx(-0.25 / 3)
    assert len(scene.gaussians(2.75))


def test_parts_are_the_whole(opened: TrainedProject):
    scene = SceneFrames(opened)
    for frame in (1, 4):
        whole, static, moving = (scene.gaussians(frame, part) for part in ("all", "static", "moving"))
        assert len(static) + len(moving) == len(whole)
        assert torch.equal(torch.cat([static.means, moving.means]), whole.means)


@pytest.mark.parametrize("frame", [-1, -0.1, 5.1, 6, float("nan"), float("inf")])
def test_there_is_no_frame_outside_of_the_capture(opened: TrainedProject, frame: float):
    with pytest.raises(ProjectError, match="no frame"):
        SceneFrames(opened).check([0, frame])


def test_untrained_clips_are_named_before_any_work(opened: TrainedProject):
    opened.project.clip_path(1).unlink()
    scene = SceneFrames(opened)
    scene.check([0, 2.5])
    with pytest.raises(ProjectError, match=r"Frame 3 lies in clip 1, which is not trained") as error:
        scene.check(range(6))
    assert "--frames 0:3" in str(error.value.hint)
    with pytest.raises(ProjectError, match="no frames"):
        scene.check([])


def test_damaged_clips_are_named_before_any_work(opened: TrainedProject):
    path = opened.project.clip_path(1)
    data = bytearray(path.read_bytes())
    data[-20] ^= 255
    path.write_bytes(data)
    with pytest.raises(ProjectError, match="damaged"):
        SceneFrames(opened).check([0, 4])
