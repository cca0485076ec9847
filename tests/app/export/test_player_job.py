"""The job that writes a player: what it says before, what it leaves behind, and where the page looks from."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.evaluation.headless import TrainedProject
from app.export import player_job
from app.export.export_progress import ExportProgress
from app.export.picked_frames import PickedFrames, picked_frames
from app.export.player_job import PlayerJob, estimate, run
from app.export.player_scene import scene_header
from app.export.scene_frames import SceneFrames
from app.playback.views.orbit_view import OrbitView
from engine.children.kind import Unwanted
from engine.conventions import ALPHA_MIN
from engine.errors import EngineError, ProjectError

READER = runpy.run_path(str(Path(__file__).parents[3] / "docs" / "examples" / "read_player.py"))


def ignore(progress: ExportProgress) -> None:
    """Nobody looks."""


def header_of(page: Path) -> dict[str, Any]:
    found = re.search(r'id="header">([^<]*)<', page.read_text(encoding="utf-8"))
    assert found is not None
    return json.loads(found[1])


def test_frames_are_those_of_the_scene(opened: TrainedProject, tmp_path: Path):
    out = tmp_path / "out" / "scene.html"
    told: list[ExportProgress] = []
    result = run(opened, PlayerJob(out, PickedFrames.of(range(1, 6))), told.append)
    assert (result.path, result.n_files, result.n_bytes) == (out, 1, out.stat().st_size)
    assert [entry.name for entry in out.parent.iterdir()] == ["scene.html"]
    assert re.search(r'<img id="poster" alt="[^"]+" src="data:image/jpeg;base64,/9j/', out.read_text(encoding="utf-8"))
    assert result.lines[0].startswith('To embed it: <iframe src="scene.html#autoplay" title="')
    assert 'allow="fullscreen; xr-spatial-tracking"' in result.lines[0]
    assert (told[-1].n_done, told[-1].n_all) == (5, 5)
    page, scene = READER["Page"](out), SceneFrames(opened)
    assert page.n_frames == 5
    for number, frame in enumerate(range(1, 6)):
        found, wanted = page.frame(number), scene.gaussians(frame)
        is_seen = (wanted.opacities > ALPHA_MIN).numpy()
        assert len(found["means"]) == is_seen.sum()
        step = 0.02 * np.median(wanted.scales.numpy().max(1)) * 3
        rows = np.concatenate([found["means"] / step, found["colors"] * (255 / 2)], axis=1)
        others = np.concatenate([wanted.means.numpy() / step, wanted.colors.numpy() * (255 / 2)], axis=1)[is_seen]
        apart = np.abs(rows[:, None] - others).max(2)  # the heaviest come first in the page
        assert apart.min(0).max() < 1
        assert apart.min(1).max() < 1


def test_clips_say_where_they_lie_in_the_capture(opened: TrainedProject, tmp_path: Path):
    out = tmp_path / "scene.html"
    run(opened, PlayerJob(out, PickedFrames.of(range(1, 6, 2))), ignore)
    header = header_of(out)
    assert header["step"] == 2
    assert [(clip["clip_index"], clip["first"], clip["frame_index"]) for clip in header["clips"]] == [
        (0, 0, 1),
        (1, 1, 3),
    ]
    assert header["fps"] == opened.capture.fps
    run(opened, PlayerJob(tmp_path / "gap.html", picked_frames([(0, 1), (2, 5)], 1)), ignore)
    places = [
        (clip["clip_index"], clip["first"], clip["frame_index"]) for clip in header_of(tmp_path / "gap.html")["clips"]
    ]
    assert places == [(0, 0, 0), (0, 1, 2), (1, 2, 3)]
    assert [camera["name"] for camera in header["cameras"]] == list(opened.capture.rig.names)


def test_all_trained_frames_are_taken_where_none_are_named(opened: TrainedProject, tmp_path: Path):
    opened.project.clip_path(1).unlink()
    run(opened, PlayerJob(tmp_path / "scene.html"), ignore)
    assert [clip["moving"]["n"].__len__() for clip in header_of(tmp_path / "scene.html")["clips"]] == [3]


def test_the_size_is_told_beforehand(opened: TrainedProject, tmp_path: Path):
    for has_folder in (False, True):
        job = PlayerJob(tmp_path / f"scene{has_folder}.html", has_folder=has_folder)
        expected = estimate(opened, job)
        assert list(tmp_path.glob("*.html")) == ([] if not has_folder else [tmp_path / "sceneFalse.html"])
        result = run(opened, job, ignore)
        assert result.n_bytes == pytest.approx(expected.n_bytes, rel=0.25)
        assert result.n_files == expected.n_files
        assert f"{expected.n_bytes / 1e6:.1f} MB" in expected.lines[0]


def test_the_size_is_told_without_reading_what_is_in_clips(
    opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    loaded: list[int] = []
    load = TrainedProject.load
    monkeypatch.setattr(TrainedProject, "load", lambda opened, clip: (loaded.append(clip), load(opened, clip))[1])
    for frames in (None, PickedFrames.of(range(2, 5))):
        estimate(opened, PlayerJob(tmp_path / "scene.html", frames))
    assert loaded == []
    run(opened, PlayerJob(tmp_path / "scene.html"), ignore)
    assert sorted(loaded) == [0, 0, 1, 1]  # once to see whether they can be read, before anything is written


def test_damaged_clips_are_named_before_any_work(opened: TrainedProject, tmp_path: Path):
    path = opened.project.clip_path(1)
    data = bytearray(path.read_bytes())
    data[-20] ^= 255
    path.write_bytes(data)
    told: list[ExportProgress] = []
    with pytest.raises(ProjectError, match="damaged"):
        run(opened, PlayerJob(tmp_path / "scene.html"), told.append)
    assert [progress.n_all for progress in told] == [0]


def test_a_large_scene_gets_a_folder_unless_one_file_is_asked_for(
    opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(player_job, "LARGEST_PAGE_BYTES", 1000)
    out = tmp_path / "scene.html"
    result = run(opened, PlayerJob(out), ignore)
    assert result.n_files == 7
    assert sorted(file.name for file in (tmp_path / "scene_data").iterdir()) == [
        f"{name}.{kind}" for name in ("clip00000", "clip00001", "shared") for kind in ("bin", "js")
    ]
    assert READER["Page"](out).frame(4)["means"].shape[1] == 3
    with pytest.raises(
        ProjectError, match="folder scene_data next to the page, but this name is already taken"
    ) as error:
        run(opened, PlayerJob(out), ignore)  # the clips of one page are never mixed with another's
    assert "Delete scene_data, or choose another name" in str(error.value.hint)
    assert run(opened, PlayerJob(out, has_folder=False), ignore).n_files == 1


@pytest.mark.parametrize("has_folder", [False, True])
def test_a_cancelled_job_leaves_nothing(opened: TrainedProject, tmp_path: Path, has_folder: bool):
    def cancel(progress: ExportProgress) -> None:
        if progress.n_done >= 3:
            raise Unwanted

    folder = tmp_path / "out"
    folder.mkdir()
    with pytest.raises(Unwanted):
        run(opened, PlayerJob(folder / "scene.html", has_folder=has_folder), cancel)
    assert list(folder.iterdir()) == []


def test_clips_without_their_page_do_not_stay(opened: TrainedProject, tmp_path: Path):
    out = tmp_path / "out" / "scene.html"

    def take_the_name(progress: ExportProgress) -> None:
        if progress.n_done == 6:
            out.mkdir()

    with pytest.raises(EngineError):
        run(opened, PlayerJob(out, has_folder=True), take_the_name)
    assert list(out.parent.iterdir()) == [out]
    out.rmdir()
    assert run(opened, PlayerJob(out, has_folder=True), ignore).n_files == 7


def test_a_full_disk_leaves_nothing(opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    folder = tmp_path / "out"
    folder.mkdir()
    monkeypatch.setattr("engine.export.player.page.PageWriter.block", refuse)
    with pytest.raises(EngineError):
        run(opened, PlayerJob(folder / "scene.html", has_folder=True), ignore)
    assert list(folder.iterdir()) == []


def test_bad_targets_and_frames_are_named_before_any_work(opened: TrainedProject, tmp_path: Path):
    (tmp_path / "folder.html").mkdir()
    (tmp_path / "file").touch()
    for out, said in (
        (tmp_path / "scene.mp4", "HTML page"),
        (tmp_path / "folder.html", "folder"),
        (tmp_path / "file" / "scene.html", "is a file"),
        (opened.project.folder / "scene.html", "inside the project"),
    ):
        with pytest.raises(ProjectError, match=said):
            run(opened, PlayerJob(out), ignore)
    opened.project.clip_path(1).unlink()
    with pytest.raises(ProjectError, match="clip 1, which is not trained"):
        run(opened, PlayerJob(tmp_path / "scene.html", PickedFrames.of(range(6))), ignore)
    assert sorted(entry.name for entry in tmp_path.glob("*scene*")) == []


def test_the_page_looks_from_where_the_window_does(opened: TrainedProject):
    header, view = scene_header(SceneFrames(opened), 0, step=1), OrbitView(opened.capture.rig)
    assert np.allclose(np.reshape(header["home"]["world_to_camera"], (4, 4)), view.world_to_camera())
    assert header["home"]["distance"] == view.distance
    assert np.allclose(header["up"], view.up)
