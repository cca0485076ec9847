"""An edit is visible in every frame of its scope and in none outside: in the window, in renders and in every export.

Over all actions, with a scope that begins in the middle of one clip and ends in the middle of the next one. A small
real training is used, in which things move.
"""

from __future__ import annotations

import runpy
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from app.document.history import DocumentHistory
from app.evaluation.headless import TrainedProject, open_trained
from app.export.export_progress import ExportProgress
from app.export.gaussians.gaussians_job import GaussiansJob
from app.export.gaussians.gaussians_job import run as export_gaussians
from app.export.jobs.video import VideoJob
from app.export.picked_frames import PickedFrames
from app.export.player_job import PlayerJob
from app.export.player_job import run as export_player
from app.export.scene_frames import SceneFrames
from app.export.video.render import render_video
from app.playback.frame_decoder import ShownFrame
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.project.opening.opened_project import opened_project
from app.project.opening.project_access import open_project
from app.training.service import ShownState
from engine.editing.actions import Action, Delete, Expose, Hide, Hold, Recolor, Smooth, Transform
from engine.editing.edit import Edit, Everything, KeyedVolume, Picked, PickedRows, Scope, Sphere, Target, VolumeKey
from engine.editing.effects import EditStack
from engine.editing.picks import pack_rows
from engine.editing.scene_object import ObjectInClip, ObjectSeed, SceneObject
from engine.editing.volumes.keyed_volume import volume_at
from engine.errors import ProjectError
from engine.export.formats.table import FORMATS
from tests.app.stored_project import copy_stored

FRAMES, SCOPE = range(6), Scope(2, 5)
READER = runpy.run_path(str(Path(__file__).parents[3] / "docs" / "examples" / "read_player.py"))
MIDDLE: Target = Sphere((0.0, 0.0, 0.5), 1.0)
WAIT_S = 300.0
ACTIONS: dict[str, tuple[Target, Action]] = {
    "hide": (MIDDLE, Hide()),
    "delete": (MIDDLE, Delete()),
    "transform": (MIDDLE, Transform((0.2, 0.0, 0.3), scale=1.2)),
    "recolor": (MIDDLE, Recolor((1.0, 0.0, 0.0), 0.8)),
    "expose": (Everything(), Expose(1.0)),
    "hold": (Everything(), Hold(0)),
    "smooth": (Everything(), Smooth(2.0)),
}


def ignore(progress: ExportProgress) -> None:
    """Nobody looks."""


