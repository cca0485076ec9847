"""A scene of another program as a project: everything works on it that needs no pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.cli.cli import main
from app.evaluation.evaluation import evaluate_project
from app.evaluation.headless import open_trained
from app.export.scene_frames import SceneFrames
from app.importing import import_scene as importing
from app.importing.import_scene import import_scene
from app.project.opening.project_access import open_project
from app.project.projects_folder import projects_dir
from app.scripting import Box, Scope, Sphere
from app.scripting import open_project as open_script
from app.session.clips.clip_commands import SplitClip
from app.session.projects.project_commands import OpenCapture
from app.session.projects.settings import Settings
from app.session.session import Session
from app.session.training.train_commands import TrainClip
from engine.clip_files.clip_state import read_clip_state, write_clip_state
from engine.errors import CaptureError, ProjectError
from engine.export.formats.table import FORMATS
from engine.export.splats import Splats
from tests.app.conftest import poll_until
from tests.engine.importing.frames import moving_frames, values

N_FRAMES = 6


@pytest.fixture
def frames() -> list[Splats]:
    """Of the scene."""
    return moving_frames(N_FRAMES)


@pytest.fixture
def scene(tmp_path: Path, frames: list[Splats]) -> Path:
    """A folder with a file per frame."""
    folder = tmp_path / "dance"
    folder.mkdir()
    for number, splats in enumerate(frames):
        with (folder / f"{number}.ply").open("wb") as file:
            FORMATS["ply"].write(splats, file)
    return folder


def shown(project: Path, frame: float) -> Splats:
    return Splats.of(SceneFrames(open_trained(open_project(project, is_writable=False))).gaussians(frame))


def read_ply(path: Path) -> Splats:
    with path.open("rb") as file:
        return FORMATS["ply"].read(file)


def test_a_scene_comes_out_as_it_went_in(scene: Path, tmp_path: Path):
    done = import_scene(scene, tmp_path / "p", fps=25.0, up="+z", meters_per_unit=2.0)
    assert (done.n_frames, done.n_clips, done.notes) == (N_FRAMES, 1, ())
    opened = open_trained(open_project(done.folder, is_writable=False))
    assert (opened.capture.fps, opened.capture.n_frames) == (25.0, N_FRAMES)
    assert opened.project.document.world.meters_per_unit == 2.0
    np.testing.assert_allclose(opened.up, [0.0, 0.0, 1.0], atol=1e-9)
    with open_script(done.folder, read_only=True) as project:
        project.export(tmp_path / "out", format="ply", scale=1.0)
    for number in range(N_FRAMES):
        before, after = read_ply(scene / f"{number}.ply"), read_ply(tmp_path / "out" / f"p_{number:04d}.ply")
        order = [np.lexsort(splats.means.T) for splats in (before, after)]
        np.testing.assert_array_equal(after.means[order[1]], before.means[order[0]])
        np.testing.assert_allclose(values(after), values(before), atol=1e-6)


def test_views_see_the_contents(scene: Path, tmp_path: Path):
    opened = open_trained(open_project(import_scene(scene, tmp_path / "p").folder, is_writable=False))
    for camera in range(len(opened.rig)):
        picture = opened.load(0).picture(opened.rig.resized(np.full((8, 2), 64)), camera, 0.0)
        assert picture[24:40, 24:40].max() > 0.1  # in the middle
        assert picture[[0, -1]].mean() < 0.02  # and little beyond the border


def test_picked_gaussians_are_deleted_in_all_frames(scene: Path, frames: list[Splats], tmp_path: Path):
    folder = import_scene(scene, tmp_path / "p").folder
    x, y, z = frames[0].means[-1].tolist()
    with open_script(folder) as project:
        project.apply_edit("delete", project.select(volume=Sphere((x, y, z), 1e-4)))
        n = [len(shown(folder, frame)) for frame in range(N_FRAMES)]
        assert n == [59] * N_FRAMES  # it moves, and is the same in all of them
        project.apply_edit("hold", scope=Scope(0, N_FRAMES), frame_index=2)
        np.testing.assert_array_equal(values(shown(folder, 5)), values(shown(folder, 2)))


def test_deleted_gaussians_can_be_taken_out_for_good(scene: Path, tmp_path: Path):
    folder = import_scene(scene, tmp_path / "p").folder
    with open_script(folder) as project:
        project.apply_edit("delete", Box((2.0, 0.0, 0.0), (2.0, 9.0, 9.0), (1.0, 0.0, 0.0, 0.0)))
        edited = [values(shown(folder, frame)) for frame in range(N_FRAMES)]
        assert project.apply_permanently() == (0,)
    assert 0 < len(edited[0]) < 60
    for frame, before in enumerate(edited):
        np.testing.assert_array_equal(values(shown(folder, frame)), before)


@pytest.mark.parametrize("kind", ["4dgs", "tsog"])
def test_a_scene_in_which_everything_moves_becomes_a_file_over_time(tmp_path: Path, frames: list[Splats], kind: str):
    scene = tmp_path / "all"
    scene.mkdir()
    for number, splats in enumerate(frames[:3]):
        with (scene / f"{number}.ply").open("wb") as file:
            FORMATS["ply"].write(replace(splats, means=splats.means + np.float32(0.01 * number)), file)
    with open_script(import_scene(scene, tmp_path / "p").folder, read_only=True) as project:
        done = project.export(tmp_path / f"out.{kind}", format=kind)
    assert done.psnr_db is not None
    assert done.psnr_db > 40.0


@pytest.mark.parametrize("fps", [0.0, float("nan"), None])
def test_a_rate_that_no_camera_has_is_refused(scene: Path, tmp_path: Path, fps: float | None):
    (scene / "dance_export.json").write_text('{"fps": 99999, "up": [0, 0, 1], "files": [{"part": "all"}]}')
    with pytest.raises(ProjectError, match="frames per second is not between") as error:
        import_scene(scene, tmp_path / "p", fps=fps)
    assert error.value.path == scene
    assert sorted(tmp_path.iterdir()) == [scene]


def test_a_moment_between_frames_is_the_nearest_one(scene: Path, tmp_path: Path):
    folder = import_scene(scene, tmp_path / "p").folder
    np.testing.assert_array_equal(shown(folder, 1.4).means, shown(folder, 1).means)


def test_clips_are_cut_where_memory_ends(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(importing, "CLIP_BYTES", 4 * 60 * importing.GAUSSIAN_BYTES)
    done = import_scene(scene, tmp_path / "p")
    project = open_project(done.folder, is_writable=False)
    assert [(clip.start, clip.stop) for clip in project.clips(N_FRAMES)] == [(0, 4), (4, 6)]
    assert len(project.finished_clips()) == done.n_clips == 2
    assert len(shown(done.folder, 5)) == 60


def test_all_clips_have_the_near_plane_that_fits_the_views(
    scene: Path, frames: list[Splats], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for number in range(3):  # at first the scene is large and stands still
        with (scene / f"{number}.ply").open("wb") as file:
            FORMATS["ply"].write(replace(frames[0], means=5 * frames[0].means), file)
    monkeypatch.setattr(importing, "CLIP_BYTES", 3 * 60 * importing.GAUSSIAN_BYTES)
    opened = open_trained(open_project(import_scene(scene, tmp_path / "p").folder, is_writable=False))
    assert opened.trained == [0, 1]
    distance = np.linalg.norm(opened.rig.centers - opened.rig.focus_point(), axis=1).mean()
    for clip_index in opened.trained:
        assert opened.header(clip_index).near_plane == pytest.approx(importing.NEAR_SHARE * distance, rel=1e-4)


def test_what_needs_pictures_says_that_there_are_none(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder = import_scene(scene, tmp_path / "p").folder
    capture, sentence = folder / "scene" / "dance", "This scene was imported and has no pictures."
    for command in (
        ["train", str(capture), "--project", str(folder)],
        ["mend", str(folder), "--frames", "0:2"],
        ["clips", str(folder), "--split", "2"],
        ["synchronise", str(capture)],
        ["export", str(folder), "--format", "metrics-csv", "--out", str(tmp_path / "a.csv")],
        ["render", str(folder), "--camera", "view0", "--show", "compare", "--out", str(tmp_path / "a.mp4")],
    ):
        assert main(command) == 2, command
        assert sentence in capsys.readouterr().err
    with pytest.raises(CaptureError, match="no pictures"):
        evaluate_project(
            open_trained(open_project(folder, is_writable=False)), clip_indices=[0], on_progress=lambda *_: None
        )
    assert len(shown(folder, 0)) == 60


def test_an_import_that_ends_early_leaves_nothing(scene: Path, tmp_path: Path):
    def give_up(n_done: int, n: int) -> None:
        if n_done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        import_scene(scene, tmp_path / "p", report=give_up)
    (scene / "4.ply").write_bytes(b"ply\n")
    with pytest.raises(ProjectError, match="head is not complete"):
        import_scene(scene, tmp_path / "p")
    assert [path.name for path in tmp_path.iterdir()] == ["dance"]


def test_a_name_that_is_taken_is_refused(scene: Path, tmp_path: Path):
    with pytest.raises(ProjectError, match="already taken"):
        import_scene(scene, scene)
    with pytest.raises(ProjectError, match="frames per second"):
        import_scene(scene, tmp_path / "p", fps=float("nan"))


def test_no_project_is_made_inside_another(scene: Path, tmp_path: Path):
    folder = import_scene(scene, tmp_path / "p").folder
    with pytest.raises(ProjectError, match="inside a project"):
        import_scene(scene, folder / "clips" / "new")


def test_its_clips_are_called_imported(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder = import_scene(scene, tmp_path / "p").folder
    for command in (["clips", str(folder)], ["inspect", str(folder)]):
        assert main(command) == 0
        said = capsys.readouterr().out
        assert "imported" in said
        assert "trained" not in said
        assert "reference clip" not in said


@pytest.mark.parametrize("wrong", ["presence", "rows", "missing", "infinite"])
def test_a_damaged_clip_is_one(scene: Path, tmp_path: Path, wrong: str):
    folder = import_scene(scene, tmp_path / "p").folder
    path = folder / "clips" / "0000.safetensors"
    state = read_clip_state(path)
    name = {"presence": "gaussians.moving.presence"}.get(wrong, "gaussians.moving.means")
    array = state.arrays[name].copy()
    array.reshape(-1)[:1] = {"presence": False, "infinite": np.inf}.get(wrong, 0)
    arrays = state.arrays | {name: array[1:] if wrong == "rows" else array}
    if wrong == "missing":
        del arrays[name]
    write_clip_state(path, replace(state, arrays=arrays))
    with pytest.raises(ProjectError, match="damaged"):
        shown(folder, 0)


def test_the_window_imports_a_scene_and_opens_it_the_next_time(scene: Path, tmp_path: Path):
    session = Session(settings=Settings(tmp_path / "settings.json"), is_preloading=False)
    try:
        session.dispatch(OpenCapture(scene, is_asking=True))
        poll_until(session, lambda: session.capture is not None, what="the import")
        assert session.capture is not None
        assert not session.capture.has_pictures
        assert [state.state for state in session.clip_states] == ["trained"]
        assert session.project_status is not None
        assert session.project_status.trained_text == "1 of 1 clips imported"
        (folder,) = projects_dir().iterdir()
        session.dispatch(TrainClip(0, is_confirmed=True))
        session.dispatch(SplitClip(3, is_confirmed=True))
        told = [notice.detail for notice in session.notices]
        assert len(told) == 2
        assert all("no pictures" in text for text in told)
        session.dispatch(OpenCapture(scene))
        poll_until(session, lambda: not session.jobs, what="opening again")
        assert list(projects_dir().iterdir()) == [folder]
    finally:
        session.close()


def test_a_scene_that_cannot_be_imported_is_said(scene: Path, tmp_path: Path):
    (scene / "4.ply").write_bytes(b"ply\n")
    session = Session(settings=Settings(tmp_path / "settings.json"), is_preloading=False)
    try:
        session.dispatch(OpenCapture(scene))
        poll_until(session, lambda: bool(list(session.notices)), what="the notice")
        (notice,) = session.notices
        assert notice.title == "dance cannot be imported"
        assert session.capture is None
    finally:
        session.close()
