"""Videos, files of Gaussians and players follow the timing of the take, or leave it out."""

from __future__ import annotations

import json
import runpy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from app.evaluation.headless import TrainedProject, open_trained
from app.export.edits_line import included_lines
from app.export.export_progress import ExportProgress
from app.export.gaussians import gaussians_job
from app.export.jobs.gaussians import GaussiansJob
from app.export.jobs.player import PlayerJob
from app.export.jobs.video import Turntable, VideoJob
from app.export.picked_frames import PickedFrames
from app.export.player_job import run as run_player
from app.export.scene_frames import SceneFrames
from app.export.take import take_frames, taken_outputs
from app.export.video.drawing import draw
from app.export.video.plan import plan_video
from app.export.video.render import render_video
from app.export.video.timed_sound import TimedSound
from app.project.opening.project_access import open_project
from engine.errors import ProjectError
from engine.metrics.clips.trained_clip import TrainedClip
from engine.metrics.pictures.colors import to_levels
from engine.timing.segment import Segment
from engine.timing.timing import SourceMoment, TakeTiming
from tests.app.export.video.conftest import images_in
from tests.app.stored_project import copy_stored

READER = runpy.run_path(str(Path(__file__).parents[3] / "docs" / "examples" / "read_player.py"))
TAKE = (Segment(4, 6, is_reversed=True), Segment(1, 2, n_frozen=3), Segment(0, 4, repeats=2, crossfade_frames=1))
SHOWN = [(5,), (4,), (1,), (1,), (1,), (0,), (1,), (2,), (0, 3), (1,), (2,), (3,)]
"""Frames seen in each frame of the take; of the cross-fade half of each."""
Edited = Callable[..., TrainedProject]


def ignore(progress: ExportProgress) -> None:
    """Nobody looks."""


@pytest.fixture
def edited(tmp_path: Path) -> Edited:
    """A small training of the sample's frames 0 to 5, in clips of three, with a timing."""
    project = copy_stored(tmp_path / "p")

    def edit(*segments: Segment) -> TrainedProject:
        opened = open_project(project)
        opened.change(replace(opened.document, timing=segments), "time")
        opened.close()
        return open_trained(open_project(project, is_writable=False))

    return edit


def job(opened: TrainedProject, out: Path, **entries: Any) -> VideoJob:
    return VideoJob(out, "png", camera=opened.capture.rig.names[2], **entries)


def test_pictures_are_those_of_the_take(edited: Edited, tmp_path: Path) -> None:
    opened = edited(*TAKE)
    wanted = job(opened, tmp_path / "v")
    written = render_video(wanted, opened)
    assert written.n_pictures == len(SHOWN)
    scene = SceneFrames(opened)
    view = plan_video(replace_out(wanted, tmp_path / "w"), scene).view_of(0, 0.0)
    images = images_in(tmp_path / "v")
    assert sorted(path.name for path in (tmp_path / "v").iterdir())[0] == "picture_000000.png"
    for image, frames in zip(images, SHOWN, strict=True):
        mixed = np.mean([draw(scene, float(frame), view).color for frame in frames], axis=0)
        assert np.abs(image.astype(int) - to_levels(mixed)).max() <= 1
    render_video(job(opened, tmp_path / "as", has_timing=False), opened)
    assert sorted(path.name for path in (tmp_path / "as").iterdir()) == [f"frame_{k:06d}.png" for k in range(6)]


def replace_out(wanted: VideoJob, out: Path) -> VideoJob:
    return VideoJob(out, wanted.format, camera=wanted.camera)


def test_moments_between_frames_are_rendered(edited: Edited, tmp_path: Path) -> None:
    opened = edited(Segment(0, 3, 0.5, 0.5))
    plan = plan_video(job(opened, tmp_path / "v"), SceneFrames(opened))
    assert [moment.scene for moment in plan.moments] == [0, 0.5, 1, 1.5, 2, 2]
    slow = plan_video(job(opened, tmp_path / "v", speed=0.5), SceneFrames(opened))
    assert [moment.scene for moment in slow.moments][:5] == [0, 0.25, 0.5, 0.75, 1]
    held = plan_video(
        job(opened, tmp_path / "v").__class__(tmp_path / "v", "png", turntable=Turntable(), hold=1.0),
        SceneFrames(opened),
    )
    assert {moment.scene for moment in held.moments} == {1.0}
    assert len(held.moments) == 30