def edit_of(name: str) -> Edit:
    target, action = ACTIONS[name]
    return Edit(1, name, target, action, SCOPE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copy_stored(tmp_path_factory.mktemp("edited") / "p")


@pytest.fixture(scope="module")
def opened(folder: Path) -> TrainedProject:
    return open_trained(open_project(folder, is_writable=False))


def give(opened: TrainedProject, *edits: Edit) -> None:
    project = opened.project
    project.history = DocumentHistory(replace(project.document, edits=edits))


def in_scope(differs: list[bool], name: str = "") -> bool:
    """name: Of the action; what is held looks the same at the very frame at which it is held."""
    same = {3} if name == "hold" else set()  # the frame of the second clip that is next to the held one
    return differs == [SCOPE.holds_at(frame) and frame not in same for frame in FRAMES]


# ---------------------------------------------------------------- the window


@pytest.fixture
def playback(opened: TrainedProject) -> Iterator[Playback]:
    project = opened.project
    states = [ShownState(project.clip_path(index), f"finished-{index}") for index in range(2)]
    found = Playback(lambda clip_index: states[clip_index] if clip_index < 2 else None)
    found.show(opened_project(opened.capture, project, 1))
    yield found
    found.close()


def shown(playback: Playback, timeline: Timeline, frame: int) -> ShownFrame:
    timeline.seek(frame)
    until_s = time.monotonic() + WAIT_S
    while time.monotonic() < until_s:
        found = playback.frame(timeline)
        wanted = playback.request(timeline.clip_of(frame), frame)  # type: ignore[arg-type]
        if found is not None and wanted is not None and found.gaussians.key == wanted.key:
            return found
        assert playback.take_failures() == []
        time.sleep(0.005)
    raise AssertionError("the frame did not come")


def is_other(one: ShownFrame, other: ShownFrame) -> bool:
    names = ("means", "quats", "scales", "opacities", "colors")
    pairs = [(getattr(one.gaussians, name), getattr(other.gaussians, name)) for name in names]
    return any(mine.shape != theirs.shape or not np.array_equal(mine, theirs) for mine, theirs in pairs)


@pytest.mark.parametrize("name", ACTIONS)
def test_the_window_shows_it_in_its_frames_alone(name: str, opened: TrainedProject, playback: Playback) -> None:
    timeline = Timeline(opened.clips)
    give(opened)
    before = [shown(playback, timeline, frame) for frame in FRAMES]
    give(opened, edit_of(name))
    after = [shown(playback, timeline, frame) for frame in FRAMES]
    assert in_scope([is_other(one, other) for one, other in zip(before, after, strict=True)], name)
    kept = [one.gaussians is other.gaussians for one, other in zip(before, after, strict=True)]
    assert kept == [not SCOPE.holds_at(frame) for frame in FRAMES], "only its own frames are decoded again"
    for one in after:
        rows, births = one.gaussians.rows, one.gaussians.births
        assert rows is not None
        assert births is not None
        assert len(rows) == len(births) == len(one.gaussians)
    give(opened)  # taken back
    assert [shown(playback, timeline, frame).gaussians for frame in FRAMES] == [one.gaussians for one in before]


def test_a_volume_with_keys_is_in_its_place_in_each_frame_and_between_frames(
    opened: TrainedProject, playback: Playback
) -> None:
    keys = tuple(VolumeKey(frame, Sphere((x, 0.0, 0.5), 0.7)) for frame, x in ((1.0, -0.6), (4.0, 0.6)))
    keyed = Edit(1, "", KeyedVolume(keys), Delete())
    give(opened, keyed)
    timeline, scene = Timeline(opened.clips), SceneFrames(opened)
    for moment in (*map(float, FRAMES), 2.25, 2.5, 3.75):
        resting = Edit(1, "", volume_at(keyed.target, moment), Delete())  # type: ignore[arg-type]
        truth = SceneFrames(opened, edits=EditStack((resting,))).gaussians(moment).means.numpy()
        np.testing.assert_array_equal(scene.gaussians(moment).means.numpy(), truth)
        if moment in FRAMES:
            np.testing.assert_array_equal(shown(playback, timeline, int(moment)).gaussians.means, truth)
    trained = SceneFrames(opened, edits=EditStack()).gaussians(2.0)
    assert 0 < len(scene.gaussians(2.0)) < len(trained)
    give(opened)


def test_anchors_without_gaussians_are_not_shown(opened: TrainedProject, playback: Playback) -> None:
    timeline = Timeline(opened.clips)
    give(opened)
    plain = shown(playback, timeline, 3).anchors
    give(opened, edit_of("delete"))
    left = shown(playback, timeline, 3)
    n_plain = len(plain.inherited_positions) + len(plain.own_positions)
    n_left = len(left.anchors.inherited_positions) + len(left.anchors.own_positions)
    assert 0 < n_left < n_plain
    assert left.anchors.inherited_roles is not None
    assert len(left.anchors.inherited_roles) == len(left.anchors.inherited_positions)
    give(opened, Edit(1, "", Everything(), Delete()))
    none = shown(playback, timeline, 3).anchors
    assert len(none.inherited_positions) == len(none.own_positions) == 0


def test_what_was_picked_in_one_clip_is_the_same_in_the_next(opened: TrainedProject, playback: Playback) -> None:
    timeline = Timeline(opened.clips)
    give(opened)
    rows = shown(playback, timeline, 0).gaussians.rows
    assert rows is not None
    place = next(place for place, row_set in enumerate(rows.sets) if row_set.role == "static")
    numbers, row_set = rows.number[rows.set_index == place][:40], rows.sets[place]
    picked = Picked((PickedRows(row_set.clip_index, row_set.origin, row_set.role, pack_rows(numbers)),))
    give(opened, Edit(1, "", picked, Delete()))
    for frame in (0, 4):
        found = shown(playback, timeline, frame).gaussians.rows
        assert found is not None
        assert found.sets[place] == row_set
        is_static = found.set_index == place
        assert is_static.any()
        assert not np.isin(found.number[is_static], numbers).any()


# ---------------------------------------------------------------- exports


def exported(opened: TrainedProject, out: Path, format_name: str, *, part: str = "all", has_edits: bool = True) -> Path:
    job = GaussiansJob(out, format_name, range(6), part=part, has_edits=has_edits)  # type: ignore[arg-type]
    export_gaussians(opened, job, ignore)
    return out


def contents(folder: Path) -> list[bytes]:
    return [path.read_bytes() for path in sorted(folder.iterdir()) if path.suffix != ".json"]


@pytest.mark.parametrize("name", ACTIONS)
def test_files_of_gaussians_hold_it_in_its_frames_alone(name: str, opened: TrainedProject, tmp_path: Path) -> None:
    give(opened, edit_of(name))
    plain = contents(exported(opened, tmp_path / "plain", "ply", has_edits=False))
    edited = contents(exported(opened, tmp_path / "edited", "ply"))
    assert in_scope([one != other for one, other in zip(plain, edited, strict=True)], name)


@pytest.mark.parametrize("format_name", FORMATS)
def test_every_format_holds_it_in_its_frames_alone(format_name: str, opened: TrainedProject, tmp_path: Path) -> None:
    give(opened, edit_of("delete"))
    plain = contents(exported(opened, tmp_path / "plain", format_name, has_edits=False))
    edited = contents(exported(opened, tmp_path / "edited", format_name))
    assert in_scope([one != other for one, other in zip(plain, edited, strict=True)])
    smaller = [len(other) < len(one) for one, other in zip(plain, edited, strict=True)]
    assert in_scope(smaller)


@pytest.mark.parametrize("part", ["static", "split"])
def test_what_stands_still_is_written_again_where_an_edit_begins_or_ends(
    part: str, opened: TrainedProject, tmp_path: Path
) -> None:
    give(opened, edit_of("delete"))
    out = exported(opened, tmp_path / "out", "ply", part=part)
    static = sorted(path.name for path in out.glob("*static*"))
    assert static == [f"p_static_{frame:04d}.ply" for frame in (0, 2, 5)]
    first, during, after = ((out / name).stat().st_size for name in static)
    assert first == after > during


@pytest.mark.parametrize("name", ACTIONS)
def test_players_hold_it_in_its_frames_alone(name: str, opened: TrainedProject, tmp_path: Path) -> None:
    give(opened, edit_of(name))
    pages = []
    for has_edits in (False, True):
        out = tmp_path / f"scene{has_edits}.html"
        export_player(opened, PlayerJob(out, PickedFrames.of(range(6)), has_edits=has_edits), ignore)
        pages.append(READER["Page"](out))
    plain, edited = pages
    assert plain.n_frames == edited.n_frames == 6

    def differs(frame: int) -> bool:
        one, other = (
            np.concatenate([found["means"], found["opacities"][:, None], found["colors"]], axis=1)
            for found in (plain.frame(frame), edited.frame(frame))
        )
        if len(one) != len(other):
            return True
        apart = np.abs(one[:, None] - other).max(2)  # the heaviest come first in a page, so rows may have moved
        return max(apart.min(0).max(initial=0.0), apart.min(1).max(initial=0.0)) > 0.02

    assert in_scope([differs(frame) for frame in FRAMES], name)


@pytest.mark.parametrize("name", ACTIONS)
def test_renders_show_it_in_its_frames_alone(name: str, opened: TrainedProject, tmp_path: Path) -> None:
    give(opened, edit_of(name))
    pictures = []
    for has_edits in (False, True):
        out = tmp_path / f"pictures{has_edits}"
        camera = opened.capture.rig.names[2]
        render_video(
            VideoJob(out, "png", camera=camera, frames=PickedFrames.of(range(0, 6)), has_edits=has_edits), opened
        )
        pictures.append(contents(out))
    assert in_scope([one != other for one, other in zip(*pictures, strict=True)], name)


@pytest.mark.parametrize("format_name", ["mp4", "webm"])
def test_videos_show_it_in_its_frames_alone(format_name: str, opened: TrainedProject, tmp_path: Path) -> None:
    give(opened, Edit(1, "", Everything(), Delete(), SCOPE))
    out = tmp_path / f"film.{format_name}"
    render_video(
        VideoJob(out, format_name, camera=opened.capture.rig.names[2], frames=PickedFrames.of(range(0, 6))), opened
    )
    with av.open(str(out)) as container:
        brightness = [float(frame.to_ndarray(format="gray").mean()) for frame in container.decode(video=0)]
    assert in_scope([value < 20.0 for value in brightness])


def test_an_object_is_written_alone_whatever_edits_there_are(opened: TrainedProject, tmp_path: Path) -> None:
    """It exists in frames 1 to 3; before and after there is nothing."""
    header = opened.header(0)
    rows = PickedRows(0, header.origin, "static", pack_rows(np.arange(5)))
    clips = tuple(ObjectInClip(start, start + 3, (rows,), ((start, start + 3),)) for start in (0, 3))
    one = SceneObject(1, "ball", seeds=(ObjectSeed(0, (rows,)),), clips=clips, first=1, stop=4)
    project = opened.project
    project.history = DocumentHistory(replace(project.document, objects=(one,), edits=()))
    job = GaussiansJob(tmp_path / "alone", "ply", range(6), object="BALL")  # type: ignore[arg-type]
    export_gaussians(opened, job, ignore)
    sizes = [len(data) for data in contents(tmp_path / "alone")]
    assert sizes[1] == sizes[2] == sizes[3] > sizes[0] == sizes[4] == sizes[5]
    render_video(VideoJob(tmp_path / "film", "png", camera=opened.capture.rig.names[2], object="ball"), opened)
    there = [np.asarray(Image.open(path)).any() for path in sorted((tmp_path / "film").glob("*.png"))]
    assert there == [False, True, True, True, False, False]
    export_player(opened, PlayerJob(tmp_path / "ball.html", PickedFrames.of(range(6)), object="ball"), ignore)
    page = READER["Page"](tmp_path / "ball.html")
    assert [len(page.frame(frame)["means"]) > 0 for frame in range(6)] == there
    with pytest.raises(ProjectError) as caught:
        export_player(opened, PlayerJob(tmp_path / "cat.html", object="cat"), ignore)
    assert "There is no object called 'cat'" in str(caught.value)
    project.history = DocumentHistory(replace(project.document, objects=()))


def test_a_moment_between_two_frames_belongs_to_the_one_before(opened: TrainedProject, tmp_path: Path) -> None:
    """At the seam between two clips, too, where the pictures of both are mixed."""
    give(opened, Edit(1, "", Everything(), Delete(), Scope(2, 3)))
    job = VideoJob(
        tmp_path / "slow", "png", camera=opened.capture.rig.names[2], frames=PickedFrames.of(range(0, 6)), speed=0.5
    )
    render_video(job, opened)
    sizes = [len(data) for data in contents(tmp_path / "slow")]
    assert [size < 0.2 * max(sizes) for size in sizes] == [number in (4, 5) for number in range(len(sizes))]
