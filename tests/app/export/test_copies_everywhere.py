"""A copy of an object is there in its frames: in the window, in renders and in every export. A small real training."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from msgspec import structs

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
from app.playback.modes.view_modes import PLAIN, ShownAs
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.project.opening.opened_project import opened_project
from app.project.opening.project_access import open_project
from app.session.duplicating.placing import place_of
from app.session.editing.selection import NOTHING_SELECTED
from app.training.service import ShownState
from engine.editing.actions import Hide, Transform
from engine.editing.changed_gaussians import transformed
from engine.editing.copies.object_copy import ObjectCopy, nearest_frame
from engine.editing.edit import Edit, ObjectTarget, PickedRows
from engine.editing.effects import EditStack
from engine.editing.gaussian_rows import COPIED, GaussianRows
from engine.editing.picks import pack_rows
from engine.editing.scene_object import ObjectInClip, SceneObject
from tests.app.export.test_edits_everywhere import READER
from tests.app.stored_project import copy_stored

FRAMES, WAIT_S = range(6), 300.0
PUSH = Transform((0.4, 0.0, 0.2), scale=1.1)
LATER = ObjectCopy(1, "later", 1, PUSH, shift_frames=2.0, first=1, stop=5)


def ignore(progress: ExportProgress) -> None:
    """Nobody looks."""


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> TrainedProject:
    folder = copy_stored(tmp_path_factory.mktemp("copied") / "p")
    return open_trained(open_project(folder, is_writable=False))


@pytest.fixture(scope="module")
def one(opened: TrainedProject) -> SceneObject:
    """Half of what moves in each clip."""
    scene, clips = SceneFrames(opened, edits=EditStack()), []
    for clip in opened.clips[:2]:
        rows = scene._edited(clip.start, 0.0, scene.effects(clip.start), "moving").rows
        sets = []
        for place, row_set in enumerate(rows.sets):
            numbers = rows.number[rows.set_index == place]
            if len(numbers):
                packed = pack_rows(np.arange(0, int(numbers.max()) + 1, 2))
                sets.append(PickedRows(row_set.clip_index, row_set.origin, row_set.role, packed))
        clips.append(ObjectInClip(clip.start, clip.stop, tuple(sets)))
    return SceneObject(1, "one", clips=tuple(clips))


def give(opened: TrainedProject, one: SceneObject, *copies: ObjectCopy, edits: tuple[Edit, ...] = ()) -> None:
    project = opened.project
    document = replace(project.document, edits=edits, objects=(one,), copies=copies)
    project.history = DocumentHistory(document)


def assert_ends_with(found: list[np.ndarray], plain: list[np.ndarray], added: list[np.ndarray]) -> None:
    for all_of_it, before, after in zip(found, plain, added, strict=True):
        np.testing.assert_array_equal(all_of_it[: len(before)], before)
        np.testing.assert_allclose(all_of_it[len(before) :], after, rtol=1e-6, atol=1e-6)


def brute(opened: TrainedProject, one: SceneObject, copy: ObjectCopy, frame: int) -> list[np.ndarray]:
    """The copy at a frame: the clip of the other moment decoded, all but the object left out, the rest moved."""
    moment = copy.source_frame(frame, (0, 6))
    assert moment is not None
    alone = (Edit(1, "", ObjectTarget(1), Hide(), is_inverted=True),)
    scene, at = SceneFrames(opened, edits=EditStack(alone, (one,))), nearest_frame(moment)
    found = scene._edited(
        moment, scene.clip_time(moment), scene.effects(moment), "all", alive_at=scene.clip_time(at)
    ).gaussians
    everything = torch.ones(len(found), dtype=torch.bool)
    return [tensor.numpy() for tensor in transformed(found, everything, copy.transform).tensors()]


# ---------------------------------------------------------------- exports


@pytest.mark.parametrize("shift", [2.0, -3.0, 0.5])
def test_frames_for_exports_have_it(opened: TrainedProject, one: SceneObject, shift: float) -> None:
    copy = structs.replace(LATER, shift_frames=shift)
    give(opened, one, copy)
    scene, plain = SceneFrames(opened), SceneFrames(opened, edits=EditStack())
    for frame in FRAMES:
        found, before = ([t.numpy() for t in frames.gaussians(frame).tensors()] for frames in (scene, plain))
        added = brute(opened, one, copy, frame) if copy.holds_at(frame) else [array[:0] for array in before]
        assert_ends_with(found, before, added)
        assert torch.equal(scene.gaussians(frame, "static").means, plain.gaussians(frame, "static").means)
        assert len(scene.gaussians(frame, "moving")) == len(plain.gaussians(frame, "moving")) + len(added[0])


def test_only_a_few_clips_are_loaded_and_none_twice_in_turn(
    opened: TrainedProject, one: SceneObject, monkeypatch: pytest.MonkeyPatch
) -> None:
    give(opened, one, structs.replace(LATER, first=0, stop=None, shift_frames=-3.0))
    loads: list[int] = []
    load = TrainedProject.load

    def noting(self: TrainedProject, clip_index: int):
        loads.append(clip_index)
        return load(self, clip_index)

    monkeypatch.setattr(TrainedProject, "load", noting)
    scene = SceneFrames(opened)
    for frame in (0, 1, 2, 3, 4, 5):
        scene.gaussians(frame)
    assert loads == [0, 1]


def test_between_two_clips_what_is_replaced_does_not_flash_up(opened: TrainedProject, one: SceneObject) -> None:
    give(opened, one, ObjectCopy(1, "in place", 1, is_in_place=True))
    scene, plain = SceneFrames(opened), SceneFrames(opened, edits=EditStack())
    for frame in (2.25, 2.5, 2.75, 3.0):
        assert len(scene.gaussians(frame)) == len(plain.gaussians(frame))
        shares = zip(scene.shares(frame), plain.shares(frame), strict=True)
        n_copied = len(scene.copied(frame) or ())
        for share, other in shares:
            is_hidden = len(other.gaussians) - (len(share.gaussians) - n_copied)
            assert is_hidden > 0


def test_players_and_files_and_pictures_have_it(opened: TrainedProject, one: SceneObject, tmp_path: Path) -> None:
    give(opened, one, LATER)
    differs: dict[str, list[bool]] = {}
    pages, files, pictures = [], [], []
    for has_edits in (False, True):
        page, folder, shown = (tmp_path / f"{name}{has_edits}" for name in ("page.html", "ply", "png"))
        page = page.with_name(f"page{has_edits}.html")
        export_player(opened, PlayerJob(page, PickedFrames.of(FRAMES), has_edits=has_edits), ignore)
        pages.append(READER["Page"](page))
        export_gaussians(opened, GaussiansJob(folder, "ply", FRAMES, has_edits=has_edits), ignore)  # type: ignore[arg-type]
        files.append([path.stat().st_size for path in sorted(folder.glob("*.ply"))])
        camera = opened.capture.rig.names[2]
        render_video(VideoJob(shown, "png", camera=camera, frames=PickedFrames.of(FRAMES), has_edits=has_edits), opened)
        pictures.append([path.read_bytes() for path in sorted(shown.glob("*.png"))])
    differs["player"] = [len(pages[0].frame(f)["means"]) < len(pages[1].frame(f)["means"]) for f in FRAMES]
    differs["files"] = [one_size < other for one_size, other in zip(*files, strict=True)]
    differs["pictures"] = [before != after for before, after in zip(*pictures, strict=True)]
    assert list(differs.values()) == [[LATER.holds_at(frame) for frame in FRAMES]] * 3, list(differs)


# ---------------------------------------------------------------- the window


@pytest.fixture
def states(opened: TrainedProject) -> list[ShownState]:
    return [ShownState(opened.project.clip_path(index), f"finished-{index}") for index in range(2)]


@pytest.fixture
def playback(opened: TrainedProject, states: list[ShownState]) -> Iterator[Playback]:
    found = Playback(lambda clip_index: states[clip_index] if clip_index < 2 else None)
    found.show(opened_project(opened.capture, opened.project, 1))
    yield found
    found.close()


def shown(playback: Playback, timeline: Timeline, frame: int, shown_as: ShownAs = PLAIN) -> ShownFrame:
    timeline.seek(frame)
    clip = timeline.clip_of(frame)
    assert clip is not None
    until_s = time.monotonic() + WAIT_S
    while time.monotonic() < until_s:
        wanted = playback.request(clip, frame, shown_as)
        assert wanted is not None
        playback.frame(timeline, shown_as)
        found = playback.decoder.known(wanted.key)
        if found is not None:
            return found
        assert playback.take_failures() == []
        time.sleep(0.005)
    raise AssertionError("the frame did not come")


def columns(found: ShownFrame) -> list[np.ndarray]:
    return [getattr(found.gaussians, name) for name in ("means", "quats", "scales", "opacities", "colors")]


def test_the_window_shows_it_as_exports_do(opened: TrainedProject, one: SceneObject, playback: Playback) -> None:
    timeline = Timeline(opened.clips)
    give(opened, one)
    before = [shown(playback, timeline, frame) for frame in FRAMES]
    give(opened, one, LATER)
    scene = SceneFrames(opened)
    for frame, plain in zip(FRAMES, before, strict=True):
        found = shown(playback, timeline, frame)
        for mine, theirs in zip(columns(found), scene.gaussians(frame).tensors(), strict=True):
            np.testing.assert_array_equal(mine, theirs.numpy())
        assert (found.gaussians is plain.gaussians) == (not LATER.holds_at(frame)), "only its frames are decoded again"
        assert found.gaussians.n_still == plain.gaussians.n_still
        assert found.gaussians.still_key == plain.gaussians.still_key
    give(opened, one)
    assert [shown(playback, timeline, frame).gaussians for frame in FRAMES] == [one.gaussians for one in before]


def test_a_copy_is_not_for_selecting(opened: TrainedProject, one: SceneObject, playback: Playback) -> None:
    timeline = Timeline(opened.clips)
    give(opened, one, LATER)
    gaussians = shown(playback, timeline, 3).gaussians
    rows, births = gaussians.rows, gaussians.births
    assert rows is not None
    assert births is not None
    assert len(rows) == len(births) == len(gaussians)
    is_copy = rows.set_index == rows.sets.index(COPIED)
    assert is_copy.any()
    everything = NOTHING_SELECTED.with_mask(rows, np.ones(len(rows), bool), keeps_others=False)
    np.testing.assert_array_equal(everything.mask(rows), ~is_copy)
    assert COPIED not in dict(everything.parts)
    changes = shown(playback, timeline, 3, ShownAs("changed")).gaussians.changes
    assert changes is not None
    assert np.isnan(changes[is_copy]).all()


@pytest.mark.parametrize(("content", "has_copies"), [("static", False), ("dynamic", True), ("f_s", True)])
def test_copies_belong_to_what_moves(
    opened: TrainedProject, one: SceneObject, playback: Playback, content: str, has_copies: bool
) -> None:
    give(opened, one, LATER)
    rows = shown(playback, Timeline(opened.clips), 3, ShownAs("color", content)).gaussians.rows
    assert isinstance(rows, GaussianRows)
    assert (COPIED in rows.sets) == has_copies


def test_keys_know_the_copies_and_the_clips_they_come_from(
    opened: TrainedProject, one: SceneObject, playback: Playback, states: list[ShownState]
) -> None:
    def key(frame: int) -> object:
        request = playback.request(opened.clips[frame // 3], frame)
        assert request is not None
        return request.key

    give(opened, one)
    plain = [key(frame) for frame in FRAMES]
    give(opened, one, LATER)
    copied = [key(frame) for frame in FRAMES]
    assert [a != b for a, b in zip(plain, copied, strict=True)] == [LATER.holds_at(frame) for frame in FRAMES]
    give(opened, one, structs.replace(LATER, shift_frames=1.0))
    assert [a != b for a, b in zip(copied, map(key, FRAMES), strict=True)][2:5] == [True] * 3
    give(opened, one, LATER)
    states[0] = replace(states[0], revision="trained again")
    # frame 4 shows the object of frame 2, which the first clip has
    assert [a != b for a, b in zip(copied, map(key, FRAMES), strict=True)] == [True, True, True, True, True, False]
    assert copied[5][-4:] == key(5)[-4:]  # type: ignore[index]


def test_a_new_copy_stands_next_to_its_object(opened: TrainedProject, one: SceneObject, playback: Playback) -> None:
    give(opened, one)
    gaussians = shown(playback, Timeline(opened.clips), 1).gaussians
    view, up = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]), np.array([0.0, 0.0, 1.0])
    place = place_of(gaussians, one, 1.0, view, up)
    assert place is not None
    np.testing.assert_allclose(place.axes, [[0, 1, 0], [-1, 0, 0]], atol=1e-12)
    assert (place.widths > 0).all()
    assert place_of(gaussians, SceneObject(2, "nowhere"), 1.0, view, up) is None
    assert place_of(None, one, 1.0, view, up) is None
    above = place_of(gaussians, one, 1.0, np.array([[1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]]), up)
    assert above is not None
    np.testing.assert_allclose(above.axes, [[1, 0, 0], [0, 1, 0]], atol=1e-12)


def test_the_cache_shown_on_the_timeline_follows(opened: TrainedProject, one: SceneObject, playback: Playback) -> None:
    timeline = Timeline(opened.clips)
    give(opened, one, LATER)
    for frame in FRAMES:
        shown(playback, timeline, frame)
    assert playback.cached_frames() == [(0, 6)]
    give(opened, one, structs.replace(LATER, first=2, stop=3))
    assert playback.cached_frames() == [(0, 1), (2, 3), (5, 6)]