def test_chosen_frames_are_those_of_the_capture(edited: Edited) -> None:
    opened = edited(*TAKE)
    scene, timing = SceneFrames(opened), TakeTiming(TAKE, 30)
    assert taken_outputs(scene, timing, PickedFrames.of(range(0, 2))) == [2, 3, 4, 5, 6, 9]
    assert taken_outputs(scene, timing, PickedFrames.of(range(0, 6, 5))) == [0, 5, 10]
    found = take_frames(scene, None, has_timing=True)
    assert [tuple(sorted(one.frame for one in frame.moments)) for frame in found] == SHOWN
    assert [frame.number for frame in take_frames(scene, None, has_timing=False)] == list(range(6))
    only = SceneFrames(edited(Segment(0, 2)))
    with pytest.raises(ProjectError, match="shows none"):
        take_frames(only, PickedFrames.of(range(4, 5)), has_timing=True)


def test_changes_and_comparisons_follow_it(edited: Edited, tmp_path: Path) -> None:
    opened = edited(Segment(2, 4), Segment(2, 3, n_frozen=2))
    render_video(job(opened, tmp_path / "c", shows="change"), opened)
    first, second, third, fourth = images_in(tmp_path / "c")
    assert (first == first[0, 0]).all()
    assert (second != first).any()
    assert (third != first).any()
    assert np.array_equal(fourth, first)  # frozen: nothing changes
    render_video(job(opened, tmp_path / "t", shows="compare"), opened)
    assert len(images_in(tmp_path / "t")) == 4
    slow = edited(Segment(0, 3, 0.5, 0.5))
    with pytest.raises(ProjectError, match="captured frames only"):
        plan_video(job(slow, tmp_path / "x", shows="compare"), SceneFrames(slow))


@pytest.mark.parametrize("part", ["all", "split"])
def test_files_of_gaussians_are_those_of_the_take(edited: Edited, tmp_path: Path, part: str) -> None:
    opened = edited(*TAKE)
    wanted: dict[str, Any] = {"out": tmp_path / "g", "part": part}
    gaussians_job.run(opened, GaussiansJob(**wanted), ignore)
    stem = "p_moving" if part == "split" else "p"
    files = sorted(path.name for path in (tmp_path / "g").glob(f"{stem}_[0-9]*.ply"))
    assert files == [f"{stem}_{k:04d}.ply" for k in range(len(SHOWN))]
    (about,) = (tmp_path / "g").glob("*.json")
    document = json.loads(about.read_text())
    assert (document["first_frame"], document["last_frame"], document["n_frames"]) == (0, 11, 12)
    contents = [(tmp_path / "g" / name).read_bytes() for name in files]
    assert contents[2] == contents[3] == contents[4] == contents[6]
    assert contents[0] != contents[1]


def test_a_cross_fade_holds_both_moments_as_faint_as_they_are_seen(edited: Edited) -> None:
    scene = SceneFrames(edited())
    moments = (SourceMoment(0.0, 0.25), SourceMoment(2.0, 0.75))
    faded, moving = scene.at_moments(moments), [scene.gaussians(frame, "moving") for frame in (0.0, 2.0)]
    still = scene.gaussians(2.0, "static")
    assert len(faded) == len(still) + sum(map(len, moving))
    expected = [0.25 * moving[0].opacities, 0.75 * moving[1].opacities]
    for found, wanted in zip(faded.opacities[len(still) :].split([len(one) for one in moving]), expected, strict=True):
        assert np.allclose(found.numpy(), wanted.numpy())
    assert len(scene.at_moments(moments, "static")) == len(still)
    assert scene.at_moments(moments[1:]).opacities.equal(scene.gaussians(2.0).opacities)


def test_players_play_it_and_hold_every_moment_once(edited: Edited, tmp_path: Path) -> None:
    opened = edited(*TAKE)
    run_player(opened, PlayerJob(tmp_path / "p.html"), ignore)
    page, scene = READER["Page"](tmp_path / "p.html"), SceneFrames(opened)
    take = page.header["take"]
    assert len(take) == len(SHOWN)
    assert page.n_frames == len(set(SHOWN)) == 7
    assert take[2] == take[3] == take[4] == take[6]
    for place, frames in zip(take, SHOWN, strict=True):
        wanted = scene.at_moments([SourceMoment(float(frame), 1 / len(frames)) for frame in frames])
        assert len(page.frame(place)["means"]) == int((wanted.opacities > 1 / 255).sum())
    run_player(opened, PlayerJob(tmp_path / "as.html", has_timing=False), ignore)
    as_captured = READER["Page"](tmp_path / "as.html")
    assert (as_captured.header["take"], as_captured.n_frames) == (None, 6)


def test_the_user_is_told(edited: Edited, tmp_path: Path) -> None:
    opened = edited(*TAKE)
    assert included_lines(opened, job(opened, tmp_path)) == [
        f"The take is edited in time: 3 segments, 12 frames, {12 / opened.capture.fps:.2f} s"
    ]
    assert included_lines(opened, job(opened, tmp_path, has_timing=False)) == []
    assert included_lines(edited(), job(opened, tmp_path)) == []


class Ramp:
    """Sound that says at which second of the recording it is."""

    def __init__(self, path: Path, start_s: float, *, rate: int) -> None:
        self.seconds = start_s + np.arange(10 * rate) / rate
        self.n_read = 0

    def __enter__(self) -> Ramp:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def read(self, n_samples: int) -> np.ndarray:
        found = self.seconds[self.n_read : self.n_read + n_samples]
        self.n_read += n_samples
        return np.stack([found, found], axis=1).astype(np.float32)


def test_sound_plays_as_the_take_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.export.video.timed_sound.SoundReader", Ramp)
    rate, fps, n_frames = 4800, 10.0, 100
    take = (
        Segment(30, 50, 2.0, 2.0),
        Segment(2, 3, n_frozen=4),
        Segment(0, 8, is_reversed=True),
        Segment(4, 8, repeats=2, crossfade_frames=2),
    )
    timing = TakeTiming(take, n_frames)
    n_samples = round(timing.n_output * rate / fps)
    with TimedSound(Path("s.mp4"), 0.5, timing, fps, 0, rate=rate) as sound:
        found = np.concatenate([sound.read(n_samples // 14) for _ in range(15)])
    assert found.shape[1] == 2
    for output, frame in ((0.0, 30.0), (0.5, 31.0), (9.2, 48.4), (14.0, 7.0), (17.5, 3.5), (22.5, 4.5), (26.5, 6.5)):
        at = round(output * rate / fps)
        assert found[at] == pytest.approx([0.5 + frame / fps] * 2, abs=1e-5), output
    is_frozen = slice(round(10.1 * rate / fps), round(13.9 * rate / fps))
    assert np.abs(found[is_frozen]).max() == 0.0
    fading = timing.source_at(25.0)
    mixed = 0.5 + sum(one.weight * one.frame for one in fading) / fps  # the last frame of the loop begins
    assert len(fading) == 2
    assert found[round(25.0 * rate / fps), 0] == pytest.approx(mixed, abs=1e-5)


def test_between_clips_things_travel_to_the_moment_from_both_sides(
    edited: Edited, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At one unit a frame, half way between two clips, things are half a unit from where their frames have them."""
    load = TrainedProject.load

    def moving(opened: TrainedProject, clip_index: int) -> TrainedClip:
        trained = load(opened, clip_index)
        for role in trained.model.roles():
            anchors = trained.model.anchor_set(role)
            if anchors.is_dynamic and not anchors.travels:
                anchors.travels = True
                anchors.register_buffer("birth_frames", torch.zeros(len(anchors)))
                anchors.velocities = torch.nn.Parameter(torch.tensor([[1.0, 0.0, 0.0]]).repeat(len(anchors), 1))
                anchors.accelerations = torch.nn.Parameter(torch.zeros(len(anchors), 3))
        return trained

    monkeypatch.setattr(TrainedProject, "load", moving)
    scene = SceneFrames(edited())
    for share, frame, ahead in zip(scene.shares(2.5), (2, 3), (0.5, -0.5), strict=True):
        (still,) = scene.shares(frame)
        away = (share.gaussians.means - still.gaussians.means)[:, 0]
        assert share.weight == 0.5
        assert float(away[away.abs() > 1e-3].median()) == pytest.approx(ahead, abs=0.01)
